"""Light scattered once in several bodies: overlaps, and the shadows of bodies, sheets and opaque objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.lit_media import MEDIUM, SLAB, SUN, Array, integral, middle, middle_ray, scene, slab
from translucent.formulas import optics
from translucent.formulas.phase import henyey_greenstein
from translucent.geometry.solids import Box
from translucent.media.density import DensityGrid
from translucent.media.medium import Medium
from translucent.planning.methods import ThinLayer
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Object, Overlap


def layers(light: DirectionalLight, *found: tuple[float, float, list[Medium]]) -> Array:
    """(3,): of layers from z = low to high, the highest first, each filled with a mixture."""
    _, ray = middle_ray()
    travel = np.asarray(light.direction)
    total, above, slope = np.zeros(3), np.zeros(3), 1 / -ray[2] + 1 / -travel[2]
    for low, high, media in found:
        extinction = np.sum([medium.extinction for medium in media], axis=0)
        scattering = sum(np.asarray(m.scattering) * henyey_greenstein(-travel @ ray, m.anisotropy) for m in media)
        # In metres of height, of which the ray is longer.
        own = optics.emitted_radiance(scattering * light.irradiance / -ray[2], extinction * slope, high - low)
        total += np.exp(-above) * own
        above += extinction * slope * (high - low)
    return total


RED, BLUE = MEDIUM, Medium(absorption=(2.0, 0.5, 0.1), scattering=(0.3, 0.6, 0.9), anisotropy=-0.5)
POLICIES: dict[Overlap, list[Medium]] = {"add": [RED, BLUE], "union": [RED, BLUE], "priority": [BLUE]}


@pytest.mark.parametrize("overlap", POLICIES)
def test_overlapping_bodies(overlap: Overlap) -> None:
    """The lower half of one is the upper half of the other; each scatters by its own phase function."""
    upper, lower = Box((-50, -50, -1), (50, 50, 0)), Box((-40, -40, -1.5), (40, 40, -0.5))
    objects = Object(upper.tessellate(), RED, priority=1), Object(lower.tessellate(), BLUE, priority=2)
    expected = layers(SUN, (-0.5, 0.0, [RED]), (-1.0, -0.5, POLICIES[overlap]), (-1.5, -1.0, [BLUE]))
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN], overlap=overlap)), expected, rtol=1e-6)


@pytest.mark.parametrize(("overlap", "times"), [("add", 2), ("union", 1)])
def test_bodies_of_one_medium(overlap: Overlap, times: int) -> None:
    objects = [Object(SLAB.tessellate(), medium) for medium in (RED, replace(RED, ior=1.3))]
    expected = layers(SUN, (-1.0, 0.0, [RED] * times))
    found = middle(scene(*objects, lights=[SUN], overlap=overlap), refraction=False)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_union_tells_media_apart_that_only_scatter_differently() -> None:
    other = Medium(absorption=MEDIUM.extinction)
    objects = [Object(SLAB.tessellate(), medium) for medium in (MEDIUM, other)]
    expected = layers(SUN, (-1.0, 0.0, [MEDIUM, other]))
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN], overlap="union")), expected, rtol=1e-6)


def test_union_counts_varied_bodies_each() -> None:
    """A density is a body's own: what it scales is no medium that another brings, too."""
    lean = DensityGrid([[[0.5]]])
    objects = [Object(SLAB.tessellate(), MEDIUM, density=density) for density in (lean, lean, None)]
    found = middle(scene(*objects, lights=[SUN], overlap="union"))
    np.testing.assert_allclose(found, layers(SUN, (-1.0, 0.0, [MEDIUM, MEDIUM])), rtol=1e-6)


def test_a_body_shades_another() -> None:
    filtered = Box((-50, -50, 5), (50, 50, 6))
    objects = Object(SLAB.tessellate(), RED), Object(filtered.tessellate(), Medium(absorption=(0.1, 0.2, 0.3)))
    path = 1 / -np.asarray(SUN.direction)[2]
    expected = middle(slab(SUN)) * np.exp(-np.array([0.1, 0.2, 0.3]) * path)
    # Above the eye, so the ray does not pass it.
    np.testing.assert_allclose(middle(scene(*objects, lights=[SUN])), expected, rtol=1e-9)


