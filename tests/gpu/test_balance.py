"""Rules by which pixels are trusted, worked out without OpenGL."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.values.plan_scenes import BOX, GLASS, OPEN, body, scene, sheet
from translucent.gpu.placement import (
    COVERAGE_FLOOR,
    ROUNDING,
    UNEXPECTED,
    Balance,
    PlacedScene,
    count_weights,
    face_counts,
)
from translucent.planning.methods import Method

INSIDE, ON_FACE, OUTSIDE = (0.1, 0.1, 0.1), (0.1, 0.2, 0.5), (0.1, 0.1, 20.0)


def seen_from(eye: tuple[float, float, float], *objects: tl.Object) -> tl.Scene:
    return tl.Scene(objects, tl.Camera.look_at(eye, (0, 0, -30)))


def balance(found: tl.Scene, method: Method | None = None) -> Balance:
    return Balance.of(PlacedScene.of(found), method or tl.SignedDepth(), face_counts(found, 8))


def half_turned() -> tl.Mesh:
    """Two boxes apart; the faces of one look inwards."""
    box = trimesh.creation.box((1, 1, 1))
    vertices = np.concatenate([box.vertices, box.vertices + [3.0, 0.0, 0.0]])
    return tl.Mesh(vertices, np.concatenate([box.faces, box.faces[:, ::-1] + len(box.vertices)]))


def test_only_open_bodies_of_a_medium_weigh_more() -> None:
    objects = [body(), body(mesh=OPEN), body(None, OPEN), body(x=2.0), body(mesh=OPEN, x=4.0)]
    assert count_weights(scene(*objects)) == [1.0, 16.0, 1.0, 1.0, 256.0]


def test_the_last_weight_is_shared_where_float32_ends() -> None:
    weights = count_weights(scene(*(body(mesh=OPEN, x=2.0 * i) for i in range(8))))
    assert weights == [16.0, 256.0, 4096.0, 65536.0, 1048576.0, 1048576.0, 1048576.0, 1048576.0]


def test_holes_of_several_bodies_never_cancel() -> None:
    """Up to 7 faces too many or too few of each: the sum is 0 only where all balance, exactly in float32."""
    weights = count_weights(scene(body(), *(body(mesh=OPEN, x=2.0 * i) for i in range(1, 6))))
    missing = np.array(list(itertools.product((-7, -1, 0, 1, 7), repeat=len(weights))), dtype=np.float32)
    parts = missing * np.array(weights, dtype=np.float32)
    sums = np.add.accumulate(parts, axis=1, dtype=np.float32)[:, -1]
    assert (sums == parts.astype(np.float64).sum(axis=1)).all()
    assert ((sums == 0) == (missing == 0).all(axis=1)).all()


def test_a_body_that_is_inside_out_is_marked_wherever_it_is() -> None:
    turned = half_turned()
    assert turned.diagnosis.inside_out
    found = scene(body(mesh=turned), body(None, turned), body())
    assert face_counts(found, 8).offsets.tolist() == [UNEXPECTED, 0.0, 0.0]


@pytest.mark.parametrize("broken", [half_turned(), OPEN], ids=["inside out", "open"])
def test_only_scenes_of_sound_bodies_blame_the_rasterizer(broken: tl.Mesh) -> None:
    found = scene(body(), body(None, broken), sheet())
    assert face_counts(found, 4).subpixel == 1 / 16
    assert face_counts(found, 4).snapping_share == 1 / 16 / found.diagonal
    found = scene(body(), body(mesh=broken))
    counts = face_counts(found, 4)
    assert (counts.subpixel, counts.snapping_share) == (0.0, 0.0)


def test_a_pixel_expects_the_winding_number_of_the_eye() -> None:
    assert balance(seen_from(OUTSIDE, body())).expected_count == (0.0, 0.0)
    assert balance(seen_from(INSIDE, body())).expected_count == (1.0, 1.0)
    assert balance(seen_from(INSIDE, body(), body(x=0.2), body(None), body(x=5.0))).expected_count == (2.0, 2.0)


def test_on_a_surface_rays_start_on_either_side() -> None:
    assert balance(seen_from(ON_FACE, body())).expected_count == (0.0, 1.0)
    assert balance(seen_from(ON_FACE, body(), body(x=0.2, mesh=BOX))).expected_count == (0.0, 2.0)


def test_an_open_body_around_the_eye_counts_with_its_weight() -> None:
    """The eye is still mostly inside of a box without one of 12 triangles."""
    assert balance(seen_from(INSIDE, body(), body(mesh=OPEN))).expected_count == (17.0, 17.0)


@pytest.mark.parametrize("found", [seen_from(INSIDE, sheet()), seen_from(INSIDE, sheet(), body(x=9.0))])
def test_sheets_have_no_inside(found: tl.Scene) -> None:
    assert balance(found).expected_count == (0.0, 0.0)


def test_a_method_that_makes_sheets_expects_nothing() -> None:
    assert balance(seen_from(INSIDE, body()), tl.ThinLayer()).expected_count == (0.0, 0.0)


def test_orthographic_rays_are_whole_lines() -> None:
    camera = tl.Camera.orthographic(INSIDE, (0, 0, -30), height=2.0)
    assert balance(tl.Scene([body()], camera)).expected_count == (0.0, 0.0)


def test_rounding_grows_with_distance_only_where_distances_count_from_the_camera() -> None:
    near, far = (seen_from((0.0, 0.0, z), body()) for z in (4.0, 4000.0))
    assert balance(near).rounding == balance(far).rounding == ROUNDING * near.diagonal
    unanchored = tl.SignedDepth(anchored=False)
    assert balance(far, unanchored).rounding == pytest.approx(ROUNDING * (far.diagonal + 4000.0))
    assert balance(near, unanchored).rounding == pytest.approx(ROUNDING * (near.diagonal + 4.0))


def test_what_counts_as_covered_scales_with_the_scene() -> None:
    large = tl.Object(BOX, GLASS, np.diag([1e3, 1e3, 1e3, 1.0]))
    small, big = seen_from(OUTSIDE, body()), seen_from((0.0, 0.0, 1e4), large)
    assert balance(small).coverage_floor == COVERAGE_FLOOR * np.sqrt(3.0)
    assert balance(big).coverage_floor == pytest.approx(1e3 * balance(small).coverage_floor)


def boxes_with_holes() -> tl.Mesh:
    """Boxes one behind the other from the eye on: of the second the near side has a hole, of the third the far one."""
    parts = []
    for low, high, side in ((-1.0, 1.0, None), (-3.5, -2.0, 1.0), (-6.0, -3.7, -1.0)):
        box = trimesh.creation.box(bounds=[[-1.0, -1.0, low], [1.0, 1.0, high]])
        box = box.subdivide().subdivide().subdivide()
        near_axis = np.abs(box.triangles_center[:, :2]).max(axis=1) < 0.25
        kept = ~(near_axis & (box.face_normals[:, 2] == side)) if side is not None else slice(None)
        parts.append(trimesh.Trimesh(box.vertices, box.faces[kept], process=False))
    joined = trimesh.util.concatenate(parts)
    return tl.Mesh(joined.vertices, joined.faces)


@pytest.mark.parametrize("method", [None, tl.SignedDepth()])
def test_two_holes_ahead_of_an_eye_within_do_not_cancel(method: Method | None, renderer: tl.Renderer) -> None:
    """Rays leave at 1, then at 3.5, and enter at 3.7: as many faces as of one body, whose thickness would be .8."""
    holes = boxes_with_holes()
    assert not holes.diagnosis.inside_out
    around = tl.Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov_y=4.0)
    found = tl.Scene([tl.Object(holes, tl.Medium(absorption=0.1))], around)
    with pytest.warns(tl.TranslucentWarning, match="open edges"):
        frame = renderer.render(found, (24, 24), method=method)
    assert frame.coverage.all()
    assert not frame.valid.any()
    assert "two holes" in str(frame.plan)


def test_two_holes_ahead_of_an_eye_outside_do_not_cancel_where_the_planner_chooses(renderer: tl.Renderer) -> None:
    holes = boxes_with_holes()
    assert holes.diagnosis.holes == 2
    before = tl.Camera.look_at((0.0, 0.0, 9.0), (0.0, 0.0, -1.0), fov_y=1.0)
    found = tl.Scene([tl.Object(holes, tl.Medium(absorption=0.1))], before)
    with pytest.warns(tl.TranslucentWarning, match="open edges"):
        frame = renderer.render(found, (24, 24))
    assert frame.coverage.all()
    assert not frame.valid.any()
    assert any("2 holes: SignedDepth may miss" in note for note in tl.plan(found, tl.SignedDepth()).limits)
