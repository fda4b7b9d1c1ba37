"""Diffusion in a body: fluence in its cells and at its surface, from the light that enters and that it emits.

-div(D grad phi) + sigma_a phi = q in the body, for each channel, and -D dphi/dn = c phi at its surface, by finite
volumes on cut cells (Johansen & Colella 1998). Between the surface and the depth at which the fluence is read below
each sample, about a cell, the equation is solved exactly in one dimension: cells may be much larger than a mean free
path.

References
----------
Stam 1995, "Multiple scattering as a diffusion process"; Haber et al. 2005, "Embedded boundary method for shape
optimization"; Haskell et al. 1994 for the condition at the surface; Grosjean 1956 for D.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from translucent.arrays import Array
from translucent.diffusion.cells import CellSystem
from translucent.diffusion.densities import Densities, even_densities
from translucent.diffusion.grid import BodyGrid, box_points, other_plane_points
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import (
    DiffuseInterface,
    diffuse_interface,
    diffusion_coefficient,
    half_space_reflectance,
)
from translucent.media.medium import Medium

#: First events above the depth at which the fluence is read, and below it, for each sample.
EVENTS, DEEP_EVENTS = 4, 2

#: Share of the light below which no first events are looked for.
_NOTHING = 1e-3

#: Largest number of times that light of the body falls on the body again, and the change at which it is enough.
MOST_BOUNCES, ENOUGH = 24, 1e-3

#: Largest share of the light that may come back to the surface: of what would, a hundred times as much is to come.
MOST_SHARE = 0.99

#: Least share of a cell's volume that absorbs.
_LEAST_ABSORBING = 0.02

#: Over 1 / STRAIGHT reduced mean free paths light that leaves has been turned little by little, and not straight back.
STRAIGHT = 1.0

#: Reduced albedo below which what half-spaces give back is in proportion to it.
_LEAST_ALBEDO = 1e-6


@dataclass(frozen=True)
class SurfaceLight:
    """Light at the samples of a body's surface.

    Attributes
    ----------
    fluence : (s, 3) float64
        Of light that has been scattered, below the surface.
    entering : (s, 3) float64
        Flux that enters, that of the body itself included.
    inside : (cells, 3) float64
        Fluence in the cells.
    steps : int
        Iterations that the solver took, in all.
    """

    fluence: Array
    entering: Array
    inside: Array
    steps: int


@dataclass(frozen=True, eq=False)
class _Layer:
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


class BodySystem:
    """The linear systems of a body with a medium, ready for any light; each solution starts from the last one.

    Parameters
    ----------
    grid : BodyGrid
    medium : Medium
        In channels in which it does not scatter nothing is found.
    roughness : float
        Of its surface.
    dense : Densities, optional
        Of the body; default: `even_densities`.
    """

    @np.errstate(under="ignore")
    def __init__(self, grid: BodyGrid, medium: Medium, roughness: float, dense: Densities | None = None) -> None:
        self._emitted = 4.0 * np.pi * np.asarray(medium.emission)
        reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
        ways = _first_ways(grid, medium.ior)
        dense = dense or even_densities(grid)
        deep = _DeepWays(dense, ways, dense.lengths(ways))
        self._channels = {
            channel: _Channel(
                grid, medium.ior, roughness, float(absorption), float(scattering), deep, medium.anisotropy
            )
            for channel, (absorption, scattering) in enumerate(zip(np.asarray(medium.absorption), reduced, strict=True))
            if scattering > 0.0
        }

    @np.errstate(under="ignore")
    def solved(self, entering: Array, from_itself: sparse.csr_array, inside: Array) -> SurfaceLight:
        """Light at the body's surface.

        Parameters
        ----------
        entering : (s, 3)
            Flux that enters at the samples from outside, in W/m^2.
        from_itself : (s, s) csr_array
            Flux that enters for the flux that leaves each sample.
        inside : (cells, 3)
            Power of lights inside each cell, in W.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        fluence, flux, cells = np.zeros_like(entering), entering.copy(), np.zeros_like(inside)
        steps = 0
        for channel, system in self._channels.items():
            emission = float(self._emitted[channel])
            found = system.solved(entering[:, channel], from_itself, inside[:, channel], emission)
            fluence[:, channel], flux[:, channel], cells[:, channel], taken = found
            steps += taken
        return SurfaceLight(fluence, flux, cells, steps)


