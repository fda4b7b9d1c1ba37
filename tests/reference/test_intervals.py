"""Intervals and the winding number where rays begin."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, SphericalShell
from translucent.media.medium import Medium
from translucent.reference import Hits, line_hits
from translucent.reference.hits import pixel_rays
from translucent.reference.intervals import Intervals, body_intervals, merge, scene_intervals, unbalanced
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

MEDIUM = Medium(absorption=1.0)

#: Ends of rays that no opaque surface stops.
FREE = np.full(5, np.inf)


def hits(*rows: tuple[int, float, int]) -> Hits:
    pixel, distance, sign = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    integers = pixel.astype(np.int64)
    return Hits(integers, distance, sign.astype(np.int8), integers, np.full((len(integers), 3), 1 / 3))


def intervals(scene: Scene) -> tuple[Intervals, bool]:
    """Intervals of all objects on the one ray of the scene, and True if it is defective."""
    hits = [line_hits(body.mesh, body.matrix, scene.camera, (1, 1)) for body in scene.objects]
    rays = pixel_rays(scene.camera, (1, 1))
    found, defective = scene_intervals(scene, rays, hits, range(len(hits)), np.array([np.inf]))
    return found, bool(defective[0])


def rows(found: Intervals) -> list[tuple[float, ...]]:
    return list(zip(found.pixel, found.t_enter, found.t_exit, found.winding, strict=True))


def test_windings_count_from_the_origin_of_each_ray() -> None:
    surface = hits(
        (0, 1, 1), (0, 2, 1), (0, 3, -1), (0, 5, -1), (2, 4, -1), (3, 1, 1), (3, 1, -1), (3, 2, 1), (3, 3, -1)
    )
    origin = np.array([0, 0, 1, 0, 0])
    found = body_intervals(surface, origin, FREE, body=7)
    assert rows(found) == [(0, 1, 2, 1), (0, 2, 3, 2), (0, 3, 5, 1), (2, 0, 4, 1), (3, 2, 3, 1)]
    assert found.body.tolist() == [7] * 5
    assert found.thickness.tolist() == [1, 2, 2, 4, 1]
    assert not unbalanced(surface, origin).any()


def test_unbalanced_rays_are_named() -> None:
    surface = hits((0, 1, 1), (1, 1, 1), (1, 2, -1), (2, 3, -1), (3, 1, -1))
    assert unbalanced(surface, np.array([0, 0, 1, 0, 1])).tolist() == [True, False, False, True, True]


def test_a_stopped_ray_is_in_a_body_up_to_its_end() -> None:
    surface = hits((0, 1, 1), (1, 1, 1), (1, 2, -1), (3, 1, -1))
    origin, end = np.array([0, 0, 1, 1, 0]), np.array([3.0, 3, 4, np.inf, 2])
    assert rows(body_intervals(surface, origin, end)) == [(0, 1, 3, 1), (1, 1, 2, 1), (2, 0, 4, 1), (3, 0, 1, 1)]


def test_hits_before_the_end_of_a_ray() -> None:
    surface = hits((0, -1, 1), (0, 0, 1), (0, 2, -1), (0, 3, 1), (1, 3, 1))
    kept = surface.before(np.array([3.0, np.inf]))
    assert list(zip(kept.pixel, kept.distance, strict=True)) == [(0, 0), (0, 2), (1, 3)]


def test_nothing_is_an_empty_list() -> None:
    found = body_intervals(hits(), np.zeros(4, dtype=np.int64), FREE[:4])
    assert found.pixel.size == found.thickness.size == 0
    assert found.winding.dtype == np.int64


def test_merged_intervals_are_in_order() -> None:
    outside = np.zeros(2, dtype=np.int64)
    one = body_intervals(hits((0, 1, 1), (0, 4, -1), (1, 5, 1), (1, 6, -1)), outside, FREE[:2], 0)
    two = body_intervals(hits((0, 0, 1), (0, 2, -1), (1, 5, 1), (1, 7, -1)), outside, FREE[:2], 1)
    both = merge([two, one])
    assert list(zip(both.pixel, both.t_enter, both.body, strict=True)) == [(0, 0, 1), (0, 1, 0), (1, 5, 0), (1, 5, 1)]


def test_a_mesh_that_overlaps_itself_counts_twice() -> None:
    a, b = Box((0, 0, 0), (2, 1, 1)).tessellate(), Box((1, 0, 0), (4, 1, 1)).tessellate()
    both = Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.faces, b.faces + len(a.vertices)]))
    camera = Camera.orthographic((-1.0, 0.5, 0.5), (0.0, 0.5, 0.5), height=0.9)
    found, defective = intervals(Scene([Object(both, MEDIUM)], camera))
    assert rows(found) == [(0, 1, 2, 1), (0, 2, 3, 2), (0, 3, 5, 1)]
    assert not defective


def test_a_place_with_a_negative_winding_is_a_defect_though_the_rest_is_longer() -> None:
    a, b = Box((0, 0, 0), (3, 1, 1)).tessellate(), Box((4, 0, 0), (5, 1, 1)).tessellate()
    faces = np.concatenate([a.faces, b.faces[:, ::-1] + len(a.vertices)])
    both = Mesh(np.concatenate([a.vertices, b.vertices]), faces)
    camera = Camera.orthographic((-1.0, 0.5, 0.5), (0.0, 0.5, 0.5), height=0.9)
    found, defective = intervals(Scene([Object(both, MEDIUM)], camera))
    assert rows(found) == [(0, 1, 4, 1), (0, 5, 6, -1)]
    assert defective


def test_shells_and_bodies_within_bodies() -> None:
    """Windings, not parity: a solid ball in the cavity of a shell, and all of it in a box."""
    shell = Object(SphericalShell(outer=2.0, inner=1.0).tessellate(48), MEDIUM)
    box = Object(Box((-3, -3, -3), (3, 3, 3)).tessellate(), MEDIUM)
    camera = Camera.orthographic((0.013, 0.017, 9.0), (0.013, 0.017, 0.0), height=0.1)
    found, defective = intervals(Scene([shell, box], camera))
    assert found.body.tolist() == [1, 0, 0]
    np.testing.assert_allclose(found.t_enter, [6, 7, 10], atol=0.01)
    np.testing.assert_allclose(found.t_exit, [12, 8, 11], atol=0.01)
    assert not defective


@pytest.mark.parametrize(("z", "expected"), [(0.0, [(0, 0.5)]), (0.9, [(0.4, 1.4)]), (-0.7, [])])
def test_orthographic_rays_may_begin_inside(z: float, expected: list[tuple[float, float]]) -> None:
    camera = Camera.orthographic((0.1, 0.1, z), (0.1, 0.1, -2.0), height=0.1)
    found, defective = intervals(Scene([Object(Box().tessellate(), MEDIUM)], camera))
    np.testing.assert_allclose(np.stack([found.t_enter, found.t_exit], axis=1), np.reshape(expected, (-1, 2)))
    assert not defective
