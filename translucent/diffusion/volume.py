"""Light that is scattered many times in media without an interface, as rays find it at each point inside.

Discrete ordinates on a grid of cells, from a start by diffusion, which also finds what each round leaves over: a few
rounds are enough however often light is scattered (diffusion synthetic acceleration, Alcouffe 1977; Adams & Larsen
2002). A fraction of the scattered light counts as unscattered, so that the moments of orders 0 to 2 of the rest are
enough (delta-M). What the peak of a phase function does to light of lights, rays find by themselves: see
``shaders/volume/scattered_light.glsl``.

References
----------
Wiscombe 1977, "The delta-M method: rapid yet accurate radiative flux calculations for strongly asymmetric phase
functions"; Nakajima & Tanaka 1988, "Algorithms for radiative intensity calculations in moderately thick atmospheres
using a truncation approximation"; Iwabuchi & Suzuki 2009, "Fast and accurate radiance calculations using truncation
approximation for anisotropic scattering phase functions"; Kunasz & Auer 1988,
"Short characteristic integration of radiative transfer problems"; Chandrasekhar 1950 for discrete ordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt, map_coordinates

from translucent.arrays import Array, Integers
from translucent.diffusion.cell_system import CellSystem
from translucent.diffusion.densities import cell_means
from translucent.diffusion.entering import DIRECTIONS, environment_parts, even_directions, nearest_parts, path_inside
from translucent.diffusion.environment_ahead import EnvironmentAhead, environment_ahead
from translucent.diffusion.grid import BodyGrid, body_grid
from translucent.diffusion.photons import FineCells
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffusion_coefficient
from translucent.formulas.light import cone_attenuation
from translucent.formulas.phase import PhaseFunction
from translucent.geometry.ray_caster import RayCaster
from translucent.media.medium import Medium
from translucent.scene.lights import PositionalLight, SpotLight
from translucent.scene.scene import Object, Scene

_Index = tuple[slice, slice]
Floats = npt.NDArray[np.float32]

#: Optical depth below which two terms of a series are enough for float32.
_SERIES = np.float32(1e-2)


def swept(
    extinction: Array, emission: Array, arriving: Array, directions: Array, solid_angles: Array, step: float
) -> Array:
    """Mean fluence in cells, of light from the boundary of a grid and from its cells, attenuated on its path.

    Along each direction slice after slice: what leaves a cell is shared out to the cells of the next slice that it gets
    to. So each cell takes away as much as is missing behind it, and no power is lost or won.

    Parameters
    ----------
    extinction, emission : (x, y, z, 3) float64
        Of each cell, 1/m, and radiance for each metre that it sends in all directions.
    arriving : (k, 3) float64
        Radiance at the boundary, from each direction.
    directions : (k, 3) float64
        Unit vectors towards where light comes from.
    solid_angles : (k,) float64
        Of the directions nearest to each.
    step : float
        Side of a cell in metres.

    Returns
    -------
    fluence : (x, y, z, 3) float64
    """
    moments = swept_moments(extinction, emission[None], arriving, directions, solid_angles, step)
    return np.asarray(moments[0])


def swept_moments(
    extinction: Array, emission: Array, arriving: Array, directions: Array, solid_angles: Array, step: float
) -> Array:
    """Fluence and vector flux in cells, like `swept`, for cells with directional emission.

    Parameters
    ----------
    emission : (m, x, y, z, 3) float64
        Radiance for each metre that cells send in all directions; and with m = 9 what each of the `moment_functions` of
        the direction of travel adds to it.

    Returns
    -------
    moments : (m, x, y, z, 3) float64
        Fluence; and with m = 9 the vector flux, and the moments of order 2, see `moment_functions`.
    """
    weights = solid_angles * moment_functions(-directions)[: len(emission)]
    sums = np.zeros(emission.shape)
    for axis in range(3):
        matter = np.ascontiguousarray(np.moveaxis(extinction, axis, 0), np.float32)
        source = np.ascontiguousarray(np.moveaxis(emission, axis + 1, 0), np.float32)
        found = np.zeros(source.shape, np.float32)
        for alike in _alike(directions, axis):
            sweep = _Sweep.along(directions[alike.numbers], axis, alike.signs, step)
            sweep.run(matter, source, found, arriving[alike.numbers], weights[:, alike.numbers])
        sums += np.moveaxis(found, 0, axis + 1)
    return sums


def moment_functions(directions: Array) -> Array:
    """(9, k): functions of directions (k, 3) whose integrals are the moments of orders 0 to 2.

    Those of each order l add up to its Legendre polynomial P_l of the cosine between two directions, if the products of
    both are summed.
    """
    x, y, z = directions.T
    root = np.sqrt(3.0)
    second = root * x * y, root * y * z, root * z * x, 1.5 * z * z - 0.5, 0.5 * root * (x * x - y * y)
    return np.stack([np.ones(len(directions)), x, y, z, *second])


#: Order of each of `moment_functions`.
ORDER = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])


def condensed(extinction: Array, directions: Array, step: float) -> Array:
    """Extinction (...) in 1/m with which sweeps spread light as far as the true extinction does.

    In a sweep light is scattered on from anywhere in the cell where it was scattered, and gets into several cells of
    each slice: from event to event it goes too far. Along a direction of largest component m, with tangents t aside, it
    crosses n edges of cells of a depth x with E[n] = m / x and E[n^2] = coth(x / 2 m) m / x, and is moved aside
    by 1 with a chance t at each. The mean square of the path, in cells, is E[n^2] / m^2 + E[n] sum t (1 - t),
    so that the diffusion coefficient, x / 6 times as much, is (2 / x + S + B x) / 6 up to x^2, with the means
    S of m sum t (1 - t) and B of 1 / 6 m^2 over the directions. It has to be 1 / 3 tau, where tau is the true depth of
    a cell. Then light that starts anywhere has the right power, and the right mean square of its path, whatever is
    absorbed. From about tau = 1.2 on there is no such depth: then the one with the shortest paths is it.

    The same is done for lattice gases (Henon 1987, "Viscosity of a lattice gas").
    """
    slopes = np.sort(np.abs(directions), axis=1)
    most, aside = slopes[:, 2], slopes[:, :2] / slopes[:, 2:]
    mixed = float((most * (aside * (1.0 - aside)).sum(axis=1)).mean())
    flat = float((1.0 / (6.0 * most**2)).mean())
    depth = extinction * step
    half = np.maximum(2.0 - mixed * depth, np.sqrt(8.0 * flat) * depth)
    return np.asarray(4.0 * extinction / (half + np.sqrt(np.maximum(half**2 - 8.0 * flat * depth**2, 0.0))))


@dataclass(frozen=True)
class _Alike:
    """Directions that lead from each cell between the same cells of the slice before."""

    numbers: Integers
    signs: tuple[float, float, float]


def _alike(directions: Array, axis: int) -> list[_Alike]:
    order = [axis, *(other for other in range(3) if other != axis)]
    steepest = np.flatnonzero(np.abs(directions).argmax(axis=1) == axis)
    signs = np.where(directions[steepest][:, order] >= 0.0, 1.0, -1.0)
    kinds, kind = np.unique(signs, axis=0, return_inverse=True)
    return [_Alike(steepest[kind.ravel() == i], (s[0], s[1], s[2])) for i, s in enumerate(kinds)]


@dataclass(frozen=True, eq=False)
class _Sweep:
    """One sweep along an axis; arrays of a slice have one more row and column, on the side where light comes from."""

    backwards: bool
    here: _Index
    beside: tuple[tuple[_Index, Floats], ...]
    length: Floats

    @classmethod
    def along(cls, directions: Array, axis: int, signs: tuple[float, float, float], step: float) -> _Sweep:
        ahead = np.abs(directions[:, axis])
        aside = [np.abs(directions[:, other]) / ahead for other in range(3) if other != axis]
        near, far = (tuple(_ends(sign, farther) for sign in signs[1:]) for farther in (False, True))
        beside = []
        for i, j in np.ndindex(2, 2):
            weight = (aside[0] if i else 1.0 - aside[0]) * (aside[1] if j else 1.0 - aside[1])
            index = (far if i else near)[0], (far if j else near)[1]
            beside.append((index, weight.astype(np.float32)[:, None, None, None]))
        length = (step / ahead).astype(np.float32)[:, None, None, None]
        return cls(signs[0] > 0.0, (near[0], near[1]), tuple(beside), length)

    def run(self, extinction: Floats, emission: Floats, sums: Floats, arriving: Array, weights: Array) -> None:
        """Add the weighted radiance of these directions to slices (x, m, y, z, 3) of an array."""
        count, (_, n, m, channels) = len(arriving), extinction.shape
        light = np.empty((count, n + 1, m + 1, channels), np.float32)
        light[...] = arriving[:, None, None, :]
        weights = weights.astype(np.float32)
        travel = np.ascontiguousarray((weights[1:] / weights[0]).T)
        for i in range(len(extinction))[:: -1 if self.backwards else 1]:
            sigma, source = extinction[i], emission[i]
            sent = source[0] if len(source) == 1 else source[0] + np.tensordot(travel, source[1:], axes=1)
            # All that leaves a cell gets into those of the next slice: nothing is lost between them.
            edge, depth, sent = self._between(light), sigma * self.length, sent * self.length
            through, mean, rest = _means(depth)
            light[:, *self.here] = edge * through + sent * mean
            sums[i] += np.tensordot(weights, edge * mean + rest * sent, axes=1)

    def _between(self, values: Floats) -> Floats:
        """(g, n, m, c): values of the previous slice, interpolated where the directions come from."""
        (first, weight), *others = self.beside
        total = weight * values[:, *first]
        for index, weight in others:
            total = total + weight * values[:, *index]
        return total


def _means(depth: Floats) -> tuple[Floats, Floats, Floats]:
    """Transmittance of a path, its mean over the path, (1 - e^-x) / x, and the mean over all starting points on it."""
    lost = np.asarray(-np.expm1(-depth), np.float32)
    safe = np.maximum(depth, _SERIES)
    small = depth < _SERIES
    mean = np.where(small, 1.0 - depth * (0.5 - depth / 6.0), lost / safe)
    rest = np.where(small, 0.5 - depth * (1.0 / 6.0 - depth / 24.0), (1.0 - mean) / safe)
    return np.float32(1.0) - lost, mean, rest


def _ends(sign: float, farther: bool) -> slice:
    """Cells of a slice in arrays with one more at the end where light comes from; or each one's neighbor there."""
    return slice(1, None) if (sign > 0.0) == farther else slice(0, -1)