@dataclass(frozen=True, eq=False)
class _DeepWays:
    """Ways (s, 3) of light below the samples of a body, and metres on them for integrals of its density (s,)."""

    dense: Densities
    directions: Array
    length: Callable[[Array], Array]


class _Channel:
    """The linear system of one channel."""

    def __init__(
        self,
        grid: BodyGrid,
        ior: float,
        roughness: float,
        absorption: float,
        scattering: float,
        deep: _DeepWays,
        anisotropy: float = 0.0,
    ) -> None:
        self._grid, interface = grid, diffuse_interface(ior, roughness)
        self._exit_share = interface.exit_share
        self._mirrored = (1.0 - diffuse_interface(ior).entering) / interface.entering
        extinction = absorption + scattering
        self._albedo = scattering / extinction
        d = float(diffusion_coefficient(absorption, scattering))
        self._read, depth = grid.below[0], deep.dense.depth
        layer = _Layer(depth, float(np.sqrt(absorption / d)), interface.conductance / d)
        self._relative = 1.0 / layer.u(depth)
        self._attenuated = optics.transmittance(layer.attenuation * depth) * self._relative
        # What of the entering light the exact half-space gives back less than diffusion would.
        # In thin bodies light that is not turned back leaves on the far side. 4 V / S is the mean chord (Cauchy).
        chord = 4.0 * float(deep.dense.cells @ grid.volumes) / (grid.area * len(depth))
        self._straight = _straight_back(self._albedo, ior, anisotropy) * float(optics.opacity(extinction * chord))
        self._excess = _half_space_excess(self._albedo, ior) / diffuse_interface(ior).conductance
        self._sources(layer, interface, extinction, deep, d)
        # Of light that is emitted everywhere: what the layers send to the surface, and what they and the rest send to
        # the cells, by the solution phi_0 u + (1 - cosh(k z)) q / sigma_a in the layer.
        self._glow_near = layer.bend() / d * self._relative
        below = grid.area * (layer.rise(depth) + layer.condition * layer.bend()) * self._relative
        self._glow_cells = deep.dense.cells * grid.cores + self._read.T @ below
        lost = grid.area * d * layer.slope() * self._relative
        absorbing = np.maximum(grid.volumes - grid.layers, _LEAST_ABSORBING * grid.volumes)
        absorbed = absorption * deep.dense.cells * absorbing
        self._cells = CellSystem(grid, deep.dense.diffusion_coefficients(d), absorbed, lost)

    def _sources(
        self, layer: _Layer, interface: DiffuseInterface, extinction: float, ways: _DeepWays, d: float
    ) -> None:
        """First events: their power in each cell, and the fluence that they make at the surface, for a unit of flux."""
        grid, count = self._grid, len(self._grid.points)
        # Shares of the light that is scattered above the depth of reading, and below it.
        slant = layer.depth / interface.mean_cosine
        below, above = optics.transmittance(extinction * slant), optics.opacity(extinction * slant)
        self._near, into_cells = np.zeros(count), np.zeros(count)
        for quantile in (np.arange(EVENTS) + 0.5) / EVENTS:
            depth = -np.log1p(-quantile * above) * interface.mean_cosine / extinction
            turned = self._turned(extinction / interface.mean_cosine * depth)
            share = self._albedo / EVENTS * above * self._relative * turned
            into_cells += share * layer.u(depth)
            self._near += share * layer.rise(layer.depth - depth) / d
        deep = sparse.csr_array((count, grid.count))
        # Interpolation by chance: each place stands for the cell around it.
        spread = grid.cells.step * (box_points(count) - 0.5)
        for quantile in _tails(count) if below.max() > _NOTHING else ():
            length = slant - np.log1p(-quantile) / extinction
            path = ways.length(length)
            # Where the path has left the body nothing is scattered; near its end, as much as is inside of the cell.
            cell, inside = grid.cell_at(grid.points + path[:, None] * ways.directions + spread)
            share = self._albedo / DEEP_EVENTS * below * inside * self._turned(extinction * length)
            deep = deep + sparse.csr_array((share, (np.arange(count), cell)), deep.shape)
        sources = deep + sparse.diags_array(into_cells) @ self._read
        self._into_cells = sparse.csr_array((grid.area * sources).T)

    def _turned(self, path: Array) -> Array:
        """Share of the first events after an optical path from the surface that count as if they were isotropic."""
        return np.asarray(1.0 - self._straight * optics.transmittance(STRAIGHT * path))

    def solved(
        self, entering: Array, from_itself: sparse.csr_array, power: Array, emission: float
    ) -> tuple[Array, Array, Array, int]:
        """Fluence and flux at the samples, fluence in the cells, and steps.

        Light of the body falls on it again until little changes.
        """
        flux, steps = entering, 0
        before = np.zeros_like(entering)
        inside = self._albedo * (power + emission * self._glow_cells)
        glow = self._albedo * emission * self._glow_near
        for _ in range(MOST_BOUNCES):
            cells, taken = self._cells.solved(self._into_cells @ flux + inside)
            steps += taken
            surface = (self._read @ cells) * self._attenuated + (self._near - self._excess) * flux + glow
            fluence = np.maximum(surface, 0.0)
            # What the surface mirrors goes on as if it was diffuse.
            leaving = self._exit_share * fluence + self._mirrored * flux
            change = entering + from_itself @ leaving - flux
            # Of what changed the last time this share comes back now. In a hollow it is nearly all, and always the same
            # share: so much is still to come.
            share = float(change @ before) / max(float(before @ before), np.finfo(np.float64).tiny)
            share = min(max(share, 0.0), MOST_SHARE)
            flux = np.maximum(flux + change / (1.0 - share), 0.0)
            if np.abs(change).max(initial=0.0) <= ENOUGH * (1.0 - share) * np.abs(flux).max(initial=0.0):
                break
            before = change if share == 0.0 else np.zeros_like(entering)
        return fluence, flux, np.maximum(cells, 0.0), steps


