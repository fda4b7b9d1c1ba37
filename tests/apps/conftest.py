"""A small model, and machines that lack something."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import trimesh

from translucent.gpu import context


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.ply"
    trimesh.creation.box((1, 1, 1)).export(path)
    return path


@pytest.fixture
def no_opengl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refuse() -> Any:
        raise Exception("no such library")  # a bare one, as glcontext raises

    monkeypatch.setattr(context, "_OPENERS", dict.fromkeys(context._OPENERS, refuse))
    return