#: Directions of the rounds: what has been scattered depends on directions little.
ORDINATES = 48

#: Rounds, and the change at which they are enough.
MOST_ROUNDS, ENOUGH = 8, 1e-2

#: Earlier rounds that are mixed with the last one into the start of the next.
MIXED = 2

#: Mean cosine of scattering from which on pictures see in which direction light goes in a volume.
LEAST_AHEAD = 0.05

#: Optical depth of a cell up to which cells keep all moments of what is scattered ahead.
ALL_MOMENTS_DEPTH = 0.5


def straight_fraction(anisotropy: float, cell_depth: float) -> float:
    """Fraction of scattered light that counts as unscattered, so that the rest is scattered nearly to all sides.

    g^3 makes the third Legendre moment of the rest 0 (delta-M, see above). In cells of a large scattering depth a sweep
    spreads light farther than to the next event: there it is g, and the rest goes to all sides alike, as similarity has
    it.
    """
    if anisotropy < LEAST_AHEAD:
        return anisotropy
    least = 1.0 - ALL_MOMENTS_DEPTH / max(cell_depth, np.finfo(np.float64).tiny)
    return min(max(anisotropy**3, least), anisotropy)


#: Optical depth across a cell beyond which its medium counts as no denser.
MOST_DEPTH = 2.0

