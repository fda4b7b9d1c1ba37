"""Media with their surfaces: presets and colors in `Object`, `showcase` and scenes that are filled."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

import translucent as tl
from translucent.geometry.solids import Box
from translucent.scene.showcase import filled, with_media

BOX = Box((0, 0, 0), (0.1, 0.1, 0.1)).tessellate()


def test_a_preset_brings_medium_and_surface_together() -> None:
    wax = tl.preset("wax")
    for item in (
        tl.Object(BOX, material="wax"),
        tl.Object(BOX, material=wax),
        tl.showcase(BOX, "wax").bodies[0],
        tl.showcase(BOX, wax).bodies[0],
        dataclasses.replace(tl.Object(BOX, material="wax"), priority=1),
    ):
        assert item.medium == wax.medium
        assert item.surface is not None
        assert item.surface.roughness == wax.roughness == 0.35


def test_a_color_at_a_distance_is_that_of_a_solid() -> None:
    for scene in (tl.showcase(BOX, "#ace5c9", 0.25), tl.showcase(BOX, "#ace5c9", (320, 200), distance=0.25)):
        assert scene.bodies[0].medium == tl.Medium.from_color("#ace5c9", 0.25, ior=1.5)
    # The media themselves keep what they are without a surface.
    assert tl.Medium.from_color("#ace5c9", 0.25).ior == tl.Medium().ior == 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tl.showcase(BOX, "#ace5c9"), "a color needs a distance; give the distance in metres after which"),
        (lambda: tl.showcase(BOX, "waxx"), "did you mean wax"),
        (lambda: tl.showcase(BOX, tl.preset("wax"), distance=0.25), "a Preset, and no color"),
        (lambda: tl.Object(BOX, tl.Medium(), material="wax"), "a medium is given, too"),
        (lambda: tl.Object(BOX, material="salmon pink"), "no preset has this name"),
    ],
)
def test_what_is_no_material_is_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        make()


def test_objects_keep_the_ior_of_their_file_under_a_color() -> None:
    stated, opaque = tl.Object(BOX, tl.Medium(ior=1.33)), tl.Object(BOX)
    scene = tl.showcase(BOX)
    scene = dataclasses.replace(scene, objects=[stated, opaque])
    solid = tl.Medium.from_color("#ace5c9", 0.25, ior=1.5)
    kept = filled(scene, solid, scene.objects, keeps_ior=True)
    assert [item.medium.ior for item in kept.objects if item.medium] == [1.33, 1.5]
    assert [item.medium.ior for item in filled(scene, solid, scene.objects).objects if item.medium] == [1.5, 1.5]
    thin = with_media(kept, lambda medium: medium.diluted(5.0)).objects[1].medium
    assert thin == tl.Medium.from_color("#ace5c9", 1.25, ior=1.5)
