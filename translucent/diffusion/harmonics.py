"""Transfer of light through a body: its subsurface light by diffusion for each spherical harmonic of the light around.

Diffusion is linear in the light. A harmonic has both signs, and light has one: the body is solved for in uniform light
and in light that is uniform plus a harmonic, and the difference is what belongs to the harmonic.

References
----------
Sloan, Kautz & Snyder 2002, "Precomputed radiance transfer for real-time rendering in dynamic, low-frequency lighting
environments".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Floats
from translucent.diffusion.entering import MAP_HEIGHT
from translucent.diffusion.field import DiffusingBody, DiffusionField
from translucent.diffusion.lit_body import lit_body
from translucent.diffusion.sides import read_sides
from translucent.errors import InputError
from translucent.formulas.spherical_harmonics import BAND_0, COUNT, real_harmonics
from translucent.planning.scattering import Diffusion
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.scene import Object, Scene

#: Uniform radiance that is above every harmonic's least value, -0.63.
UNIFORM = 0.7


@dataclass(frozen=True, eq=False)
class Transfer:
    """Transfer of a body on a grid of cells around its surface.

    Attributes
    ----------
    values : (6, x, y, z, 9, 3) float32
        See `at`.
    low, turn : (3,), (3, 3) float64
        Corner of the grid in metres, and its axes, in columns.
    step : float
        Side of a cell in metres.
    cells : int
        In the system.
    """

    values: Floats
    low: Array
    turn: Array
    step: float
    cells: int

    def at(self, points: Array, normals: Array) -> Array:
        """(k, 9, 3): mean subsurface radiance of points of the surface, normals (k, 3), for a unit of each harmonic."""
        flat = self.values.reshape(*self.values.shape[:4], -1)
        places = (points - self.low) @ self.turn / self.step
        return read_sides(flat, places, normals @ self.turn).reshape(-1, COUNT, 3)


def exit_radiance(field: DiffusionField, points: Array, normals: Array) -> Array:
    """(k, 3): mean radiance, flux over pi, that the diffused light has outside at points with normals (k, 3)."""
    return field.exit_share / np.pi * field.at_surface(field.fluence, points, normals)


class LitAlone:
    """Solver of the subsurface light of a single body in an environment.

    Parameters
    ----------
    body : Object
        With a medium.
    resolution : int
        See `translucent.Diffusion`.

    Raises
    ------
    InputError
        If its light cannot diffuse, or the medium does not scatter, or emits.
    """

    def __init__(self, body: Object, resolution: int) -> None:
        diffusion = Diffusion(resolution)
        _check(body, diffusion)
        assert body.medium is not None
        roughness = 0.0 if body.surface is None else body.surface.roughness
        self._body = body
        self._camera = Camera.look_at((0, 0, 1), (0, 0, 0))  # which the light does not depend on
        geometry = lit_body(body, None, diffusion.cell_size(body))
        self._diffusing = DiffusingBody(geometry, body.medium, roughness, warm_starts=True)

    def field(self, environment: Environment) -> DiffusionField:
        """Subsurface light of the body."""
        return self._diffusing.field(Scene([self._body], self._camera, (), environment), 0)

    def transfer(self) -> Transfer:
        """Transfer of the body.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        uniform = self.field(Environment.constant((1, 1, 1)))
        values = np.empty((*uniform.fluence.shape[:4], COUNT, 3), np.float32)
        with np.errstate(under="ignore"):
            values[..., 0, :] = BAND_0 * uniform.fluence
            for i in range(1, COUNT):
                values[..., i, :] = self.field(_harmonic(i)).fluence - UNIFORM * uniform.fluence
            values *= uniform.exit_share / np.pi
        return Transfer(values, uniform.low, uniform.turn, uniform.step, uniform.cells)


def _harmonic(index: int) -> Environment:
    """Light of a harmonic and `UNIFORM`, white, at the texels that the samples of a body look up."""

    def radiance(directions: Array) -> Array:
        return np.repeat(UNIFORM + real_harmonics(directions)[..., index, None], 3, axis=-1)

    return Environment.image(EnvironmentMap.from_formula(radiance, MAP_HEIGHT))


def _check(body: Object, diffusion: Diffusion) -> None:
    requested, medium = f"scattered light of {body.mesh.name!r}", body.medium
    if medium is None or not medium.scatters:
        do = "give a medium that scatters, such as --preset wax, or tl.scattering_medium('#f2e0b8', 0.002)"
        raise InputError(
            requested,
            "the medium of the body does not scatter light" if medium is not None else "the body has no medium",
            do,
        )
    if np.asarray(medium.emission).any():
        raise InputError(
            requested,
            "the medium emits light, which a scatter bake cannot store because it does not depend on the environment",
            "use a medium without emission",
        )
    if (why := diffusion.refusal(body)) is not None:
        raise InputError(requested, why, "use a closed mesh, a thicker body, or a higher resolution")
