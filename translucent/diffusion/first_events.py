"""First scattering events of light that enters a body, and their source terms for diffusion.

Light of smooth environments, and of the body itself, goes on below the surface as uniform light from outside does.
Light of the lights of a scene goes in one direction below each sample, and light of the bright parts of an environment
in a few: refracted, so that it is scattered deeper where it enters straight, and farther along the surface where it
enters at a slant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import sparse

from translucent.arrays import Array, Integers
from translucent.diffusion.grid import BodyGrid, Densities, box_points
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import (
    diffuse_interface,
    diffusion_coefficient,
    half_space_reflectance,
    half_space_reflectances,
)
from translucent.formulas.phase import ISOTROPIC, PhaseFunction

#: First events above the depth at which the fluence is read, and below it, for each sample.
EVENTS, DEEP_EVENTS = 4, 2

#: Fraction of the light below which no first events are looked for.
_NOTHING = 1e-3

#: Over 1 / STRAIGHT reduced mean free paths light that leaves has been turned little by little, and not straight back.
STRAIGHT = 1.0

#: Reduced mean free paths: where the mean chord is as long, 1 - 1 / e of the half-space's excess is taken away. Against
#: photons in balls of albedos 0.3 to 0.95, of indices 1.3 and 1.6, hardly any is too much at 2.7, and most of it at 5.
FLAT = 4.0

#: Reduced albedo below which the reflectance of half-spaces is in proportion to it.
_LEAST_ALBEDO = 1e-6

#: Least cosine of an entering direction with the surface normal; smaller ones, by smooth normals, are raised to it.
_LEAST_COSINE = 0.05


@dataclass(frozen=True, eq=False)
class EnteringRays:
    """Rays of one light, or of a part of the environment, that enter a body: one at each sample that it reaches.

    Attributes
    ----------
    samples : (k,) int
        Numbers of the samples that it reaches.
    directions : (k, 3) float64
        Inside, unit vectors.
    entering, mirrored : (k, 3) float64
        Flux that enters, and flux that the surface reflects, in W/m^2.
    """

    samples: Integers
    directions: Array
    entering: Array
    mirrored: Array


@dataclass(frozen=True, eq=False)
class LayerSolution:
    """One-dimensional solutions between the surface (depth 0) and the depth at which the fluence is read, per sample.

    u is 1 at the surface, where it satisfies the condition; the fluence below is that at the depth over u there, and
    the flux to the surface D u' / u times it. All are given times exp(-k d), d the depth of reading, so that nothing
    overflows however dense the medium. Depths are integrals of the density.
    """

    depth: Array
    attenuation: float
    condition: float

    def u(self, depth: Array) -> Array:
        """Solution without a source: cosh(k z) + c / D sinh(k z) / k."""
        return np.asarray(self._cosh(depth) + self.condition * self.rise(depth))

    def slope(self) -> Array:
        """u' at the depth of reading."""
        return np.asarray(self.attenuation**2 * self.rise(self.depth) + self.condition * self._cosh(self.depth))

    def rise(self, depth: Array) -> Array:
        """sinh(k z) / k, z where nothing is absorbed."""
        both_ways = optics.mean_transmittance(2.0 * self.attenuation * depth)
        return np.asarray(self._from(depth) * depth * both_ways)

    def bend(self) -> Array:
        """(cosh(k d) - 1) / k^2 at the depth of reading, d^2 / 2 where nothing is absorbed."""
        return np.asarray(0.5 * (self.depth * optics.mean_transmittance(self.attenuation * self.depth)) ** 2)

    def _cosh(self, depth: Array) -> Array:
        return 0.5 * self._from(depth) * (1.0 + optics.transmittance(2.0 * self.attenuation * depth))

    def _from(self, depth: Array) -> Array:
        """exp(k (z - d))."""
        return np.asarray(optics.transmittance(self.attenuation * np.maximum(self.depth - depth, 0.0)))


@dataclass(frozen=True, eq=False)
class EntryPaths:
    """Straight paths of light from samples of a surface into the body.

    Attributes
    ----------
    samples : (k,) int
    directions : (k, 3) float64
        Inside.
    cosine : (k,) float64, or float
        With the normal, which says how deep an event is.
    diffuse : bool
        Whether the light is uniform outside; else each direction is the only one.
    length : callable
        From integrals of the density (k,), in m, along the paths, to metres (k,).
    """

    samples: Integers
    directions: Array
    cosine: Array | float
    diffuse: bool
    length: Callable[[Array], Array]


