"""Footprints of pixels: their differentials against differences of the formulas, and both renderers' pictures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import translucent as tl
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.cpu import surroundings
from translucent.cpu.renderer import CpuRenderer
from translucent.formulas.interface import reflected_direction, refracted_direction
from translucent.geometry.ray_caster import SceneRayCaster, dot, unit
from translucent.geometry.solids import Sphere
from translucent.scene.showcase import framing

STEP = 1e-6
RNG = np.random.default_rng(3)
NORMALS = unit(RNG.normal(size=(40, 3)))
DIRECTIONS = unit(-NORMALS + 0.8 * unit(RNG.normal(size=(40, 3))))
INCIDENT, TURNS = (
    0.1 * (some - np.einsum("kij,kj->ki", some, along)[..., None] * along[:, None])
    for some, along in zip(RNG.normal(size=(2, 40, 2, 3)), (DIRECTIONS, NORMALS), strict=True)
)


@pytest.mark.parametrize("ior", [None, 1.5, 1.0 / 1.5])
def test_differentials_are_those_of_the_formulas(ior: float | None) -> None:
    """Igehy 1999, equations 13 to 17."""
    iors = np.full(40, ior or 1.0)
    function: Callable[[Array, Array], Array] = (
        reflected_direction if ior is None else lambda d, n: np.asarray(refracted_direction(d, n, iors))
    )
    found = (
        surroundings.reflected_differentials(INCIDENT, TURNS, DIRECTIONS, NORMALS)
        if ior is None
        else surroundings.refracted_differentials(INCIDENT, TURNS, DIRECTIONS, NORMALS, iors)
    )
    # Where little is left to total reflection, differentials are bounded.
    cosine = dot(DIRECTIONS, NORMALS)
    usual = 1.0 - (1.0 - cosine**2) / iors**2 > 0.1
    assert usual.sum() > 15
    for i in range(2):
        ends = [function(DIRECTIONS + s * INCIDENT[:, i], NORMALS + s * TURNS[:, i]) for s in (STEP, -STEP)]
        np.testing.assert_allclose(found[usual, i], ((ends[0] - ends[1]) / (2.0 * STEP))[usual], atol=1e-7)


def test_normals_change_as_they_are_interpolated() -> None:
    ball = tl.Object(Sphere().tessellate(96), tl.Medium(ior=1.5))
    caster = SceneRayCaster([ball])
    face = np.arange(0, len(caster.faces.number), 601)
    middle = caster.faces.corner[face] + caster.faces.edges[face].mean(axis=1) * 2.0 / 3.0
    points = np.cross(caster.faces.outward[face], np.eye(3)[:2, None]).transpose(1, 0, 2)
    found = surroundings.normal_differentials(caster, face, middle, points, caster.faces.outward[face])
    # A ball's normals turn by as much as a point moves on it, in radii of the ball.
    np.testing.assert_allclose(found, caster.radius * points, atol=0.02)
    onwards = surroundings.onto_planes(points + 0.3, -middle, caster.faces.outward[face])
    np.testing.assert_allclose(np.einsum("kij,kj->ki", onwards, caster.faces.outward[face]), 0.0, atol=1e-12)


def test_an_ellipse_has_the_moments_of_the_footprint() -> None:
    axis, breadth = surroundings.ellipses(INCIDENT)
    moments = np.linalg.eigvalsh(np.einsum("kij,kil->kjl", INCIDENT, INCIDENT) / 12.0)
    np.testing.assert_allclose(dot(axis, axis), moments[:, 2], rtol=1e-9)
    np.testing.assert_allclose(breadth**2, moments[:, 1], atol=1e-12)


def test_both_renderers_average_alike(renderer: tl.Renderer) -> None:
    knot = tl.Object(tl.load_mesh(mesh_path("knot")), tl.Medium(absorption=(2.0, 1.0, 1.5), ior=1.5))
    scene = tl.Scene([knot], framing([knot], (32, 24)), environment=tl.Environment.studio())
    drawn = renderer.render(scene, (32, 24), samples=1, interfaces=tl.TracedInterfaces())
    found = CpuRenderer().render(drawn.plan, (32, 24))
    apart = np.abs(found.radiance - drawn.radiance)[drawn.coverage & found.coverage]
    assert np.median(apart) < 2e-3
    assert np.quantile(apart, 0.9) < 0.02
