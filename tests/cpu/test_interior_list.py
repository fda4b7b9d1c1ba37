"""Interior lists of the bodies that rays are inside, and what fills the places that they stand for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.cpu.interior_list import MOST, InteriorMedia, empty_interior_lists, enter, has, leave
from translucent.diffusion.interfaces import AIR, InterfaceTable
from translucent.geometry.solids import Box
from translucent.reference.volume import Volume, multiplicities

MESH = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)).tessellate()
RAY = np.zeros(1, dtype=np.int64)


def at(item: int) -> npt.NDArray[np.int16]:
    return np.array([item], dtype=np.int16)


def scene_of(*priorities: int, overlap: str = "add") -> tl.Scene:
    media = [tl.Medium(absorption=(i + 1.0, 2.0, 3.0), emission=(0.0, i, 1.0), ior=1.2) for i in range(len(priorities))]
    media[1:2] = media[:1] if overlap == "union" else media[1:2]
    bodies = [tl.Object(MESH, medium, priority=own) for medium, own in zip(media, priorities, strict=True)]
    return tl.Scene(bodies, tl.Camera.look_at((3, 3, 3), (0, 0, 0)), overlap=overlap)


def test_bodies_are_left_in_any_order() -> None:
    interior = empty_interior_lists(1)
    for item in (3, 1, 2):
        assert not enter(interior, RAY, at(item)).any()
    assert interior[0, :4].tolist() == [3, 1, 2, -1]
    assert has(interior, at(1)).all()
    assert not leave(interior, RAY, at(1)).any()
    assert interior[0, :4].tolist() == [3, 2, -1, -1]
    assert leave(interior, RAY, at(1)).all(), "it is not there"
    assert interior[0, :4].tolist() == [3, 2, -1, -1]


def test_a_body_that_winds_twice_is_left_twice_and_keeps_its_turn() -> None:
    interior, media = empty_interior_lists(1), InteriorMedia(InterfaceTable(scene_of(0, 0), (None, None)))
    for item in (0, 1, 0):
        enter(interior, RAY, at(item))
    assert media.effective(interior).tolist() == [1], "of equal priorities the medium that was entered last"
    leave(interior, RAY, at(0))
    assert has(interior, at(0)).all()
    leave(interior, RAY, at(1))
    assert media.effective(interior).tolist() == [0]
    leave(interior, RAY, at(0))
    assert media.effective(interior).tolist() == [AIR]


def test_a_full_record_says_so() -> None:
    interior = empty_interior_lists(1)
    for item in range(MOST):
        assert not enter(interior, RAY, at(item)).any()
    assert enter(interior, RAY, at(MOST)).all()
    assert enter(interior, RAY, at(0)).all()
    assert interior[0].tolist() == list(range(MOST))


@pytest.mark.parametrize("overlap", ["add", "union", "priority"])
def test_mixtures_are_those_of_the_reference(overlap: str, rng: np.random.Generator) -> None:
    scene = scene_of(2, 1, 3, 0, overlap=overlap)
    windings = rng.integers(0, 3, (4, 200)).astype(np.int32)
    interior = empty_interior_lists(200)
    for item in rng.permutation(4):
        for again in range(2):
            rays = np.flatnonzero(windings[item] > again)
            enter(interior, rays, np.full(len(rays), item, dtype=np.int16))
    found = InteriorMedia(InterfaceTable(scene, (None,) * 4)).coefficients(interior)
    weights, volume = multiplicities(scene, np.arange(4), windings).T, Volume(scene)
    for own, table in zip(found, (volume.extinction, volume.emission), strict=True):
        np.testing.assert_allclose(own, weights @ table, rtol=1e-14)


def test_priority_decides_and_then_the_later_entry() -> None:
    scene = scene_of(5, 1, 5, overlap="priority")
    media = InteriorMedia(InterfaceTable(scene, (None,) * 3))
    for order, expected in (((0, 1, 2), 2), ((2, 1, 0), 0), ((0, 1), 0), ((1,), 1), ((), AIR)):
        interior = empty_interior_lists(1)
        for item in order:
            enter(interior, RAY, at(item))
        assert media.effective(interior).tolist() == [expected]