def diffuse_paths(grid: BodyGrid, dense: Densities, ior: float) -> EntryPaths:
    """One path below each sample, in directions that are distributed as those of uniform light from outside."""
    directions, samples = grid.inward_directions(ior), np.arange(len(grid.points))
    return EntryPaths(samples, directions, diffuse_interface(ior).mean_cosine, True, dense.lengths(samples, directions))


def entry_paths(ray: EnteringRays, grid: BodyGrid, dense: Densities) -> EntryPaths:
    """Paths of entering rays below the surface."""
    cosine = -(ray.directions * grid.face_normals[ray.samples]).sum(axis=1)
    lengths = dense.lengths(ray.samples, ray.directions)
    return EntryPaths(ray.samples, ray.directions, np.clip(cosine, _LEAST_COSINE, 1.0), False, lengths)


@dataclass(frozen=True, eq=False)
class Events:
    """Source terms by first scattering events, for a unit of flux that enters at each of some samples.

    Attributes
    ----------
    near : (k,) float64
        Fluence at the surface by events above the depth of reading, less the excess of diffusion over the exact
        solution.
    above : (k,) float64
        Fraction that is scattered above that depth, as the cells receive it.
    below : list of ((k,) int, (k,) float64)
        Cells in which light is scattered below that depth, and fractions.
    """

    near: Array
    above: Array
    below: list[tuple[Integers, Array]]

    def matrix(self, grid: BodyGrid, read: sparse.csr_array) -> sparse.csr_array:
        """(cells, s): scattered power in each cell for a unit of flux that enters at each sample."""
        count = len(self.near)
        deep = sparse.csr_array((count, grid.count))
        for cell, weight in self.below:
            deep = deep + sparse.csr_array((weight, (np.arange(count), cell)), deep.shape)
        return sparse.csr_array((grid.area * (deep + sparse.diags_array(self.above) @ read)).T)

    def power_below(self, flux: Array, cells: int) -> Array:
        """(cells,): power scattered in each cell below the depth of reading, for an entering flux (k,)."""
        total = np.zeros(cells)
        for cell, weight in self.below:
            total += np.bincount(cell, weight * flux, cells)
        return total


class FirstEvents:
    """First scattering events in one color channel of a body.

    Parameters
    ----------
    grid : BodyGrid
    layer : Layer
        Below each sample.
    ior : float
    absorption, scattering : float
        The reduced one, in 1/m.
    phase : PhaseFunction
    chord : float
        Mean chord of the body in m, weighted by the density.
    """

    def __init__(
        self,
        grid: BodyGrid,
        layer: LayerSolution,
        ior: float,
        absorption: float,
        scattering: float,
        phase: PhaseFunction,
        chord: float,
    ) -> None:
        self._grid, self._layer, self._ior, self._phase = grid, layer, ior, phase
        self._extinction = absorption + scattering
        self._albedo = scattering / self._extinction
        self._d = float(diffusion_coefficient(absorption, scattering))
        # In thin bodies light that is not turned back leaves on the far side.
        self._thick = float(optics.opacity(self._extinction * chord))
        # Small bodies are curved, and reflect more than half-spaces.
        self._flat = float(optics.opacity((self._extinction * chord / FLAT) ** 3))

    def of(self, paths: EntryPaths) -> Events:
        """First events of light along these paths."""
        grid, extinction, cosine = self._grid, self._extinction, paths.cosine
        layer = replace(self._layer, depth=self._layer.depth[paths.samples])
        relative = 1.0 / layer.u(layer.depth)
        # Excess of the reflectance by diffusion over that of the exact half-space.
        cosines = None if paths.diffuse else np.asarray(cosine)
        straight = straight_back(self._albedo, self._ior, self._phase, cosines) * self._thick
        excess = (
            self._flat * half_space_excess(self._albedo, self._ior, cosines) / diffuse_interface(self._ior).conductance
        )

        def counted(path: Array) -> Array:
            """Fraction of the first events after an optical path from the surface that count as isotropic."""
            return np.asarray(1.0 - straight * optics.transmittance(STRAIGHT * path))

        # Fractions of the light that is scattered above the depth of reading, and below it.
        slant = layer.depth / cosine
        below, above = optics.transmittance(extinction * slant), optics.opacity(extinction * slant)
        near, into_cells = np.zeros(len(slant)), np.zeros(len(slant))
        for quantile in (np.arange(EVENTS) + 0.5) / EVENTS:
            path = -np.log1p(-quantile * above)
            depth = path * cosine / extinction
            weight = self._albedo / EVENTS * above * relative * counted(path)
            into_cells += weight * layer.u(depth)
            near += weight * layer.rise(layer.depth - depth) / self._d
        deep = []
        # Interpolation by chance: each place counts in the cell around it.
        spread, quantiles = _places(len(grid.points))
        start = grid.points[paths.samples] + grid.cells.step * spread[paths.samples]
        for quantile in quantiles[:, paths.samples] if below.max(initial=0.0) > _NOTHING else ():
            length = slant - np.log1p(-quantile) / extinction
            # Where the path has left the body nothing is scattered; near its end, as much as is inside of the cell.
            at = start + paths.length(length)[:, None] * paths.directions
            cell, inside = grid.cell_at(at)
            deep.append((cell, self._albedo / DEEP_EVENTS * below * inside * counted(extinction * length)))
        return Events(near - excess, into_cells, deep)


