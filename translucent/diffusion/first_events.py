"""First scattering events of light that enters a body, and their source terms for diffusion.

Light that comes alike from all sides, and light of the body itself, goes on below the surface as uniform light from
outside does. Light of the lights of a scene goes in one direction below each sample, and what else an environment has
in a few: refracted, so that it is scattered deeper where it enters straight, and farther along the surface where it
enters at a slant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy import sparse

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.densities import Densities
from translucent.diffusion.entering_rays import MOST_SHIFTED, EnteringRays, LateralShift, moved_along, shifted_fractions
from translucent.diffusion.grid import BodyGrid, box_points
from translucent.diffusion.walls import SlabSolution
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import (
    diffuse_interface,
    diffusion_coefficient,
    half_space_reflectance,
    half_space_reflectances,
)
from translucent.formulas.diffusion import LEAST_COSINE
from translucent.formulas.phase import ISOTROPIC, PhaseFunction

#: First events below the depth at which the fluence is read, for each sample.
DEEP_EVENTS = 2

#: Relative distance of two rates of decay that are equal, up to which one is moved: their difference divides.
_ALIKE = 1e-6

#: Difference of two distances to the same place, at most, in cells: rays start a little apart, in single precision.
_SAME = 0.01

#: Fraction of the light below which no first events are looked for.
_NOTHING = 1e-3

#: Over 1 / STRAIGHT reduced mean free paths light that leaves has been turned little by little, and not straight back.
STRAIGHT = 1.0

#: Reduced mean free paths: where the mean chord is as long, 1 - 1 / e of the half-space's excess is taken away. Against
#: photons in balls of albedos 0.3 to 0.95, of indices 1.3 and 1.6, hardly any is too much at 2.7, and most of it at 5.
FLAT = 4.0

#: Reduced albedo below which the reflectance of half-spaces is in proportion to it.
_LEAST_ALBEDO = 1e-6

#: Number of path lengths for the first events of a ray that are shifted along the surface.
SHIFTED_PARTS = 4

#: Rays whose shifts are found at a time.
_TOGETHER = 1 << 13

#: Cosines of light inside with the normal between which what half-spaces reflect of it is interpolated.
_COSINES = np.linspace(0.0, 1.0, 513)


#: Fraction of the fluence below a surface that the spread of what is read leaves at least.
LEAST_LEFT = 0.5


@dataclass(frozen=True, eq=False)
class LayerSolution:
    """One-dimensional solutions between the surface (depth 0) and the depth at which the fluence is read, per sample.

    u is 1 at the surface, where it satisfies the condition; the fluence below is that at the depth over u there, and
    the flux to the surface D u' / u times it. All are given times exp(-k d), d the depth of reading, so that nothing
    overflows however dense the medium. Depths are integrals of the density.

    Attributes
    ----------
    depth : (s,) float64
        Of reading.
    attenuation : float
        k in 1/m.
    condition : float, or (s,) float64
        Of the surface: u' / u there.
    curvature : float, or (s,) float64
        Mean curvature H of the surface in 1/m. Below a rounded surface there is less and less area, exp(-2 H z) at a
        depth z: with u = exp(H z) v the equation is v'' = (k^2 + H^2) v, and v' / v is less by H at the surface.
    spread : (s,) float64
        Integral of the density over the distance of `BodyGrid.spread`: what is read is the fluence at the depth of
        reading, and so much times its derivative.
    scale, even, rise, slope, u : (s,) float64
        At the depth of reading: exp(-k d), and times it cosh(k d), sinh(k d) / k, v' and what is read of v.
    over : (s,) float64
        Logarithm of what is read of u over that of v.
    """

    depth: Array
    attenuation: Array | float
    condition: Array | float
    curvature: Array | float
    spread: Array
    scale: Array
    even: Array
    rise: Array
    u: Array
    slope: Array
    over: Array

    @classmethod
    def of(
        cls,
        depth: Array,
        attenuation: float,
        condition: Array | float,
        spread: Array,
        curvature: Array | float = 0.0,
    ) -> LayerSolution:
        """Solutions down to depths (s,)."""
        condition, k = condition - curvature, np.hypot(attenuation, curvature)
        scale = optics.transmittance(k * depth)
        even, rise = 0.5 * (1.0 + scale * scale), depth * optics.mean_transmittance(2.0 * k * depth)
        slope = k**2 * rise + condition * even
        # u + spread u' is so much times exp(H d) (v + spread v').
        further = np.maximum(1.0 + curvature * spread, LEAST_LEFT)
        spread, over = spread / further, depth * curvature + np.log(further)
        # The spread is a correction of first order: it takes no more of u away than half.
        u = even + condition * rise
        too_far = spread * slope < -(1.0 - LEAST_LEFT) * u
        spread = np.where(too_far, -(1.0 - LEAST_LEFT) * u / np.where(too_far, slope, 1.0), spread)
        return cls(depth, k, condition, curvature, spread, scale, even, rise, u + spread * slope, slope, over)

    @property
    def at_surface(self) -> Array:
        """(s,): fluence at the surface over that at the depth of reading."""
        return np.asarray(self.scale / self.u * np.exp(-self.over))

    @property
    def conductance(self) -> Array:
        """(s,): flux through the depth of reading, for each area of the surface, over D times the fluence there."""
        slope = self.slope + self.curvature * (self.even + self.condition * self.rise)
        return np.asarray(slope / self.u * np.exp(-self.curvature * self.depth - self.over))

    @property
    def lateral_variance(self) -> Array:
        """(s,): variance along one axis of the surface of where light of events right below it leaves.

        On a plane a source that varies along the surface with a wave number q has k^2 + q^2 in place of k^2. So the
        variance is -2 d log(phi) / dk^2, and phi = T / (1 + c T) with T = tanh(k d) / k.
        """
        depth = np.maximum(self.depth, np.finfo(np.float32).tiny)
        k = np.maximum(self.attenuation, 1e-3 / depth)
        t = np.tanh(k * depth) / k
        change = (t - depth / np.cosh(np.minimum(k * depth, 300.0)) ** 2) / (k * k)
        return np.asarray(np.maximum(change / (t * (1.0 + self.condition * t)), 0.0))

    def events(self, samples: Integers, rate: Array) -> tuple[Array, Array]:
        """Effects of first events above the depth of reading, where light decays with the depth at a rate (k,) in 1/m.

        Integrals over the depth z of rate exp(-rate z) times exp(H z) sinh(k (d - z)) / k: fluence at the surface times
        D; and times u(z): power for the cells. The first is over v at the depth of reading, the second over u there.
        """
        whole, scale, u, even = rate, self.scale[samples], self.u[samples], self.even[samples]
        k, condition, curvature = (
            np.broadcast_to(values, self.depth.shape)[samples]
            for values in (self.attenuation, self.condition, self.curvature)
        )
        rate = rate - curvature
        rate = np.where(np.abs(rate - k) < _ALIKE * rate, rate * (1.0 + _ALIKE), rate)
        passed = optics.transmittance(rate * self.depth[samples])
        factor = whole / ((rate - k) * (rate + k) * u)
        rise = self.rise[samples]
        at_surface = scale * passed - even + rate * rise
        at_surface += self.spread[samples] * (rate * (even - scale * passed) - k * k * rise)
        u_below = even + condition * rise
        for_cells = scale * (rate + condition) - passed * (rate * u_below + self.slope[samples])
        return factor * at_surface, factor * for_cells * np.exp(-self.over[samples])


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
    limit : (k,) float64
        Metres to an opaque inclusion; inf where none is on the path.
    inclusion : (k,) int64
        Sample of the inclusions there.
    start, per_metre : (3, k) float32
        Where the events of each are counted from, and way along it, in cells: each counts in the cell where it is, and
        starts that differ by up to a cell interpolate by chance.
    """

    samples: Integers
    directions: Array
    cosine: Array | float
    diffuse: bool
    length: Callable[[Array], Array]
    limit: Array
    inclusion: Integers
    start: Floats
    per_metre: Floats

    @cached_property
    def _between(self) -> tuple[Integers, Array]:
        """Number of the last of `_COSINES` below that of each path, and how far it is from there to the next one."""
        place = np.asarray(self.cosine) * (len(_COSINES) - 1)
        number = np.minimum(place.astype(np.int64), len(_COSINES) - 2)
        return number, place - number

    def at_cosine(self, values: Array | float) -> Array | float:
        """(k,): values tabulated at `_COSINES`, interpolated; a constant stays as it is."""
        if np.ndim(values) == 0:
            return values
        (number, fraction), table = self._between, np.asarray(values)
        return np.asarray(table[number] + fraction * np.diff(table)[number])

    @classmethod
    def of(
        cls,
        grid: BodyGrid,
        dense: Densities,
        samples: Integers,
        directions: Array,
        cosine: Array | float,
        *,
        diffuse: bool,
    ) -> EntryPaths:
        """Paths in a grid."""
        lengths, cells = dense.lengths(samples, directions), grid.cells
        limit, inclusion = np.full(len(samples), np.inf), np.zeros(len(samples), np.int64)
        if grid.inclusions is not None:
            limit, inclusion = grid.inclusions.met(grid.points[samples], directions)
        start = ((grid.points - cells.low) / cells.step + _places(len(grid.points))[0])[samples]
        single = (np.ascontiguousarray(part.T, np.float32) for part in (start, directions / cells.step))
        return cls(samples, directions, cosine, diffuse, lengths, limit, inclusion, *single)


