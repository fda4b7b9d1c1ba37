"""Segments from intervals and sheets, written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.reference.compositing import composite
from translucent.reference.intervals import Intervals
from translucent.reference.segments import Segments, mix, scene_segments
from translucent.reference.sheets import Crossings
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Overlap, Scene

CAMERA = Camera.orthographic((0, 0, 5), (0, 0, 0))
MESH = Box().tessellate()
A, B = Medium(absorption=1.0, emission=4.0), Medium(absorption=2.0, emission=8.0)


def scene(overlap: Overlap, *media: Medium | None, priorities: tuple[int, ...] = (0, 0, 0, 0)) -> Scene:
    objects = [Object(MESH, medium, priority=p) for medium, p in zip(media, priorities, strict=False)]
    return Scene(objects, CAMERA, overlap=overlap)


def intervals(*rows: tuple[int, float, float, int, int]) -> Intervals:
    pixel, t_enter, t_exit, body, winding = np.reshape(np.array(rows, dtype=np.float64), (-1, 5)).T
    return Intervals(
        *(c if c is t_enter or c is t_exit else c.astype(np.int64) for c in (pixel, t_enter, t_exit, body, winding))
    )


def crossings(*rows: tuple[int, float, float, int]) -> Crossings:
    pixel, distance, path, body = np.reshape(np.array(rows, dtype=np.float64), (-1, 4)).T
    nothing = np.zeros(len(path)), np.zeros((len(path), 3))
    return Crossings(pixel.astype(np.int64), distance, path, body.astype(np.int64), *nothing)


def rows(found: Segments) -> list[tuple[float, ...]]:
    """Pixel, t_enter, t_exit, length, extinction and emission of one channel, count."""
    columns = (found.pixel, found.t_enter, found.t_exit, found.length, found.extinction[:, 0], found.emission[:, 0])
    return list(zip(*columns, found.count, strict=True))


def test_pieces_lie_between_neighboring_surfaces_of_all_bodies() -> None:
    inside = intervals((0, 1, 4, 0, 1), (0, 2, 6, 1, 2), (0, 7, 8, 0, 1), (2, 0, 1, 1, 1), (2, 1, 3, 0, 1))
    assert rows(scene_segments(scene("add", A, B), inside, crossings())) == [
        (0, 1, 2, 1, 1, 4, 1),
        (0, 2, 4, 2, 5, 20, 3),
        (0, 4, 6, 2, 4, 16, 2),
        (0, 7, 8, 1, 1, 4, 1),
        (2, 0, 1, 1, 2, 8, 1),
        (2, 1, 3, 2, 1, 4, 1),
    ]


def test_a_sheet_cuts_the_piece_in_which_it_stands() -> None:
    inside = intervals((0, 1, 4, 0, 1), (1, 1, 2, 0, 1), (2, 1, 2, 0, 1))
    sheets = crossings((0, 3, 0.5, 1), (0, 9, 0.25, 1), (1, 2, 0.5, 1), (2, 1, 0.5, 1))
    for policy in ("add", "union", "priority"):
        assert rows(scene_segments(scene(policy, A, B), inside, sheets)) == [
            (0, 1, 3, 2, 1, 4, 1),
            (0, 3, 3, 0.5, 2, 8, 1),
            (0, 3, 4, 1, 1, 4, 1),
            (0, 9, 9, 0.25, 2, 8, 1),
            (1, 1, 2, 1, 1, 4, 1),
            (1, 2, 2, 0.5, 2, 8, 1),
            (2, 1, 1, 0.5, 2, 8, 1),
            (2, 1, 2, 1, 1, 4, 1),
        ]


@pytest.mark.parametrize("policy", ["add", "union", "priority"])
def test_nothing_and_sheets_alone(policy: Overlap) -> None:
    assert rows(scene_segments(scene(policy, A, None), intervals(), crossings())) == []
    found = scene_segments(scene(policy, A, None), intervals(), crossings((3, 2, 0.5, 0)))
    assert rows(found) == [(3, 2, 2, 0.5, 1, 4, 1)]
    emitted, depth = composite(found, 4)
    assert depth[:, 0].tolist() == [0, 0, 0, 0.5]
    assert emitted[3, 0] == pytest.approx(-4 * np.expm1(-0.5), rel=1e-15)


def test_media_count_once_by_their_values() -> None:
    twin = Medium(absorption=0.25, scattering=0.75, emission=4.0, anisotropy=0.5)
    windings = np.array([[1, 2, 1, 0, -1], [1, 0, 0, 3, -1], [0, 0, 5, 1, 1]], dtype=np.int32)
    extinction, emission, count = mix(scene("union", A, twin, B), np.arange(3), windings)
    assert extinction[:, 0].tolist() == [1, 1, 3, 3, 2]
    assert emission[:, 1].tolist() == [4, 4, 12, 12, 8]
    assert count.tolist() == [1, 1, 1, 1, 1]


def test_the_highest_priority_wins_and_of_equals_the_first() -> None:
    windings = np.array([[1, 1, 1, 0], [0, 2, 2, 1], [0, 0, 1, 3]], dtype=np.int32)
    c = Medium(absorption=3.0)
    for priorities, expected in (((0, 1, 2), [1, 2, 3, 3]), ((-1, -3, -2), [1, 1, 1, 3]), ((7, 7, 7), [1, 1, 1, 2])):
        extinction, _, count = mix(scene("priority", A, B, c, priorities=priorities), np.arange(3), windings)
        assert extinction[:, 2].tolist() == expected
        assert count.tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("policy", ["add", "union", "priority"])
def test_a_negative_winding_fills_nothing(policy: Overlap) -> None:
    extinction, emission, count = mix(scene(policy, A, B), np.arange(2), np.array([[-1, -2], [0, 1]], dtype=np.int32))
    assert (extinction[:, 0].tolist(), emission[:, 0].tolist(), count.tolist()) == ([0, 2], [0, 8], [0, 1])
