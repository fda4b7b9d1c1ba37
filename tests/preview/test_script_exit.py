"""Exit codes of ``translucent preview --script``: the window is stood in for, its workspace is the real one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import Run
from tests.preview.waiting import wait
from translucent.commands import viewers as preview_command
from translucent.errors import RenderError
from translucent.preview import app
from translucent.preview.actions import ChoosePreset, SetField
from translucent.preview.document import Document, Model
from translucent.preview.workspace import Workspace


def _wrong_preset(work: Workspace) -> None:
    work.do(ChoosePreset("unobtainium"))
    work.do(SetField("material.color", [0.6, 0.1, 0.2]))


def _lost_file(work: Workspace) -> None:
    def lose(_: Any) -> None:
        raise RenderError("output 'a.png'", "the output cannot be written (No space left on device)", "check the disk")

    work.lanes["write"].start("writing", lose, print)
    wait(work, lambda: work.failure is not None)


def _defect(work: Workspace) -> None:
    work.refuse(RuntimeError("no luck"))


def _model_that_is_none(work: Workspace) -> None:
    work.open(Model("absent.glb"))
    wait(work, lambda: work.failure is not None)


@pytest.fixture
def preview(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Any]:
    """Run the verb with a script; `actions` stands for what the window does."""

    def _run(actions: Callable[[Workspace], None], *arguments: str) -> Any:
        def stand_in(document: Document, *_: object) -> Workspace:
            work = Workspace(document)
            wait(work, lambda: work.loaded is not None)
            actions(work)
            work.close()
            wait(work, lambda: work.ended)
            return work

        monkeypatch.setattr(app, "run", stand_in)
        monkeypatch.setattr(preview_command, "require_display", lambda: None)
        (tmp_path / "script.toml").write_text('[[action]]\ndo = "frame"\n')
        return run("preview", "leaf", "--script", tmp_path / "script.toml", *arguments)

    return _run


@pytest.mark.parametrize(
    ("actions", "code", "message"),
    [
        (_wrong_preset, 2, "preset 'unobtainium'; no preset has this name"),
        (_model_that_is_none, 2, "absent.glb"),
        (_lost_file, 1, "No space left on device"),
        (_defect, 1, "unexpected RuntimeError: no luck"),
    ],
    ids=["preset", "model", "disk", "defect"],
)
def test_a_scripted_action_that_fails_is_the_exit_code(
    preview: Callable[..., Any], actions: Callable[[Workspace], None], code: int, message: str
) -> None:
    result = preview(actions)
    assert result.code == code
    (line,) = result.err.splitlines()
    assert line.startswith("error: ")
    assert message in line
    told = preview(actions, "--json")
    assert told.code == code
    assert message in json.loads(told.out)["messages"][-1]["text"]


def test_a_script_that_does_what_it_says_returns_0(preview: Callable[..., Any]) -> None:
    assert preview(lambda work: work.tell("info", "wrote a.png")) == (0, "", "info: wrote a.png\n")
