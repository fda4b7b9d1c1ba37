"""Comparisons with the float64 reference: of what, and how."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.preview.waiting import SIZE, wait
from tests.processes import PATIENCE
from translucent.preview import measuring, workspace
from translucent.preview.actions import OrbitBy, SetField
from translucent.preview.measuring import crossing, measure
from translucent.preview.window_state import WindowState
from translucent.preview.workspace import Workspace
from translucent.scene.texture import Texture


def leaf() -> tl.Scene:
    """A painted leaf with an interface, whose upper half is cut out."""
    pixels = np.full((8, 8, 4), 0.5, dtype=np.float32)
    pixels[:4, :, 3], pixels[4:, :, 3] = 0.0, 1.0
    square = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    mesh = tl.Mesh(square, [(0, 1, 2), (1, 3, 2)], uv=[place[:2] for place in square])
    surface = tl.Surface(color_texture=Texture(pixels), alpha_cutoff=0.5)
    cut = tl.Object(mesh, tl.Medium(50.0, ior=1.3), surface=surface, sheet_thickness=0.01)
    return tl.Scene([cut], tl.Camera.look_at((0.5, 0.5, 3), (0.5, 0.5, 0)))


def test_the_reference_has_the_holes_of_a_leaf() -> None:
    thickness = [crossing(leaf(), (60, 60), (30, y)).thickness for y in (22, 38)]
    assert sorted(thickness)[0] == 0.0
    assert 0.01 < sorted(thickness)[1] < 0.0102
    found = measure(leaf(), None, (30, 30))
    seen, float32 = found.errors[0], 1e-6 * 0.01
    assert (seen.coverage_mismatch, seen.max < float32) == (0.0, True)
    assert (found.truth.min(axis=(1, 2)) < 250).mean() < 0.3, "half of the leaf is seen"


def test_the_inset_shows_textures_paint_and_leaves() -> None:
    halves = np.zeros((2, 2, 4), dtype=np.float32)  # red above; blue, and cut out on the right, below
    halves[0, :] = (1.0, 0.0, 0.0, 1.0)
    halves[1, :] = (0.0, 0.0, 1.0, 1.0)
    halves[1, 1, 3] = 0.0
    uv = [(0, 0), (1, 0), (0, 1), (1, 1)]
    square = tl.Mesh([(*place, 0) for place in uv], [(0, 1, 2), (1, 3, 2)], uv=uv)
    texture = Texture(halves, wrap=("clamp", "clamp"))
    leaf = tl.Object(square, surface=tl.Surface(color_texture=texture, alpha_cutoff=0.5))
    painted = tl.Surface(color_texture=texture, transmission=0.0)
    beside = np.eye(4)
    beside[0, 3] = 1.0
    glass = tl.Object(square, tl.Medium(ior=1.5), transform=beside, surface=painted, sheet_thickness=0.01)
    camera = tl.Camera.orthographic((1.0, 0.5, 3), (1.0, 0.5, 0), height=1.0)
    seen = measure(tl.Scene([leaf, glass], camera), None, (16, 8)).truth
    for first in (0, 90):
        above, below, cut_out = (seen[y, first + x].tolist() for x, y in ((10, 10), (10, 80), (80, 80)))
        assert above == [255, 0, 0]
        assert below == [0, 0, 255]
        assert cut_out == [255, 255, 255], "the hole shows what is behind"


class StillView:
    """A view whose picture is always there."""

    idle, state, viewport = False, "full picture", SimpleNamespace(size=SIZE, steps=lambda _: 0)

    def draw(self, *_: object) -> bool:
        return False


def test_measuring_waits_for_what_the_picture_needs_and_is_cancelled_when_things_move(
    work: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    view: Any = StillView()
    state, begun = WindowState(work, view), list[tl.Scene]()
    monkeypatch.setattr(workspace, "STILL", -1.0)
    monkeypatch.setattr(WindowState, "_keep_picture", lambda _: None)
    monkeypatch.setattr(work, "measure", lambda scene, *_: begun.append(scene))
    wait(work, lambda: work.loaded is not None and not work.prepares)
    reads = threading.Event()
    work.lanes["light"].start("setting the stage", lambda _: reads.wait(PATIENCE), lambda _: None)
    assert state.draw(SIZE)
    assert not begun
    reads.set()
    wait(work, lambda: work.lanes["light"].task is None)
    state.draw(SIZE)
    assert begun == [work.scene()]
    task = work.lanes["draw"].start("measuring", lambda _: None, lambda _: None)
    work.do(OrbitBy(10.0, 0.0))
    state.draw(SIZE)
    assert task.cancelled
    assert begun[1:] == [work.scene()]
    monkeypatch.setattr(measuring, "MOST_TRIANGLES", 10)
    work.do(OrbitBy(10.0, 0.0))
    state.draw(SIZE)
    assert len(begun) == 2
    work.do(SetField("display.inset", True))
    state.draw(SIZE)
    assert begun[2:] == [work.scene()]
