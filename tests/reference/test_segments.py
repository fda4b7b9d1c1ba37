"""Segments from intervals and sheets, written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from translucent.geometry.solids import Box
from translucent.media.medium import Medium
from translucent.reference.compositing import composite
from translucent.reference.hits import Rays
from translucent.reference.intervals import Intervals
from translucent.reference.surfaces import Crossings
from translucent.reference.volume import Segments, Volume, multiplicities, volume_segments
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


def segments_of(scene: Scene, inside: Intervals, sheets: Crossings) -> Segments:
    rays = Rays(np.zeros((4, 3)), np.tile([0.0, 0.0, 1.0], (4, 1)), np.zeros((4, 2)))
    return volume_segments(scene, Volume(scene), rays, inside, sheets)[0]


def rows(found: Segments) -> list[tuple[float, ...]]:
    """Pixel, t_enter, t_exit, length, extinction and emission of one channel, count."""
    columns = (found.pixel, found.t_enter, found.t_exit, found.length, found.extinction[:, 0], found.emission[:, 0])
    return list(zip(*columns, found.count, strict=True))


def test_pieces_lie_between_neighboring_surfaces_of_all_bodies() -> None:
    inside = intervals((0, 1, 4, 0, 1), (0, 2, 6, 1, 2), (0, 7, 8, 0, 1), (2, 0, 1, 1, 1), (2, 1, 3, 0, 1))
    assert rows(segments_of(scene("add", A, B), inside, crossings())) == [
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
        assert rows(segments_of(scene(policy, A, B), inside, sheets)) == [
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
    assert rows(segments_of(scene(policy, A, None), intervals(), crossings())) == []
    found = segments_of(scene(policy, A, None), intervals(), crossings((3, 2, 0.5, 0)))
    assert rows(found) == [(3, 2, 2, 0.5, 1, 4, 1)]
    emitted, depth = composite(found, 4)
    assert depth[:, 0].tolist() == [0, 0, 0, 0.5]
    assert emitted[3, 0] == pytest.approx(-4 * np.expm1(-0.5), rel=1e-15)


def mixed(scene: Scene, windings: list[list[int]]) -> list[list[float]]:
    """Extinction and emission of one channel where bodies have these windings."""
    weights = multiplicities(scene, np.arange(len(windings)), np.array(windings, dtype=np.int32)).T
    volume = Volume(scene)
    return [(weights @ table)[:, 1].tolist() for table in (volume.extinction, volume.emission)]


def test_media_count_once_by_their_values() -> None:
    twin = Medium(absorption=1.0, emission=4.0)
    windings = [[1, 2, 1, 0, -1], [1, 0, 0, 3, -1], [0, 0, 5, 1, 1]]
    assert mixed(scene("union", A, twin, B), windings) == [[1, 1, 3, 3, 2], [4, 4, 12, 12, 8]]


def test_the_highest_priority_wins_and_of_equals_the_first() -> None:
    c = Medium(absorption=3.0)
    for priorities, expected in (((0, 1, 2), [1, 2, 3, 3]), ((-1, -3, -2), [1, 1, 1, 3]), ((7, 7, 7), [1, 1, 1, 2])):
        found = mixed(scene("priority", A, B, c, priorities=priorities), [[1, 1, 1, 0], [0, 2, 2, 1], [0, 0, 1, 3]])
        assert found[0] == expected


@pytest.mark.parametrize("policy", ["add", "union", "priority"])
def test_a_negative_winding_fills_nothing(policy: Overlap) -> None:
    assert mixed(scene(policy, A, B), [[-1, -2], [0, 1]]) == [[0, 2], [0, 8]]
    inside = intervals((0, 0, 1, 0, -1), (1, 0, 1, 0, -2), (1, 0, 1, 1, 1))
    assert segments_of(scene(policy, A, B), inside, crossings()).count.tolist() == [0, 1]
