"""Environments of files are read in the background, once, and the one before is on show meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.preview.waiting import wait
from tests.processes import PATIENCE
from translucent.preview import scenes
from translucent.preview import scenes as staging
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.document import Document, Model
from translucent.preview.workspace import Workspace


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    found = Workspace(Document(Model("leaf")))
    wait(found, lambda: found.scene() is not None)
    yield found
    found.close()


@pytest.fixture
def sky(tmp_path: Path) -> Path:
    path = tmp_path / "sky.png"
    Image.fromarray(np.tile(np.linspace(20, 250, 16, dtype=np.uint8)[None, :, None], (8, 1, 3))).save(path)
    return path


def kind(workspace: Workspace) -> str:
    scene = workspace.scene()
    assert scene is not None
    assert scene.environment is not None
    return scene.environment.kind


def test_the_one_before_is_on_show_until_a_file_is_read(
    workspace: Workspace, sky: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, asked = threading.Event(), []
    original = staging.named_environment

    def slow(name: str) -> Any:
        asked.append(name)
        read.wait(PATIENCE)
        return original(name)

    monkeypatch.setattr(staging, "named_environment", slow)
    read.set()
    workspace.do(SetField("look.environment", "light-table"))
    before = kind(workspace)
    read.clear()
    workspace.do(SetField("look.environment", str(sky)))
    assert kind(workspace) == before != "image"
    workspace.do(OrbitBy(5.0, 0.0))
    first = workspace.scene()
    assert first is not None
    np.testing.assert_allclose(first.camera.eye, scenes.camera_of(workspace.document.orbit).eye)  # type: ignore[arg-type]
    read.set()
    wait(workspace, lambda: kind(workspace) == "image")
    for rotation in (10.0, 20.0):
        workspace.do(SetField("look.rotation", rotation))
        scene = workspace.scene()
        assert scene is not None
        assert scene.environment is not None
        assert scene.environment.rotation == rotation
    assert asked.count(str(sky)) == 1


def test_a_file_that_cannot_be_read_is_told_once_and_the_one_before_stays(workspace: Workspace, tmp_path: Path) -> None:
    workspace.do(SetField("look.environment", "light-table"))
    before = kind(workspace)
    workspace.do(SetField("look.environment", str(tmp_path / "none.hdr")))
    for _ in range(3):
        kind(workspace)
        wait(workspace, lambda: workspace.lanes["light"].task is None)
    assert [m.text for m in workspace.messages if m.kind == "error"] == [
        f"environment {str(tmp_path / 'none.hdr')!r}; no file has this path; check the path"
    ]
    assert kind(workspace) == before
    workspace.undo()
    assert kind(workspace) == before


def test_a_file_that_changes_is_read_again(workspace: Workspace, sky: Path) -> None:
    workspace.do(SetField("look.environment", str(sky)))
    wait(workspace, lambda: kind(workspace) == "image")
    Image.fromarray(np.full((4, 8, 3), 40, dtype=np.uint8)).save(sky)
    assert scenes.environment_of(str(sky)).light_map.size == (8, 4)
