"""What the README says works."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from translucent.cli import cli, main

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_python_snippets_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renderer: object) -> None:
    monkeypatch.chdir(tmp_path)
    snippets = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert snippets
    for snippet in snippets:
        exec(compile(snippet, "README.md", "exec"), {})
    assert (tmp_path / "knot.png").stat().st_size > 1000


@pytest.fixture
def one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report of one scene besides the model: all of them take a minute. Pictures of no stated size are small."""
    from translucent.bench import run

    for option in (option for command in cli.commands.values() for option in command.params):
        if option.default == "1280x720":
            monkeypatch.setattr(option, "default", "320x180")
    monkeypatch.setattr(run, "QUICK", run.Effort(0.0, 0.0, 0.3))
    monkeypatch.setattr(run, "CASES", run.CASES[:1])
    monkeypatch.setattr(run.ScalingRun, "ladders", lambda _: [])
    monkeypatch.setattr(run, "measure_hard_cases", lambda _: iter(()))


COMMANDS = [line.removeprefix("$ translucent ") for line in README.splitlines() if line.startswith("$ translucent ")]

#: Needs a display: its tests are in tests/preview.
WINDOWED = "preview"


@pytest.mark.usefixtures("one_scene")
@pytest.mark.parametrize("command", [command for command in COMMANDS if command.split()[0] != WINDOWED])
def test_commands_run(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renderer: object) -> None:
    import trimesh

    monkeypatch.chdir(tmp_path)
    trimesh.creation.icosphere(subdivisions=2).export("model.glb")
    trimesh.creation.icosphere(subdivisions=2).export("model.stl")
    assert main(shlex.split(command)) == 0


def test_all_verbs_are_shown() -> None:
    assert {command.split()[0] for command in COMMANDS} == set(cli.commands)


@pytest.mark.usefixtures("one_scene")
def test_examples_in_the_help_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renderer: object) -> None:
    import trimesh

    monkeypatch.chdir(tmp_path)
    trimesh.creation.icosphere(subdivisions=1).export("model.glb")
    trimesh.creation.icosphere(subdivisions=1).export("model.stl")
    for name, command in cli.commands.items():
        assert command.epilog is not None
        if name == WINDOWED:
            continue
        example = command.epilog.removeprefix("Example: translucent ")
        assert main(shlex.split(example)) == 0, example