def test_a_sheet_shades_a_body() -> None:
    sheet = Box((-50, -50, 5), (50, 50, 6)).tessellate()
    glass = Object(sheet, Medium(absorption=(10.0, 20.0, 30.0)), sheet_thickness=0.01)
    path = 2 * 0.01 / -np.asarray(SUN.direction)[2]
    expected = middle(slab(SUN)) * np.exp(-np.array([10.0, 20.0, 30.0]) * path)
    np.testing.assert_allclose(middle(scene(Object(SLAB.tessellate(), RED), glass, lights=[SUN])), expected, rtol=1e-9)


def test_sheets_scatter_nothing() -> None:
    of = slab(SUN)
    frame = render(of, (1, 1), ThinLayer(1e-3))
    assert (frame.radiance == 0).all()
    assert frame.valid.all()


def test_an_opaque_object_throws_a_shadow() -> None:
    """Its edge is at x = 0, straight above; the ray passes from the shadow into the light."""
    roof = Object(Box((-60, -60, 5), (0.15, 60, 6)).tessellate())
    sun = DirectionalLight((0, 0, -1), 2.0)
    origin, direction = middle_ray(shadowed := Camera.look_at((-2.0, 0.0, 3.0), (0.15, 0.0, -0.5), fov_y=10))
    edge, end = (0.15 - origin[0]) / direction[0], 4 / -direction[2]
    assert 3 / -direction[2] < edge < end
    start = 3 / -direction[2]

    def integrand(t: float, channel: int) -> float:
        height = -(origin + t * direction)[2]
        return float(np.exp(-MEDIUM.extinction[channel] * (height + t - start)))

    phase = henyey_greenstein(direction[2], MEDIUM.anisotropy)
    integrals = [integral(lambda t, c=c: integrand(t, c), edge, end) for c in range(3)]
    found = middle(scene(Object(SLAB.tessellate(), MEDIUM), roof, lights=[sun], camera=shadowed))
    np.testing.assert_allclose(found, np.asarray(MEDIUM.scattering) * phase * 2.0 * integrals, rtol=2e-6)


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-5])
def test_the_shadow_of_a_pole(width: float) -> None:
    """However narrow, it is not missed: rules of quadrature begin and end at its outline."""
    pole = Object(Box((0.1, -60, 5), (0.1 + width, 60, 6)).tessellate())
    sun = DirectionalLight((0, 0, -1), 2.0)
    camera = Camera.look_at((-2.0, 0.0, 3.0), (0.15, 0.0, -0.5), fov_y=10)
    origin, direction = middle_ray(camera)
    ends = (np.array([0.1, 0.1 + width]) - origin[0]) / direction[0] + 3 / direction[2]
    assert ends.min() > 0
    # From a depth where the ray has gone so far in the slab.
    slope = MEDIUM.extinction * (1 - direction[2])
    phase = henyey_greenstein(direction[2], MEDIUM.anisotropy)
    source = np.asarray(MEDIUM.scattering) * phase * 2.0
    missing = source * np.exp(-slope * ends[0]) * -np.expm1(-slope * (ends[1] - ends[0])) / slope
    plain, found = (
        middle(scene(Object(SLAB.tessellate(), MEDIUM), *more, lights=[sun], camera=camera), tolerance=1e-9)
        for more in ([], [pole])
    )
    np.testing.assert_allclose(plain - found, missing, rtol=1e-3)


def test_an_opaque_object_stops_the_ray() -> None:
    """Bodies behind it are not seen, and it does not shade itself from above."""
    floor = Object(Box((-60, -60, -0.6), (60, 60, -0.4)).tessellate(), color=(0, 0, 0))
    found = middle(scene(Object(SLAB.tessellate(), MEDIUM), floor, lights=[SUN]))
    np.testing.assert_allclose(found, layers(SUN, (-0.4, 0.0, [MEDIUM])), rtol=1e-9)
