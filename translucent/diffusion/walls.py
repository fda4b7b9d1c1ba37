"""Light in walls of few cells: each part of a wall is a slab, lit on both sides.

A grid cannot see what happens in a wall that is about as thick as its cells: the fluence there depends on where the
surface cuts them, which shows as contour lines. Light leaves such a wall next to where it enters, on either side. So
there the diffusion equation is solved exactly in one dimension, from each sample of the surface straight down to the
other side, and finer grids take over from it as they come to have enough cells. What diffusion gets wrong in slabs is
taken out by their exact fluxes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from translucent.arrays import Array, Integers, Mask
from translucent.diffusion.grid import THIN, BodyGrid
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface, diffusion_coefficient
from translucent.formulas.phase import PhaseFunction
from translucent.formulas.slab import slab_fluxes

#: Thickness of walls, in cells, up to which they are slabs; from `THIN` on cells are enough.
SLAB = 2.0

#: Ratio of the areas of both sides, the smaller one over the other, from which on a wall is flat, and up to which it is
#: no slab.
_FLAT, _CURVED = 0.8, 0.5

#: Times that area ratios are averaged over neighbors.
MEANS = 3

#: Cosine between the normals of samples on one side of a wall, at least.
_ALIKE_NORMALS = 0.5

#: Squared distance of the sample across from where it should be, in areas around samples, up to which it is one.
_NEAR = 4.0

#: Albedo below which light is in proportion to it.
_LEAST_ALBEDO = 1e-6

#: Relative distance of two rates of decay that are equal, up to which one is moved: their difference divides.
_ALIKE = 1e-6


@dataclass(frozen=True, eq=False)
class Walls:
    """Walls of a body.

    Attributes
    ----------
    part : (s,) float64
        Of the fluence below each sample that is that of a slab, 0 to 1; the rest is that of the cells.
    across : (s,) int64
        Sample on the other side.
    thickness : (s,) float64
        Metres.
    area : (s,) float64
        Of the other side over that of this one: so much of what enters there comes to an area here.
    """

    part: Array
    across: Integers
    thickness: Array
    area: Array

    @classmethod
    def of(cls, grid: BodyGrid) -> Walls:
        """Thin walls of a diffusion grid; none where the density varies, and around opaque objects inside."""
        count, normals = len(grid.points), grid.face_normals
        part, across = np.zeros(count), np.arange(count)
        thickness = np.where(np.isfinite(grid.thickness), grid.thickness, 0.0)
        thin, other = grid.across
        if grid.inclusions is not None or grid.body.density is not None or not len(thin):
            return cls(part, across, thickness, np.ones(count))
        across[thin] = other
        # Next to a rim there may be no sample on the other side.
        ends = grid.points[thin] - thickness[thin, None] * normals[thin]
        near = ((grid.points[other] - ends) ** 2).sum(axis=1) < _NEAR * grid.area
        cells = thickness[thin] / grid.cells.step
        part[thin] = near * grid.parallel * np.clip((THIN - cells) / (THIN - SLAB), 0.0, 1.0)
        if not part.any():
            return cls(part, across, thickness, np.ones(count))
        area = _area_ratios(grid, thickness, np.flatnonzero(part))
        flat = np.minimum(area, 1.0 / area)
        return cls(part * np.clip((flat - _CURVED) / (_FLAT - _CURVED), 0.0, 1.0), across, thickness, area)

    @cached_property
    def lit(self) -> Mask:
        """(s,): samples whose light enters thin walls, on either side."""
        found = self.part > 0.0
        found[self.across[found]] = True
        return found

    @property
    def any(self) -> bool:
        """True if there are walls."""
        return bool(self.lit.any())


def _area_ratios(grid: BodyGrid, thickness: Array, samples: Integers) -> Array:
    """(s,): area of the other side of a wall over that of this one, at samples (k,); 1 at all others.

    From the spreads of neighboring samples on both sides.
    """
    points, normals = grid.points, grid.normals
    # Means of means at the samples read their neighbors' neighbors.
    for _ in range(MEANS):
        samples = np.unique(grid.nearest[samples])
    nearest, own = grid.nearest[samples], normals[samples]
    aside = np.where(np.abs(own[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(own, aside)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    plane = np.stack([across, np.cross(own, across)], axis=1)

    # Of neighbors, those on the same side.
    same = (np.einsum("sc,snc->sn", own, normals[nearest]) > _ALIKE_NORMALS).astype(np.float64)
    share = same / same.sum(axis=1, keepdims=True)

    def spread(places: Array) -> Array:
        offset = places[nearest] - np.einsum("sn,snc->sc", share, places[nearest])[:, None]
        flat = np.einsum("snc,sic->sni", offset, plane)
        return np.asarray(np.linalg.det(np.einsum("sn,sni,snj->sij", share, flat, flat)))

    # Where the samples of a group lie on a line nothing is known.
    least = (1e-3 * grid.area) ** 2
    squared = np.maximum(spread(points - thickness[:, None] * normals), least) / np.maximum(spread(points), least)
    # So few samples say little of it, and their neighbors are as curved.
    ratio = np.zeros(len(points))
    ratio[samples] = 0.5 * np.log(squared)
    for _ in range(MEANS):
        ratio[samples] = np.einsum("sn,sn->s", share, ratio[nearest])
    return np.asarray(np.exp(ratio))


class SlabSolution:
    """Fluence that light makes at both surfaces of the walls of a body, in one color channel.

    Parameters
    ----------
    walls : Walls
    ior : float
    absorption, scattering : float
        The reduced one, in 1/m.
    phase : PhaseFunction
    """

    def __init__(self, walls: Walls, ior: float, absorption: float, scattering: float, phase: PhaseFunction) -> None:
        self._walls, self._extinction = walls, absorption + scattering
        albedo = max(round(scattering / self._extinction, 6), _LEAST_ALBEDO)
        self._conductance, self._mean_cosine = diffuse_interface(ior).conductance, diffuse_interface(ior).mean_cosine
        self._table = exact = slab_fluxes(albedo, ior, phase)
        # Ratios to diffusion hardly depend on depths and angles.
        depths = exact.depths[:, None]
        own, across = _by_diffusion(albedo, self._conductance, depths, exact.cosines)
        self._ratios = exact.own / own, exact.across / across
        own, across = _by_diffusion(albedo, self._conductance, depths, np.array([self._mean_cosine]))
        self._uniform_ratios = (exact.own @ exact.uniform) / own[:, 0], (exact.across @ exact.uniform) / across[:, 0]
        self._albedo = albedo

    @np.errstate(under="ignore")
    def events(self, samples: Integers, cosine: Array | float) -> tuple[Array, Array]:
        """Fluence (k,) on the near side and on the far side for a unit of flux at samples (k,); 0 outside walls.

        Parameters
        ----------
        samples : (k,)
        cosine : (k,), or float
            Of light with the normal, inside; one for all: uniform light.
        """
        own, across = np.zeros((2, len(samples)))
        on = np.flatnonzero(self._walls.lit[samples])
        cosine = np.asarray(cosine) if np.ndim(cosine) == 0 else np.asarray(cosine)[on]
        depth = self._extinction * self._walls.thickness[samples[on]]
        found = _by_diffusion(self._albedo, self._conductance, depth, cosine)
        depths = self._table.depths
        at = np.interp(np.log(np.maximum(depth, depths[0])), np.log(depths), np.arange(len(depths)))
        if np.ndim(cosine) == 0:
            ratios = [np.interp(at, np.arange(len(depths)), ratio) for ratio in self._uniform_ratios]
        else:
            along = np.interp(cosine, self._table.cosines, np.arange(len(self._table.cosines)))
            ratios = [map_coordinates(ratio, np.stack([at, along]), order=1, mode="nearest") for ratio in self._ratios]
        own[on], across[on] = (ratio * flux / self._conductance for ratio, flux in zip(ratios, found, strict=True))
        return own, across


@np.errstate(under="ignore")
def _by_diffusion(albedo: float, conductance: float, depth: Array, cosine: Array) -> tuple[Array, Array]:
    """Fractions of light at cosines that leave slabs of optical depths on the same side and on the other one.

    With u(z) = cosh(k z) + c sinh(k z) / (D k), which satisfies the condition at a surface, a source at the depth z
    below one of two surfaces makes there the fluence u(T - z) / (D u'(T) + c u(T)). All is times exp(-k T).
    """
    d = float(diffusion_coefficient(1.0 - albedo, albedo))
    k, c = float(np.sqrt((1.0 - albedo) / d)), conductance / d
    scale = optics.transmittance(k * depth)
    even, rise = 0.5 * (1.0 + scale * scale), depth * optics.mean_transmittance(2.0 * k * depth)
    u, slope = even + c * rise, k * k * rise + c * even
    rate = 1.0 / np.maximum(cosine, np.finfo(np.float32).eps)
    rate = np.where(np.abs(rate - k) < _ALIKE * rate, rate * (1.0 + _ALIKE), rate)
    passed = optics.transmittance(rate * depth)
    factor = albedo * c * rate / ((rate - k) * (rate + k) * (slope + c * u))
    own = rate * (even - scale * passed) - k * k * rise + c * (scale * passed - even + rate * rise)
    other = scale * (rate + c) - passed * (rate * u + slope)
    return factor * own, factor * other