#: Points at which the density is read in each cell on the path of a light.
POINTS_A_CELL = 1.5

#: Cells that count as none of a path.
_STILL = 1e-9

#: Places in each cell, along each axis, at which it is looked for the light of a spot.
_SPOT_PLACES = 4


@dataclass(frozen=True, eq=False)
class VolumeField:
    """Light that comes from everywhere to the points of a medium, on a grid of cells in world coordinates.

    Attributes
    ----------
    mean_radiance : (x, y, z, 3) float32
        Of what has been scattered, and of the unscattered environment: a medium scatters sigma_s times as much of it
        into each metre of a ray. Spread beyond the body.
    moments : tuple of 8 (x, y, z, 3) float32, or of none
        Of a medium that scatters ahead: moments of orders l = 1 and 2 of the same light over 4 pi, times (2 l + 1) and
        the moment of what does not count as unscattered of the phase function. Their products with the
        `moment_functions` of the direction of travel are added to the mean: light is scattered on where it goes.
    mean_cosine : float
        g of this medium; 0 without moments.
    straight : float
        Fraction of scattered light that counts as unscattered here, beyond what rays find of each light themselves; 0
        without moments.
    environment : EnvironmentAhead, optional
        What rays find of the environment at their end.
    cap : float
        Value in 1/sr at which the phase function is cut off, see `capped`: light turns below it, and goes ahead above.
    """

    mean_radiance: npt.NDArray[np.float32]
    low: Array
    step: float
    steps: int
    moments: tuple[Floats, ...] = ()
    mean_cosine: float = 0.0
    straight: float = 0.0
    environment: EnvironmentAhead | None = None
    cap: float = 0.0

    @property
    def volumes(self) -> tuple[npt.NDArray[np.float32], ...]:
        """Arrays (x, y, z, 3) that pictures look up."""
        ahead = () if self.environment is None else (self.environment.radiance,)
        return (self.mean_radiance, *self.moments, *ahead)


