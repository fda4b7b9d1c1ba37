"""Slots: which bodies the intervals of a ray need not tell apart, and which priorities contradict each other."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.planning.bodies import MAX_SLOTS, medium_slots, overlapping_pair, require_clear_priorities, same_medium

_BOX = trimesh.creation.box((1, 1, 1))
BOX = tl.Mesh(_BOX.vertices, _BOX.faces, name="box")
OPEN = tl.Mesh(_BOX.vertices, _BOX.faces[1:], name="open box")
INVERTED = tl.Mesh(_BOX.vertices, _BOX.faces[:, ::-1], name="inverted box")
_APART = _BOX.vertices + (5, 0, 0)
#: One part looks outwards, the other inwards, and neither is inside the other.
INSIDE_OUT = tl.Mesh([*_BOX.vertices, *_APART], [*_BOX.faces, *_BOX.faces[:, ::-1] + 8], name="half flipped")
CAMERA = tl.Camera.look_at((0, 0, 20), (0, 0, 0))
MIRROR = np.diag((-1.0, 1.0, 1.0, 1.0))

GLASS, WINE, FIRE = tl.Medium(absorption=1.0), tl.Medium(absorption=(1, 2, 3)), tl.Medium(1.0, emission=(3, 1, 0))
#: As `GLASS` does, each lets exp(-1) of the light through a metre.
LIKE_GLASS = [tl.Medium(absorption=1.0), tl.Medium(scattering=1.0), tl.Medium(0.5, 0.5, anisotropy=0.9, ior=1.5)]


def body(medium: tl.Medium | None = GLASS, mesh: tl.Mesh = BOX, at: Any = (0, 0, 0), **options: Any) -> tl.Object:
    return tl.Object(mesh, medium, trimesh.transformations.translation_matrix(at), **options)


def may_overlap(*bodies: tl.Object) -> bool:
    return overlapping_pair(bodies) is not None


def slots(*objects: tl.Object, **options: Any) -> list[tuple[int, ...]]:
    return [slot.objects for slot in medium_slots(tl.Scene(objects, CAMERA, **options))]


# Who shares a slot


@pytest.mark.parametrize("overlap", ["add", "union", "priority"])
@pytest.mark.parametrize(
    ("objects", "expected"),
    [
        pytest.param([body(), body(), body()], [(0, 1, 2)], id="one medium"),
        pytest.param([body(), *map(body, LIKE_GLASS)], [(0, 1, 2, 3)], id="media that dim alike"),
        pytest.param([body(), body(WINE), body(), body(WINE)], [(0, 2), (1, 3)], id="two media"),
        pytest.param([body(), body(FIRE)], [(0,), (1,)], id="one of them emits"),
        pytest.param([body(), body(mesh=OPEN), body()], [(0, 2), (1,)], id="an open body keeps apart"),
        pytest.param([body(mesh=OPEN), body(), body()], [(0,), (1, 2)], id="an open body first"),
        pytest.param([body(mesh=OPEN), body(mesh=OPEN)], [(0,), (1,)], id="open bodies keep apart from each other"),
        pytest.param([body(), body(mesh=INSIDE_OUT)], [(0,), (1,)], id="winding numbers below 0 keep apart"),
        pytest.param([body(), body(mesh=INVERTED)], [(0, 1)], id="inverted as a whole"),
        pytest.param([body(), tl.Object(BOX, GLASS, MIRROR)], [(0, 1)], id="mirrored"),
        pytest.param([body(None), body(), body(None)], [(1,)], id="opaque objects have none"),
        pytest.param([body(sheet_thickness=0.1), body()], [(1,)], id="sheets have none"),
        pytest.param([body(None), body(sheet_thickness=0.1)], [], id="no solid"),
    ],
)
def test_bodies_that_need_not_be_told_apart_share_a_slot(
    overlap: Any, objects: list[tl.Object], expected: list[tuple[int, ...]]
) -> None:
    assert slots(*objects, overlap=overlap) == expected


def test_priorities_tell_bodies_apart_only_where_they_matter() -> None:
    bodies = [body(priority=1), body(priority=2), body(priority=1)]
    assert slots(*bodies, overlap="priority") == [(1,), (0, 2)]
    assert slots(*bodies, overlap="add") == slots(*bodies, overlap="union") == [(0, 1, 2)]


def test_the_highest_priority_comes_first_and_equals_keep_their_order() -> None:
    bodies = [body(priority=-3), body(WINE, priority=7), body(FIRE), body(WINE), body(FIRE, priority=7), body(WINE)]
    found = medium_slots(tl.Scene(bodies, CAMERA, overlap="priority"))
    assert [slot.objects for slot in found] == [(1,), (4,), (2,), (3, 5), (0,)]
    assert [slot.priority for slot in found] == [7, 7, 0, 0, -3]
    assert [slot.medium for slot in found] == [WINE, FIRE, FIRE, WINE, GLASS]


def test_a_slot_stands_for_the_medium_of_all_its_bodies() -> None:
    media = [WINE, *LIKE_GLASS, FIRE]
    for slot in medium_slots(tl.Scene([body(medium) for medium in media], CAMERA)):
        for i in slot.objects:
            assert np.array_equal(slot.medium.extinction, media[i].extinction)
            assert np.array_equal(slot.medium.emission, media[i].emission)


def test_media_are_the_same_if_they_dim_and_emit_alike() -> None:
    for medium in LIKE_GLASS:
        assert same_medium(body(), body(medium))
    assert not same_medium(body(), body(WINE))
    assert not same_medium(body(), body(FIRE))
    assert not same_medium(body(), body(None))
    assert same_medium(body(None), body(None))


# How many there may be


@pytest.mark.parametrize("method", [tl.DepthPeeling(), tl.FragmentLists(), tl.KBuffer(64), None])
def test_more_slots_than_a_ray_can_keep_apart_are_refused(method: Any) -> None:
    media = [tl.Medium(absorption=1.0 + i, emission=1.0) for i in range(MAX_SLOTS + 1)]
    assert tl.plan(tl.Scene([body(medium) for medium in media[:-1]], CAMERA), method).ordered
    # A medium that is already there needs no slot more.
    assert tl.plan(tl.Scene([body(medium) for medium in (*media[:-1], media[0])], CAMERA), method).ordered
    name = type(method or tl.FragmentLists()).__name__
    message = (
        f"{name}; the scene has 17 groups of bodies (for each medium, priority and open mesh), more than the limit "
        "of 16; use fewer different media and priorities, or close the open meshes"
    )
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        tl.plan(tl.Scene([body(medium) for medium in media], CAMERA), method)


def test_open_bodies_and_priorities_use_up_slots() -> None:
    open_bodies = [body(mesh=OPEN)] * MAX_SLOTS
    ranks = [body(priority=i) for i in range(MAX_SLOTS)]
    for bodies, overlap in ((open_bodies, "union"), (ranks, "priority")):
        assert tl.plan(tl.Scene(bodies, CAMERA, overlap=overlap)).ordered  # type: ignore[arg-type]
        with pytest.raises(tl.InputError, match="17 groups of bodies"):
            tl.plan(tl.Scene([*bodies, body(priority=-1)], CAMERA, overlap=overlap))  # type: ignore[arg-type]


def test_a_sum_knows_no_slots() -> None:
    media = [tl.Medium(absorption=1.0 + i) for i in range(3 * MAX_SLOTS)]
    assert tl.plan(tl.Scene([body(medium) for medium in media], CAMERA)).exact


# Who may overlap


@pytest.mark.parametrize(
    ("at", "overlap"),
    [
        ((0, 0, 0), True),
        ((0.9, 0.9, -0.9), True),
        ((1.1, 0, 0), False),
        ((0, -1.1, 0), False),
        ((0, 0, 1.1), False),
        ((1, 0, 0), False),  # a common face
        ((0, -1, 0), False),
        ((1, 1, 1), False),  # a common corner
        ((0.5, 0.5, 1), False),
    ],
)
def test_bodies_may_overlap_if_their_bounds_share_a_volume(at: Any, overlap: bool) -> None:
    assert may_overlap(body(), body(at=at)) is overlap
    assert may_overlap(body(at=at), body()) is overlap


def test_a_body_inside_another_may_overlap_it() -> None:
    small = tl.Object(BOX, GLASS, np.diag((0.1, 0.1, 0.1, 1.0)))
    assert may_overlap(small, body())
    assert may_overlap(body(), small)
    assert may_overlap(small, small)


def test_the_bounds_are_those_of_the_turned_body() -> None:
    turned = trimesh.transformations.rotation_matrix(np.pi / 4, (0, 0, 1))
    assert may_overlap(tl.Object(BOX, GLASS, turned), body(at=(1.1, 0, 0)))  # sqrt(1/2) + 1/2 > 1.1
    assert not may_overlap(tl.Object(BOX, GLASS, turned), body(at=(1.3, 0, 0)))


# Priorities


@pytest.mark.parametrize("method", [None, tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer(), tl.FragmentLists()])
def test_two_media_of_one_priority_must_not_claim_one_place(method: Any) -> None:
    wine = body(WINE, OPEN, (0.5, 0, 0), priority=4)
    message = (
        "overlap=\"priority\"; objects 1 ('box') and 2 ('open box') may overlap, have different media, and both have "
        "the priority 4; give a higher priority to the object that displaces the other"
    )
    scene = tl.Scene([body(at=(9, 0, 0)), body(priority=4), wine], CAMERA, overlap="priority")
    with pytest.raises(tl.InputError, match=f"^{re.escape(message)}$"):
        tl.plan(scene, method)


@pytest.mark.parametrize(
    "objects",
    [
        pytest.param([body(), body(WINE, priority=1)], id="one goes first"),
        pytest.param([body(), body(LIKE_GLASS[1])], id="they dim alike"),
        pytest.param([body(), body(WINE, at=(1, 0, 0))], id="they only touch"),
        pytest.param([body(), body(WINE, sheet_thickness=0.1)], id="a sheet adds to what it stands in"),
        pytest.param([body(), body(None)], id="an opaque object ends the ray"),
    ],
)
def test_other_bodies_of_one_priority_are_clear(objects: list[tl.Object]) -> None:
    require_clear_priorities(tl.Scene(objects, CAMERA, overlap="priority"))
    with pytest.raises(tl.InputError, match="both have the priority 0"):
        require_clear_priorities(tl.Scene([*objects, body(WINE)], CAMERA, overlap="priority"))


def test_emission_alone_makes_a_contradiction() -> None:
    with pytest.raises(tl.InputError, match="may overlap, have different media, and both have the priority 0"):
        require_clear_priorities(tl.Scene([body(), body(FIRE)], CAMERA, overlap="priority"))


@pytest.mark.parametrize("overlap", ["add", "union"])
def test_priorities_contradict_nothing_where_no_policy_asks_for_them(overlap: Any) -> None:
    assert tl.plan(tl.Scene([body(), body(WINE)], CAMERA, overlap=overlap)).exact