def diffuse_paths(grid: BodyGrid, dense: Densities, ior: float) -> EntryPaths:
    """One path below each sample, with directions distributed as those of uniform light from outside."""
    directions, samples = grid.inward_directions(ior), np.arange(len(grid.points))
    return EntryPaths.of(grid, dense, samples, directions, diffuse_interface(ior).mean_cosine, diffuse=True)


def entry_paths(ray: EnteringRays, grid: BodyGrid, dense: Densities) -> EntryPaths:
    """Paths of entering rays below the surface."""
    cosine = np.clip(-(ray.directions * grid.face_normals[ray.samples]).sum(axis=1), LEAST_COSINE, 1.0)
    return EntryPaths.of(grid, dense, ray.samples, ray.directions, cosine, diffuse=False)


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
    reached : (k,) float64
        Fraction that comes to an opaque inclusion, unscattered.
    counted : (k,) float64
        Fraction that is scattered or absorbed in all, as cells count it.
    slab : tuple of two (k,) float64
        Fluence at the surface and across, in walls, see `SlabSolution`.
    """

    near: Array
    above: Array
    below: list[tuple[Integers, Array]]
    reached: Array
    counted: Array
    slab: tuple[Array, Array]

    def scaled(self, factor: Array) -> Events:
        """More events, or fewer, by factors (k,)."""
        below = [(cell, factor * weight) for cell, weight in self.below]
        return replace(self, near=factor * self.near, above=factor * self.above, below=below)

    def power(self, grid: BodyGrid, samples: Integers | slice, flux: Array, above: Array | None = None) -> Array:
        """(cells,): scattered power in each cell for a flux (k,) that enters at samples (k,), in W.

        `above` (s,) is what the cells receive from above the depth of reading; default: of light at all samples, where
        it enters.
        """
        flux = grid.areas[samples] * flux
        total = np.asarray(grid.spreading @ (self.above * flux if above is None else above))
        for cell, weight in self.below:
            total += np.bincount(cell, weight * flux, grid.count)
        return total


@dataclass(frozen=True, eq=False)
class ShiftedEvents:
    """First events of entering rays at the samples of a surface, where they are scattered.

    Attributes
    ----------
    flux : (s,) float64
        Flux that enters.
    near : (s,) float64
        Fluence at the surface; see `Events`.
    above : (s,) float64
        Scattered power for the cells.
    """

    flux: Array
    near: Array
    above: Array

    def plus(self, more: ShiftedEvents) -> ShiftedEvents:
        """Events of the rays of both."""
        return ShiftedEvents(self.flux + more.flux, self.near + more.near, self.above + more.above)


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
    slab : SlabSolution, optional
        Of walls, if there are any.
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
        slab: SlabSolution | None = None,
    ) -> None:
        self._grid, self._layer, self._ior, self._phase = grid, layer, ior, phase
        self._slab = slab
        self._extinction = absorption + scattering
        self._albedo = scattering / self._extinction
        self._d = float(diffusion_coefficient(absorption, scattering))
        # In thin bodies light that is not turned back leaves on the far side.
        self._thick = float(optics.opacity(self._extinction * chord))
        # Small bodies are curved, and reflect more than half-spaces.
        self._flat = float(optics.opacity((self._extinction * chord / FLAT) ** 3))

    def _reflectances(self, cosines: Array | None) -> tuple[Array | float, Array | float]:
        """Fraction of events that are `straight_back`, and the excess of diffusion over the exact half-space."""
        straight = straight_back(self._albedo, self._ior, self._phase, cosines) * self._thick
        excess = self._flat * half_space_excess(self._albedo, self._ior, cosines)
        return straight, excess / diffuse_interface(self._ior).conductance

    @cached_property
    def _at_cosines(self) -> tuple[Array | float, Array | float]:
        return self._reflectances(_COSINES)

    def of(self, paths: EntryPaths) -> Events:
        """First events of light along these paths."""
        grid, layer, extinction, cosine = self._grid, self._layer, self._extinction, paths.cosine
        straight, excess = map(paths.at_cosine, self._reflectances(None) if paths.diffuse else self._at_cosines)
        rate = np.broadcast_to(extinction / np.asarray(cosine), paths.samples.shape)
        near, above = layer.events(paths.samples, rate)
        if np.any(straight):
            # After an optical path t those count that are not turned straight back, 1 - straight exp(-STRAIGHT t).
            fewer = straight / (1.0 + STRAIGHT)
            less_near, less_above = layer.events(paths.samples, (1.0 + STRAIGHT) * rate)
            near, above = near - fewer * less_near, above - fewer * less_above
        slab = (near, near) if self._slab is None else self._slab.events(paths.samples, cosine)
        slant = layer.depth[paths.samples] / cosine
        below, deep = optics.transmittance(extinction * slant), []
        counted = 1.0 - below
        farthest = grid.cells.step * sum(grid.number.shape)
        quantiles = _places(len(grid.points))[1][:, paths.samples] if below.max(initial=0.0) > _NOTHING else ()
        for quantile in quantiles:
            length = slant - quantile / extinction
            metres = np.minimum(paths.length(length), farthest)
            # Where the path has left the body nothing is scattered; near its end, as much as is inside of the cell.
            cell, weight = grid.cell_at(paths.start + metres.astype(np.float32) * paths.per_metre)
            weight = np.where(metres < paths.limit, weight, 0.0)
            weight = below * weight / DEEP_EVENTS
            counted += weight
            weight *= self._albedo
            if np.any(straight):
                weight *= 1.0 - straight * optics.transmittance(STRAIGHT * extinction * length)
            deep.append((cell, weight))
        # As if the density was even up to there.
        reached = optics.transmittance(np.where(np.isfinite(paths.limit), extinction * paths.limit, np.inf))
        return Events(self._albedo * near / self._d - excess, self._albedo * above, deep, reached, counted, slab)

    def shifted(
        self, paths: EntryPaths, events: Events, entering: Array, shift: LateralShift | None
    ) -> tuple[ShiftedEvents, Array]:
        """First events of rays that enter with a flux (k,), shifted along the surface if they come from one light.

        Also returns the flux as `moved_along` takes it.
        """
        grid, layer, samples = self._grid, self._layer, paths.samples
        # Where the medium is denser events are nearer.
        metres = np.where(layer.depth > 0.0, grid.below[1] / np.where(layer.depth > 0.0, layer.depth, 1.0), 0.0)
        values = [entering, entering * events.near, entering * events.above]
        if shift is not None:
            cosine = np.broadcast_to(np.asarray(paths.cosine), samples.shape)
            fractions = self._fractions(shift, samples, cosine, metres[samples])
            values = [part * value for part, value in zip(fractions, values, strict=True)]
        flux, near, above = moved_along(values, samples, len(grid.points), shift)
        smooth = grid.smoothed(near, float(np.mean(layer.lateral_variance * metres**2)))
        return ShiftedEvents(flux, smooth, grid.areas * above), values[0]

    def _fractions(
        self, shift: LateralShift, samples: Integers, cosine: Array, metres: Array
    ) -> tuple[Floats, Floats, Floats]:
        """`LateralShift.fractions` of all events, of their light at the surface, and of what cells receive.

        In single precision, and in parts that stay in the processor's cache: lights of some size have many rays.
        """
        found = np.empty((3, MOST_SHIFTED + 1, len(samples)), np.float32)
        k = np.broadcast_to(self._layer.attenuation, self._layer.depth.shape)
        for start in range(0, len(samples), _TOGETHER):
            of = slice(start, start + _TOGETHER)
            given = self._layer.depth[samples[of]], k[samples[of]], cosine[of], metres[of], shift.chord[of]
            found[..., of] = self._fractions_of(shift.level[of], *(part.astype(np.float32) for part in given))
        return found[0], found[1], found[2]

    def _fractions_of(
        self, level: Array, depth: Floats, k: Floats, cosine: Floats, metres: Floats, chord: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """`_fractions` of some rays (k,)."""
        tiny, extinction = np.finfo(np.float32).tiny, np.float32(self._extinction)
        parts = (np.arange(SHIFTED_PARTS, dtype=np.float32)[:, None] + np.float32(0.5)) / np.float32(SHIFTED_PARTS)
        slant = depth / cosine
        end = chord / np.where(metres > 0.0, metres, np.float32(1.0))
        every, layered = (-np.expm1(-extinction * np.minimum(end, limit)) for limit in (np.float32(np.inf), slant))
        inside = layered / np.maximum(-np.expm1(-extinction * slant), tiny)
        long, shallow = (-np.log1p(-parts * part) / extinction for part in (every, layered))
        # Near the depth of reading events say little of the fluence at the surface: as sinh(k rest) says.
        rest = np.maximum(depth - cosine * shallow, np.float32(1e-6) * depth)
        k = np.maximum(k, np.float32(1e-3) / (depth + tiny))
        near = np.exp(k * (rest - depth)) * -np.expm1(-np.float32(2.0) * k * rest)
        near /= np.maximum(near.sum(axis=0), tiny)
        steps = level.astype(np.float32) * metres
        (all_events,), layer = shifted_fractions(steps * long), shifted_fractions(steps * shallow, near)
        return every * all_events, inside * layer[1], inside * layer[0]


@lru_cache(maxsize=16)
def _places(samples: int) -> tuple[Array, Array]:
    """Shifts (samples, 3) in cells, and logarithms of the light that is left, of the events of each sample."""
    return box_points(samples) - 0.5, np.log1p(-tails(samples))


def tails(samples: int) -> Array:
    """(DEEP_EVENTS, samples): quantiles of the paths below the depth of reading, other ones for each sample."""
    shift = (0.5 + 0.6180339887498949 * np.arange(samples)) % 1.0
    return np.asarray((np.arange(DEEP_EVENTS)[:, None] + shift) / DEEP_EVENTS)


def scattered_fractions(grid: BodyGrid, dense: Densities, ior: float, extinction: float) -> Array:
    """(s,): fraction of uniform light entering near each sample of a body that is scattered before it leaves.

    The same fraction of what leaves there has been scattered: paths are the same in both directions.
    """
    directions, metres = grid.crossings(ior)
    passed = [
        optics.transmittance(extinction * dense.along(direction, to))
        for direction, to in zip(directions, metres, strict=True)
    ]
    return np.asarray((1.0 - np.mean(passed, axis=0))[grid.nearest].mean(axis=1))


def seen_inclusions(grid: BodyGrid, dense: Densities, ior: float, extinction: float) -> sparse.csr_array:
    """(s, i): fraction of uniform light entering near each sample that reaches samples of inclusions, unscattered.

    The same fraction of what leaves there comes from these samples, where they are as bright as all else.
    """
    samples, inner = len(grid.points), grid.inclusions
    if inner is None:
        return sparse.csr_array((samples, 0))
    directions, metres = grid.crossings(ior)
    found = sparse.csr_array((samples, len(inner.points)))
    for direction, to in zip(directions, metres, strict=True):
        limit, seen = inner.met(grid.points, direction)
        hit = np.flatnonzero(limit <= to + _SAME * grid.cells.step)
        passed = optics.transmittance(extinction * dense.along(direction, to))[hit] / len(directions)
        found = found + sparse.csr_array((passed, (hit, seen[hit])), found.shape)
    rows, count = np.repeat(np.arange(samples), grid.nearest.shape[1]), grid.nearest.shape[1]
    mean = sparse.csr_array((np.full(len(rows), 1.0 / count), (rows, grid.nearest.ravel())), (samples, samples))
    return sparse.csr_array(mean @ found)


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