@dataclass(frozen=True, eq=False)
class PhotonFluence:
    """Fluence in a medium by photons: light of lights that other bodies refract or reflect into it.

    Attributes
    ----------
    cells : FineCells
        Which divide those of a `VolumeGrid`.
    fluence : (x, y, z, 3) float64
        See `MediaPhotons`.
    stops : RayCaster, optional
        These bodies.
    """

    cells: FineCells
    fluence: Array
    stops: RayCaster | None


def capped(phase: PhaseFunction, fraction: float) -> float:
    """Value in 1/sr at which a phase function is cut off so that this fraction is left below."""
    cosine, weight = np.polynomial.legendre.leggauss(256)
    values = phase.value(cosine)
    order = np.argsort(values)
    values, weight = values[order], 2.0 * np.pi * weight[order]
    # Below each value the fraction is that of the smaller ones, and this value times the rest of the weights.
    below = np.cumsum(weight * values) + values * (weight.sum() - np.cumsum(weight))
    return float(np.interp(fraction, below, values))


class VolumeGrid:
    """Cells of a body and their densities, for all media and lights.

    Parameters
    ----------
    body : Object
        Closed, without an interface.
    step : float
        Side of a cell in metres.
    """

    def __init__(self, body: Object, step: float) -> None:
        self.grid: BodyGrid = body_grid(body, step)
        self.density = self.grid.cells.inside * cell_means(body, self.grid)
        self.thickness = body.mean_thickness
        self.body = body

    @property
    def inside(self) -> npt.NDArray[np.bool_]:
        """(x, y, z): cells of the system."""
        return np.asarray(self.grid.number >= 0)


