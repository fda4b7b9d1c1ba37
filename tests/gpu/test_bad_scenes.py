"""Refusals, in words, of what is no scene, wherever one is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import translucent as tl
from translucent.geometry.solids import Box


@pytest.mark.parametrize("what", ["plan", "render", "reference", "write_page"])
def test_a_mesh_is_no_scene(renderer: tl.Renderer, tmp_path: Path, what: str) -> None:
    asked: dict[str, Callable[..., object]] = {
        "plan": tl.plan,
        "render": lambda mesh: renderer.render(mesh, (8, 8)),
        "reference": lambda mesh: tl.reference.render(mesh, (8, 8)),
        "write_page": lambda mesh: tl.write_page(mesh, tmp_path / "page.html"),
    }
    with pytest.raises(tl.InputError, match=r"the object is a Mesh; give a tl\.Scene, for example tl\.showcase"):
        asked[what](Box().tessellate())
