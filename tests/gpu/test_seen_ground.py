"""The ground as bodies show it: as it is beside them, and the same wherever the picture ends."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Sphere

SIDE, PART = 32, 4
BALL = Sphere().tessellate(24)


def staged(ior: float, height: float) -> tl.Scene:
    camera = tl.Camera.look_at((0.0, height, 6.0), (0.0, 0.0, 0.0), fov_y=24.0)
    body = tl.Object(BALL, tl.Medium(ior=ior), surface=tl.Surface())
    return tl.staged(tl.Scene([body], camera, environment_shadows=1))


@pytest.mark.parametrize(("height", "depth"), [(0.15, 12), (2.0, 12), (2.0, 1)])
def test_a_body_that_bends_nothing_shows_the_ground_as_it_is(renderer: tl.Renderer, height: float, depth: int) -> None:
    """Nearly edge-on, neighboring pixels of it are far apart, and it is darker far away; where rays are cut, too."""
    straight = renderer.render(staged(1.0, height), (SIDE, SIDE), samples=1)
    traced = tl.TracedInterfaces(depth=depth)
    seen = renderer.render(staged(1.00001, height), (SIDE, SIDE), samples=1, interfaces=traced)
    covered = straight.coverage & seen.coverage
    off = np.abs(seen.radiance - straight.radiance)[covered].max(axis=-1) / straight.radiance[covered].max(axis=-1)
    print(f"mean {off.mean():.1e}, largest {off.max():.1e}")
    assert off.mean() < 1e-4


def test_a_mirror_image_of_the_ground_does_not_depend_on_the_picture(renderer: tl.Renderer) -> None:
    """The middle of a picture is a picture of the middle, in which most of what the ball shows is outside."""
    whole = staged(1.5, 1.0)
    whole = dataclasses.replace(whole, camera=dataclasses.replace(whole.camera, fov_y=70.0))
    fov = 2.0 * np.degrees(np.arctan(np.tan(np.radians(35.0)) / PART))
    part = dataclasses.replace(whole, camera=dataclasses.replace(whole.camera, fov_y=fov))
    low, high = SIDE // 2 - SIDE // PART // 2, SIDE // 2 + SIDE // PART // 2
    middle = renderer.render(whole, (SIDE, SIDE), samples=1).radiance[low:high, low:high]
    alone = renderer.render(part, (SIDE // PART, SIDE // PART), samples=1).radiance
    off = np.abs(middle - alone).max(axis=-1) / alone.mean()
    print(f"median {np.median(off):.1e}, mean {off.mean():.1e}")
    assert off.mean() < 2e-2