class DiffusingVolume:
    """A body without an interface and its medium, ready for any light.

    Parameters
    ----------
    volume : VolumeGrid
    medium : Medium
    warm_starts : bool
        See `translucent.diffusion.solution.BodySystem`.
    """

    @np.errstate(under="ignore")
    def __init__(self, volume: VolumeGrid, medium: Medium, *, warm_starts: bool = False) -> None:
        self._volume, self._medium, self._warm_starts = volume, medium, warm_starts
        scattering, absorption, step = (
            np.asarray(medium.scattering),
            np.asarray(medium.absorption),
            volume.grid.cells.step,
        )
        self._reduced = scattering * (1.0 - medium.anisotropy)
        # What is denser looks the same, and its skin would be lost in a cell.
        most = MOST_DEPTH / max(float((absorption + self._reduced).max()) * step, np.finfo(np.float64).tiny)
        self._density = np.minimum(volume.density, most)
        self._peak = straight_fraction(medium.anisotropy, float((scattering * self._density.max()).max()) * step)
        turning = scattering * (1.0 - self._peak)
        order = ORDER if self._ahead > 0.0 else ORDER[:1]
        #: Of what counts as scattered, (2 l + 1) times its Legendre moments.
        kept = (medium.anisotropy**order - self._peak) / (1.0 - self._peak)
        self._kept = (2.0 * order + 1.0) * np.maximum(kept, 0.0)
        self._kept[0] = 1.0
        self._turning = self._density[..., None] * turning
        extinction = self._density[..., None] * (absorption + turning)
        # Sweeps are right in cells that light gets through; in others diffusion is, and rounds would not end.
        self._resolved = 1.0 / (1.0 + (extinction * step) ** 2)
        self._directions = even_directions(ORDINATES)
        self._swept = condensed(extinction, self._directions, step)
        self._turned = self._swept - self._density[..., None] * absorption
        self._solid_angles = nearest_parts(self._directions)[1]
        self._systems = [
            None if scattering == 0.0 else _system(volume, self._density, absorption, scattering)
            for absorption, scattering in zip(np.asarray(medium.absorption), self._reduced, strict=True)
        ]

    @np.errstate(under="ignore")
    def field(self, scene: Scene, photons: PhotonFluence | None = None) -> VolumeField:
        """Scattered light in the body, from environment, lights and the emission of the medium.

        With `photons`, which carry the light that bodies refract and reflect, none of it goes straight through these.
        """
        volume, medium = self._volume, self._medium
        if not self._warm_starts:
            for system in self._systems:
                if system is not None:
                    system.forget()
        sky = self._sky(scene)
        stops = None if photons is None else photons.stops
        unturned, ahead = self._from_lights(scene, stops)
        emission = 4.0 * np.pi * self._density[..., None] * np.asarray(medium.emission)
        if photons is not None:
            emission = emission + self._density[..., None] * self._reduced * photons.cells.coarse(photons.fluence)
        scattered, steps = self._scattered(self._turned * sky + self._turning * unturned, emission)
        moments = sky + scattered
        # Light that is scattered back more than ahead gets less deep than reduced coefficients say: what they add twice
        # is taken away, and no more than there is.
        if self._ahead == 0.0:
            moments[0] = np.maximum(moments[0] + (1.0 - min(medium.anisotropy, 0.0)) * ahead, 0.0)
        # Beyond the body each cell has what the nearest inside has, for what is interpolated at its surface.
        nearest = tuple(distance_transform_edt(~volume.inside, return_distances=False, return_indices=True))
        mean, *higher = self._kept[:, None, None, None, None] * moments[:, *nearest] / (4.0 * np.pi)
        cells = volume.grid.cells
        step, straight = cells.step, self._peak if self._ahead > 0.0 else 0.0
        if photons is not None:
            # Rays find none of it at lights: all that is scattered the first time is here, too.
            step = photons.cells.step
            mean = (
                _finer(mean, photons.cells.finer)
                + (1.0 - medium.anisotropy) / (1.0 - straight) / (4.0 * np.pi) * photons.fluence
            )
            higher = [_finer(part, photons.cells.finer) for part in higher]
        volumes = tuple(np.ascontiguousarray(part, np.float32) for part in (mean, *higher))
        behind = environment_ahead(scene.environment, self._ahead, straight) if self._ahead > 0.0 else None
        cap = capped(medium.phase_function, 1.0 - straight) if self._ahead > 0.0 else 0.0
        return VolumeField(volumes[0], cells.low, step, steps, volumes[1:], self._ahead, straight, behind, cap)

    @property
    def _ahead(self) -> float:
        """Mean cosine of a medium that scatters forward, else 0: then only means over directions are computed."""
        return self._medium.anisotropy if self._medium.anisotropy >= LEAST_AHEAD else 0.0

    def _from_lights(self, scene: Scene, stops: RayCaster | None) -> tuple[Array, Array]:
        """Moments (m, x, y, z, 3) of lights without events but forward ones, and fluence after forward events."""
        absorption, scattering = np.asarray(self._medium.absorption), np.asarray(self._medium.scattering)
        extinctions = absorption + (1.0 - self._peak) * scattering, absorption + scattering
        unturned, ahead = _from_lights(self._volume, self._density, scene, extinctions, stops)
        return unturned[: len(self._kept)], ahead

    def _sky(self, scene: Scene) -> Array:
        """(m, x, y, z, 3): moments of the environment's light that nothing has scattered."""
        directions = even_directions(DIRECTIONS)
        solid_angles = nearest_parts(directions)[1]
        radiance = environment_parts(scene.environment, directions) / solid_angles[:, None]
        nothing = np.zeros((len(self._kept), *self._swept.shape))
        if not radiance.any():
            return nothing
        return swept_moments(self._swept, nothing, radiance, directions, solid_angles, self._volume.grid.cells.step)

    def _scattered(self, events: Array, emission: Array) -> tuple[Array, int]:
        """Moments of light that has been scattered or emitted, (m, x, y, z, 3), and steps of the solver.

        `events` are the moments of what is scattered for the first time, for each metre, and `emission` is power.
        """
        step = self._volume.grid.cells.step
        dark = np.zeros((ORDINATES, 3))
        # The mean of what cells send is that of what gets to them; of other moments they send a fraction.
        kept = self._kept[:, None, None, None, None]
        first = kept * events
        first[0] += emission
        moments = np.zeros_like(first)
        moments[0], steps = self._diffused(first[0])
        mixed = _Mixed()
        for _ in range(MOST_ROUNDS):
            source = (first + kept * self._turned * moments) / (4.0 * np.pi)
            found = swept_moments(self._swept, source, dark, self._directions, self._solid_angles, step)
            changed = found - moments
            changed[0] *= self._resolved
            # What the round has changed scatters again: diffusion finds where that goes.
            rest, taken = self._diffused(self._turned * changed[0])
            steps += taken
            changed[0] += rest
            better = mixed.next(moments, changed)
            better[0] = np.maximum(better[0], 0.0)
            change = np.abs(better - moments).max(initial=0.0)
            moments = better
            if change <= ENOUGH * moments[0].max(initial=0.0):
                break
        return moments, steps

    def _diffused(self, power: Array) -> tuple[Array, int]:
        """Fluence (x, y, z, 3) by diffusion, for powers per volume, and steps; 0 outside."""
        inside, fluence, steps = self._volume.inside, np.zeros(power.shape), 0
        for channel, system in enumerate(self._systems):
            if system is not None:
                found, taken = system.solved(power[inside, channel] * self._volume.grid.cells.step**3)
                fluence[inside, channel] = found
                steps += taken
        return fluence, steps


