"""Surfaces that are inside out somewhere, found by winding numbers along sample lines."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import translucent as tl
from translucent.bench.shapes import backward_window, bow_tie, inside_out_slab_beside_an_open_box, nested_shells
from translucent.geometry import winding
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.geometry.winding import winds_negatively
from translucent.planning.plan import plan

CAMERA = tl.Camera.look_at((0, 0, 4), (0, 0, 0))


def joined(*meshes: tl.Mesh) -> tl.Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return tl.Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces)


def turned(mesh: tl.Mesh) -> tl.Mesh:
    return tl.Mesh(mesh.vertices, mesh.faces[:, ::-1])


BOX = Box((-1, -1, -1), (1, 1, 1)).tessellate()
SOUND = {
    "box": BOX,
    "torus": Torus().tessellate(24),
    "hollow balls": nested_shells(3, 16),
    "two that overlap": joined(Sphere().tessellate(16), Sphere((0.5, 0.2, 0.1)).tessellate(16)),
    "one that lacks a face": tl.Mesh(BOX.vertices, BOX.faces[1:]),
    "a doubled wall": joined(BOX, turned(BOX)),
}
INSIDE_OUT = {
    "a lobe": bow_tie(),
    "the other lobe": turned(bow_tie()),
    "a window": backward_window(),
    "a part beside an open one": inside_out_slab_beside_an_open_box(),
}


@pytest.mark.parametrize("mesh", SOUND.values(), ids=SOUND)
def test_a_sound_surface_never_winds_negatively(mesh: tl.Mesh) -> None:
    assert not winds_negatively(mesh.vertices, mesh.faces)
    assert not mesh.diagnosis.inside_out


@pytest.mark.parametrize("mesh", INSIDE_OUT.values(), ids=INSIDE_OUT)
def test_what_is_inside_out_is_found(mesh: tl.Mesh) -> None:
    assert winds_negatively(mesh.vertices, mesh.faces)
    assert mesh.diagnosis.inside_out
    assert not mesh.diagnosis.sound


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_size_and_place_make_no_difference(scale: float, shift: float) -> None:
    for mesh, found in ((bow_tie(), True), (SOUND["torus"], False)):
        assert winds_negatively((mesh.vertices + shift) * scale, mesh.faces) is found


def test_a_body_that_is_inverted_as_a_whole_is_judged_as_it_is_drawn() -> None:
    ball = turned(Torus().tessellate(24))
    assert ball.diagnosis.inverted
    assert ball.diagnosis.sound


def test_the_diagnosis_names_a_lobe() -> None:
    words = "inside out in places: the surface intersects itself, and the faces of one lobe point inwards"
    assert str(bow_tie().diagnosis) == f"closed, 1 component; {words}"


def test_where_a_lobe_is_inside_out_the_order_of_surfaces_has_to_be_found() -> None:
    scene = tl.Scene([tl.Object(bow_tie(), tl.Medium(absorption=1.0))], CAMERA)
    assert plan(scene).ordered
    assert "'bow tie' is inside out in places" in plan(scene).passes[0].reason
    assert plan(scene, tl.SignedDepth()).limits == (
        "'bow tie': the mesh is inside out in places: SignedDepth cannot tell which pixels are wrong, and marks all as "
        "invalid; FragmentLists can",
    )


def test_faces_that_all_reach_across_the_mesh_meet_fewer_lines() -> None:
    """A fan of 3,000 faces on one edge would meet 96 x 96 lines in three directions, and keep 400 MB of crossings."""
    angle = np.linspace(0.0, 6.0, 3000)
    rim = np.stack([np.cos(angle), np.sin(angle), np.full(3000, 0.5)], axis=1)
    vertices = np.concatenate([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], rim])
    faces = np.stack([np.zeros(3000), np.ones(3000), np.arange(2, 3002)], axis=1).astype(np.int32)
    tracemalloc.start()
    try:
        winds_negatively(vertices, faces)
        assert tracemalloc.get_traced_memory()[1] < 150_000_000
    finally:
        tracemalloc.stop()


def test_what_is_large_and_inside_out_is_found_by_few_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(winding, "MOST_TESTS", 1000)
    for mesh, found in ((bow_tie(), True), (SOUND["torus"], False)):
        assert winds_negatively(mesh.vertices, mesh.faces) is found
