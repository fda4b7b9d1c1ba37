"""Intervals and the winding number where rays begin."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.camera import Camera
from translucent.medium import Medium
from translucent.mesh import Mesh
from translucent.reference import Hits, scene_intervals
from translucent.reference.intervals import body_intervals, merge, unbalanced
from translucent.scene import Object, Scene
from translucent.solids import Box, SphericalShell

MEDIUM = Medium(absorption=1.0)


def hits(*rows: tuple[int, float, int]) -> Hits:
    pixel, distance, sign = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    integers = pixel.astype(np.int64)
    return Hits(integers, distance, sign.astype(np.int8), integers, np.full((len(integers), 3), 1 / 3))


def test_windings_count_from_the_origin_of_each_ray() -> None:
    surface = hits(
        (0, 1, 1), (0, 2, 1), (0, 3, -1), (0, 5, -1), (2, 4, -1), (3, 1, 1), (3, 1, -1), (3, 2, 1), (3, 3, -1)
    )
    origin = np.array([0, 0, 1, 0, 0])
    found = body_intervals(surface, origin, body=7)
    assert list(zip(found.pixel, found.t_enter, found.t_exit, found.winding, found.body, strict=True)) == [
        (0, 1, 2, 1, 7),
        (0, 2, 3, 2, 7),
        (0, 3, 5, 1, 7),
        (2, 0, 4, 1, 7),
        (3, 2, 3, 1, 7),
    ]
    assert found.thickness.tolist() == [1, 2, 2, 4, 1]
    assert not unbalanced(surface, origin).any()


def test_unbalanced_rays_are_named() -> None:
    surface = hits((0, 1, 1), (1, 1, 1), (1, 2, -1), (2, 3, -1), (3, 1, -1))
    assert unbalanced(surface, np.array([0, 0, 1, 0, 1])).tolist() == [True, False, False, True, True]


def test_nothing_is_an_empty_list() -> None:
    found = body_intervals(hits(), np.zeros(4, dtype=np.int64))
    assert found.pixel.size == found.thickness.size == 0
    assert found.winding.dtype == np.int64


def test_merged_intervals_are_in_order() -> None:
    one = body_intervals(hits((0, 1, 1), (0, 4, -1), (1, 5, 1), (1, 6, -1)), np.zeros(2, dtype=np.int64), 0)
    two = body_intervals(hits((0, 0, 1), (0, 2, -1), (1, 5, 1), (1, 7, -1)), np.zeros(2, dtype=np.int64), 1)
    both = merge([two, one])
    assert list(zip(both.pixel, both.t_enter, both.body, strict=True)) == [(0, 0, 1), (0, 1, 0), (1, 5, 0), (1, 5, 1)]


def test_a_mesh_that_overlaps_itself_counts_twice() -> None:
    a, b = Box((0, 0, 0), (2, 1, 1)).tessellate(), Box((1, 0, 0), (4, 1, 1)).tessellate()
    both = Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.faces, b.faces + len(a.vertices)]))
    camera = Camera.orthographic((-1.0, 0.5, 0.5), (0.0, 0.5, 0.5), height=0.9)
    found, bad = scene_intervals(Scene([Object(both, MEDIUM)], camera), (1, 1), [0])
    assert list(zip(found.t_enter, found.t_exit, found.winding, strict=True)) == [(1, 2, 1), (2, 3, 2), (3, 5, 1)]
    assert not bad.any()


def test_shells_and_bodies_within_bodies() -> None:
    """Windings, not parity: a solid ball in the cavity of a shell, and all of it in a box."""
    shell = Object(SphericalShell(outer=2.0, inner=1.0).tessellate(48), MEDIUM)
    box = Object(Box((-3, -3, -3), (3, 3, 3)).tessellate(), MEDIUM)
    camera = Camera.orthographic((0.013, 0.017, 9.0), (0.013, 0.017, 0.0), height=0.1)
    found, bad = scene_intervals(Scene([shell, box], camera), (1, 1), [0, 1])
    assert found.body.tolist() == [1, 0, 0]
    np.testing.assert_allclose(found.t_enter, [6, 7, 10], atol=0.01)
    np.testing.assert_allclose(found.t_exit, [12, 8, 11], atol=0.01)
    assert not bad.any()


@pytest.mark.parametrize(("z", "expected"), [(0.0, [(0, 0.5)]), (0.9, [(0.4, 1.4)]), (-0.7, [])])
def test_orthographic_rays_may_begin_inside(z: float, expected: list[tuple[float, float]]) -> None:
    camera = Camera.orthographic((0.1, 0.1, z), (0.1, 0.1, -2.0), height=0.1)
    found, bad = scene_intervals(Scene([Object(Box().tessellate(), MEDIUM)], camera), (1, 1), [0])
    np.testing.assert_allclose(np.stack([found.t_enter, found.t_exit], axis=1), np.reshape(expected, (-1, 2)))
    assert not bad.any()