class _Mixed:
    """Anderson mixing of the rounds of a fixed-point iteration (Anderson 1965).

    Light in a hollow, which diffusion ignores, goes to and fro many times: by itself each round follows it once.
    """

    def __init__(self) -> None:
        self._rounds: list[tuple[Array, Array]] = []

    def next(self, start: Array, change: Array) -> Array:
        """Start (..., 3) of the next round, from the start and the change of the last one."""
        found = start + change
        if self._rounds:
            for channel in range(3):
                own, changed = start[..., channel].ravel(), change[..., channel].ravel()
                starts, changes = (
                    np.stack([last - each[k][..., channel].ravel() for each in self._rounds], axis=1)
                    for k, last in enumerate((own, changed))
                )
                weights = np.linalg.lstsq(changes, changed)[0]
                found[..., channel] -= ((starts + changes) @ weights).reshape(found.shape[:-1])
        self._rounds = [*self._rounds, (start, change)][-MIXED:]
        return found


def _finer(values: Array, times: int) -> Array:
    """Values (x, y, z, 3) of cells, interpolated at the centers of finer cells."""
    if times == 1:
        return values
    places = [np.clip((np.arange(size * times) + 0.5) / times - 0.5, 0.0, size - 1.0) for size in values.shape[:3]]
    for axis, place in enumerate(places):
        low = np.minimum(place.astype(np.int64), max(values.shape[axis] - 2, 0))
        fraction = (place - low).reshape([-1 if i == axis else 1 for i in range(4)])
        high = np.minimum(low + 1, values.shape[axis] - 1)
        values = (1.0 - fraction) * values.take(low, axis) + fraction * values.take(high, axis)
    return values


def _system(volume: VolumeGrid, dense: Array, absorption: float, scattering: float) -> CellSystem:
    """Linear system of diffusion in one channel; free paths are no longer than the body is thick."""
    grid, density = volume.grid, dense[volume.inside]
    there = density * grid.cells.step**3 / grid.volumes
    d = 1.0 / (there / float(diffusion_coefficient(absorption, scattering)) + 1.0 / volume.thickness)
    read, depth = grid.below
    # Half of the fluence leaves, as much as gets there.
    lost = grid.area / (2.0 + depth / np.maximum(read @ d, np.finfo(np.float64).tiny))
    return CellSystem(grid, d, absorption * density * grid.cells.step**3, lost)


