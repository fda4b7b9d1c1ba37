"""Bodies in which light diffuses, for tests: their grids, and light that enters them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

import translucent as tl
from translucent.diffusion.entering_rays import EnteringRays
from translucent.diffusion.field import DiffusingBody, DiffusionField
from translucent.diffusion.grid import BodyGrid, body_grid
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.solution import BodySystem, DiffuseSolution
from translucent.geometry.solids import Sphere
from translucent.planning.scattering import Diffusion

Array = npt.NDArray[np.float64]

CAMERA = tl.Camera.look_at((0, 0, 5), (0, 0, 0))
BLACK, WHITE = tl.Environment.constant((0, 0, 0)), tl.Environment.constant((1, 1, 1))
BALL = Sphere().tessellate(64)


@lru_cache(maxsize=8)
def ball_grid(resolution: int) -> BodyGrid:
    return grid_of(BALL, resolution)


def grid_of(mesh: tl.Mesh, resolution: int) -> BodyGrid:
    body = tl.Object(mesh, tl.Medium(scattering=1.0))
    return body_grid(body, Diffusion(resolution).cell_size(body))


def lit(
    grid: BodyGrid, medium: tl.Medium, entering: npt.ArrayLike = 1.0, inside: Array | None = None
) -> DiffuseSolution:
    """Light of a body on which none of its light falls again."""
    flux = np.broadcast_to(np.asarray(entering, np.float64), (len(grid.points), 3)).copy()
    return BodySystem(grid, medium, 0.0).solved(flux, None, np.zeros((grid.count, 3)) if inside is None else inside)


def lit_by_rays(grid: BodyGrid, medium: tl.Medium, rays: EnteringRays) -> DiffuseSolution:
    """Light of a body in a rays, on which none of its light falls again."""
    dark = np.zeros((len(grid.points), 3))
    return BodySystem(grid, medium, 0.0).solved(dark, None, np.zeros((grid.count, 3)), [rays])


def entering_of(grid: BodyGrid, rays: EnteringRays) -> Array:
    """Flux (s, 3) that a rays brings in."""
    flux = np.zeros((len(grid.points), 3))
    flux[rays.samples] = rays.entering
    return flux


def seen_field(
    body: tl.Object,
    *lights: tl.PointLight | tl.DirectionalLight,
    environment: tl.Environment = BLACK,
    resolution: int = 16,
) -> DiffusionField:
    scene = tl.Scene([body], CAMERA, lights, environment)
    assert body.medium is not None
    geometry = lit_body(body, None, Diffusion(resolution).cell_size(body))
    return DiffusingBody(geometry, body.medium, 0.0).field(scene, 0)
