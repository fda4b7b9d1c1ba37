"""Scenes of many bodies: what is done for a frame grows as their number does, and not with its square."""

from __future__ import annotations

import pytest
import trimesh

import translucent as tl
from tests.work import calls

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces)
GLASS, WINE = tl.Medium(absorption=1.0, ior=1.5), tl.Medium(absorption=(1, 2, 3))
FEW = 20


def scene(count: int, overlap: str) -> tl.Scene:
    """Bodies with interfaces and without, sheets, and opaque objects, one after the other."""
    kinds = [(GLASS, None), (WINE, None), (GLASS, 1e-3), (None, None)]
    objects = []
    for i in range(count):
        medium, sheet = kinds[i % len(kinds)]
        at = trimesh.transformations.translation_matrix((2.0 * i, 0, 0))
        objects.append(tl.Object(BOX, medium, at, sheet_thickness=sheet))
    return tl.Scene(objects, tl.Camera.look_at((0, 0, 20), (0, 0, 0)), overlap=overlap)


@pytest.mark.parametrize("method", [None, tl.FragmentLists()])
def test_frames_of_many_bodies_are_drawn_in_linear_time(method: tl.Method | None, renderer: tl.Renderer) -> None:
    def work(count: int) -> int:
        given = scene(count, "add")
        return calls(lambda: renderer.render(given, (8, 8), method, samples=2))

    work(FEW)
    # What a frame takes besides its bodies is the same for any number of them.
    assert work(3 * FEW) - work(2 * FEW) < 1.1 * (work(2 * FEW) - work(FEW))