@lru_cache(maxsize=16)
def _places(samples: int) -> tuple[Array, Array]:
    """Shifts (samples, 3) in cells, and quantiles, of the events of each sample."""
    return box_points(samples) - 0.5, tails(samples)


def tails(samples: int) -> Array:
    """(DEEP_EVENTS, samples): quantiles of the paths below the depth of reading, other ones for each sample."""
    shift = (0.5 + 0.6180339887498949 * np.arange(samples)) % 1.0
    return np.asarray((np.arange(DEEP_EVENTS)[:, None] + shift) / DEEP_EVENTS)


def scattered_fractions(grid: BodyGrid, dense: Densities, ior: float, extinction: float) -> Array:
    """(s,): fraction of uniform light entering at each sample of a body that is scattered before it leaves.

    The same fraction of what leaves there has been scattered: paths are the same in both directions.
    """
    directions, metres = grid.crossings(ior)
    fractions = [
        optics.opacity(extinction * dense.along(direction, to))
        for direction, to in zip(directions, metres, strict=True)
    ]
    return np.asarray(np.mean(fractions, axis=0))


def half_space_excess(albedo: float, ior: float, cosine: Array | None = None) -> Array | float:
    """Reflectance of a half-space by diffusion minus the exact one.

    For light that is uniform outside, or that travels inside at cosines (k,) with the normal.
    """
    return diffused_reflectance(albedo, ior, cosine) - _exact(round(albedo, 6), ior, ISOTROPIC, cosine)


def straight_back(albedo: float, ior: float, phase: PhaseFunction, cosine: Array | None = None) -> Array | float:
    """Fraction of first events at the surface that do not count, as forward-scattering media turn less light back.

    After an optical path t it is exp(-STRAIGHT t) times as much: so much in all that a half-space has the exact
    reflectance.

    Parameters
    ----------
    albedo : float
        The reduced one, which both have.
    ior : float
    phase : PhaseFunction
    cosine : (k,), optional
        Of the direction of the light inside, with the normal; default: light that is uniform outside.
    """
    if phase == ISOTROPIC:
        return 0.0
    reduced = max(round(albedo, 6), _LEAST_ALBEDO)
    own = reduced / (reduced + (1.0 - reduced) * (1.0 - phase.mean_cosine))
    less = _exact(reduced, ior, ISOTROPIC, cosine) - _exact(own, ior, phase, cosine)
    return less / diffused_reflectance(reduced, ior, cosine, STRAIGHT)


def _exact(albedo: float, ior: float, phase: PhaseFunction, cosine: Array | None) -> Array | float:
    if cosine is None:
        return half_space_reflectance(albedo, ior, phase)
    return half_space_reflectances(cosine, albedo, ior, phase)


def diffused_reflectance(albedo: float, ior: float, cosine: Array | None = None, dimmed: float = 0.0) -> Array | float:
    """Reflectance of a half-space by diffusion, for the light that enters.

    `dimmed`: first events after an optical path t from the surface count by exp(-dimmed t).
    """
    interface = diffuse_interface(ior)
    d, c = float(diffusion_coefficient(1.0 - albedo, albedo)), interface.conductance
    attenuation = float(np.sqrt((1.0 - albedo) / d))
    depth = interface.mean_cosine if cosine is None else cosine
    return albedo * c / ((d * attenuation + c) * (1.0 + attenuation * depth + dimmed))
