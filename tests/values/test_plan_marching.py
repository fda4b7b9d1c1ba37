"""Plans that march: where rays are marched through lists, and through densities that vary."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.plan_scenes import FIRE, NO_STORAGE, WINE, body, names, scene
from translucent.planning.bodies import medium_slots
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities


def test_marching_goes_through_the_lists() -> None:
    found = plan(scene(body(FIRE), body(WINE, x=0.5)), tl.RayMarched(steps=32))
    assert names(found) == ["fragment_lists", "transmittance"]
    assert "32 steps through each interval" in found.passes[0].reason
    assert found.cost < plan(scene(body(FIRE), body(WINE, x=0.5)), tl.RayMarched(steps=64)).cost
    with pytest.raises(tl.InputError, match="shaders support at most 16 Gauss-Legendre points; use fewer steps"):
        plan(scene(body()), tl.RayMarched(steps=17, quadrature="gauss"))
    with pytest.raises(tl.InputError, match="RayMarched; this OpenGL has no shader storage"):
        plan(scene(body()), tl.RayMarched(), NO_STORAGE)


def test_marching_is_not_exact_and_says_so() -> None:
    found = plan(scene(body(FIRE)), tl.RayMarched(steps=32, quadrature="left"))
    assert found.limits == (
        "emission and scattered light are summed over 32 steps in each interval (left), down to a "
        "transmittance of 1e-05",
    )


CLOUD = tl.Medium(scattering=1.0)
SUN = [tl.DirectionalLight((0, -1, 0), (1, 1, 1))]


@pytest.mark.parametrize(
    ("density", "steps"),
    [
        (tl.LinearDensity(0, 0, 1), 64),
        (tl.DensityGrid(np.ones((2, 2, 2))), 64),
        (tl.DensityGrid(np.ones((1, 200, 3))), 200),
    ],
)
def test_where_the_density_varies_rays_march(density: Any, steps: int) -> None:
    found = plan(scene(body(density=density)))
    assert found.method == tl.RayMarched(steps=steps)
    assert names(found) == ["fragment_lists", "transmittance"]
    assert "the density varies from place to place; one draw" in found.passes[0].reason
    assert found.limits[0].startswith(f"optical depth, emission and scattered light are summed over {steps} steps")
    lit = plan(scene(body(CLOUD, density=density), body(x=3), lights=SUN))
    assert names(lit) == ["light_views", "fragment_lists", "transmittance"]
    assert "optical depths towards lights are exact" in lit.limits[0]


@pytest.mark.parametrize(
    "method",
    [tl.SignedDepth(), tl.BackFaceDepth(), tl.ThinLayer(), tl.FragmentLists(), tl.DepthPeeling(), tl.KBuffer()],
)
def test_no_other_method_goes_through_a_density(method: Any) -> None:
    cloud = scene(body(density=tl.LinearDensity(0, 0, 1)), body(x=3))
    with pytest.raises(
        tl.InputError, match=f"{type(method).__name__}; 'box': the density varies, .*; use the method RayMarched"
    ):
        plan(cloud, method)


def test_a_density_without_shader_storage_or_without_opengl() -> None:
    cloud = scene(body(density=tl.DensityGrid(np.ones((2, 2, 2)))))
    with pytest.raises(tl.InputError, match="rendering 'box' with a varying density; this OpenGL has no shader st"):
        plan(cloud, None, NO_STORAGE)
    assert plan(cloud, None, Capabilities(opengl=False)).exact


def test_bodies_of_varying_density_have_slots_of_their_own() -> None:
    density = tl.LinearDensity(0, 0, 1)
    found = medium_slots(scene(body(), body(density=density), body(), body(density=density)))
    assert [slot.objects for slot in found] == [(0, 2), (1,), (3,)]
    crowd = [body(density=density) for _ in range(17)]
    with pytest.raises(tl.InputError, match="17 groups of bodies"):
        plan(scene(*crowd))