def _tails(samples: int) -> Array:
    """(DEEP_EVENTS, samples): quantiles of the paths below the depth of reading, other ones for each sample."""
    shift = (0.5 + 0.6180339887498949 * np.arange(samples)) % 1.0
    return np.asarray((np.arange(DEEP_EVENTS)[:, None] + shift) / DEEP_EVENTS)


def _first_ways(grid: BodyGrid, ior: float) -> Array:
    """(s, 3): a direction inside for each sample, as uniform light from outside has them."""
    # Not the numbers by which the samples lie on large triangles: there, light would come from one side alone.
    first, second = other_plane_points(len(grid.points)).T
    cosine = optics.refracted_cosine(np.sqrt(first), ior)
    normal = grid.face_normals
    aside = np.where(np.abs(normal[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(normal, aside)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(normal, across)
    angle, level = 2.0 * np.pi * second, np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    sideways = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * along
    return np.asarray(level[:, None] * sideways - cosine[:, None] * normal)


def _half_space_excess(albedo: float, ior: float) -> float:
    """Share of the light entering a half-space that diffusion gives back beyond the exact one."""
    return float(_diffused_share(albedo, ior) - half_space_reflectance(round(albedo, 6), ior))


def _diffused_share(albedo: float, ior: float, dimmed: float = 0.0) -> float:
    """Share of the light entering a half-space that diffusion gives back.

    `dimmed`: of first events after an optical path t from the surface those count that exp(-dimmed t) leaves.
    """
    interface = diffuse_interface(ior)
    d, c = float(diffusion_coefficient(1.0 - albedo, albedo)), interface.conductance
    attenuation = float(np.sqrt((1.0 - albedo) / d))
    return albedo * c / ((d * attenuation + c) * (1.0 + attenuation * interface.mean_cosine + dimmed))


def _straight_back(albedo: float, ior: float, anisotropy: float) -> float:
    """Share of the first events at the surface that do not count, as media that scatter ahead turn less light back.

    After an optical path t it is exp(-STRAIGHT t) times as much: so much in all that a half-space gives back what the
    exact one does.

    Parameters
    ----------
    albedo : float
        The reduced one, which both have.
    ior, anisotropy : float
    """
    if anisotropy == 0.0:
        return 0.0
    reduced = max(round(albedo, 6), _LEAST_ALBEDO)
    own = reduced / (reduced + (1.0 - reduced) * (1.0 - anisotropy))
    less = half_space_reflectance(reduced, ior) - half_space_reflectance(own, ior, anisotropy)
    return less / _diffused_share(reduced, ior, STRAIGHT)