def _from_lights(
    volume: VolumeGrid, density: Array, scene: Scene, extinctions: tuple[Array, Array], stops: RayCaster | None = None
) -> tuple[Array, Array]:
    """Moments (9, x, y, z, 3) of lights without events but forward ones, and fluence (x, y, z, 3) after forward events.

    `extinctions` (3,), (3,) are that of other events and that of all; `stops` are surfaces that none of it passes.
    """
    grid, body = volume.grid, volume.body
    unturned, ahead = np.zeros((9, *density.shape, 3)), np.zeros((*density.shape, 3))
    cells, inside = grid.cells, grid.number >= 0
    points = cells.low + cells.step * cells.center[inside]
    for light in scene.lights:
        if isinstance(light, PositionalLight):
            place = np.broadcast_to(np.asarray(light.position), points.shape)
            # In a light's own cell the mean of 1 / r^2 is that of a ball as large, 3 / R^2.
            nearest = (3.0 / (4.0 * np.pi)) ** (1.0 / 3.0) * cells.step / np.sqrt(3.0)
            power = np.asarray(light.intensity) / np.maximum(((place - points) ** 2).sum(axis=1), nearest**2)[:, None]
            if isinstance(light, SpotLight):
                power = power * _mean_attenuation(light, points, cells.step)[:, None]
        else:
            place = points - np.asarray(light.direction) * cells.step * sum(density.shape)
            power = np.broadcast_to(np.asarray(light.irradiance), points.shape)
        if stops is not None:
            power = np.where((stops.nearest(points, place - points)[1] < 1.0)[:, None], 0.0, power)
        # Attenuation starts at the edge of the cell, and is the mean over it: an opaque cell gets all entering light.
        own = density[inside] * cells.step
        if body.density is None:
            column = _metres_inside(body, points, place)
        else:
            offset = np.abs(place - points)
            own = own * np.linalg.norm(offset, axis=1) / np.maximum(offset.max(axis=1), _STILL)
            column = _column(grid, density, points, place)
        before = np.maximum(column - 0.5 * own, 0.0)
        turned, all_turned = (
            power * optics.transmittance(sigma * before[:, None]) * optics.mean_transmittance(sigma * own[:, None])
            for sigma in extinctions
        )
        travel = (points - place) / np.maximum(np.linalg.norm(points - place, axis=1), _STILL)[:, None]
        unturned[:, inside] += moment_functions(travel)[..., None] * turned
        ahead[inside] += turned - all_turned
    return unturned, ahead


def _mean_attenuation(light: SpotLight, points: Array, step: float) -> Array:
    """(k,): mean falloff of a spot over cells around points, as its cone may be thinner than a cell."""
    places = (np.arange(_SPOT_PLACES) + 0.5) / _SPOT_PLACES - 0.5
    total = np.zeros(len(points))
    for offset in np.stack(np.meshgrid(places, places, places), axis=-1).reshape(-1, 3) * step:
        from_light = points + offset - np.asarray(light.position)
        total += cone_attenuation(
            from_light / np.maximum(np.linalg.norm(from_light, axis=1), _STILL * step)[:, None], light.cone
        )
    return np.asarray(total / _SPOT_PLACES**3)


def _metres_inside(body: Object, points: Array, places: Array) -> Array:
    """(k,): metres in a body between points (k, 3) and places (k, 3): a grid would smear its surface."""
    path = places - points
    distance = np.linalg.norm(path, axis=1)
    return path_inside(body, points, path / np.maximum(distance, np.finfo(np.float64).tiny)[:, None], distance)


def _column(grid: BodyGrid, density: Array, points: Array, places: Array) -> Array:
    """(k,): integral of the density in metres between points (k, 3) and places (k, 3), as far as in the grid."""
    cells, size = grid.cells, np.array(density.shape)
    begin, end = ((where - cells.low) / cells.step - 0.5 for where in (points, places))
    along = end - begin
    slow = np.where(np.abs(along) > _STILL, along, _STILL)
    leaves = np.where(slow > 0.0, size - begin, -1.0 - begin) / slow
    fraction = np.clip(leaves.min(axis=1), 0.0, 1.0)
    count = max(int(POINTS_A_CELL * size.max()), 1)
    total = np.zeros(len(points))
    for t in (np.arange(count) + 0.5) / count:
        at = begin + (t * fraction)[:, None] * along
        total += map_coordinates(density, at.T, order=1, mode="constant")
    return np.asarray(total * np.linalg.norm(along, axis=1) * fraction * cells.step / count)
