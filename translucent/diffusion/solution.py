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

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from typing import Protocol

import numpy as np
from scipy import sparse

from translucent.arrays import Array
from translucent.diffusion.cell_system import TOLERANCE, CellSystem
from translucent.diffusion.densities import Densities, even_densities
from translucent.diffusion.entering_rays import EnteringRays, LateralShift, moved_along
from translucent.diffusion.first_events import (
    EntryPaths,
    FirstEvents,
    LayerSolution,
    ShiftedEvents,
    diffuse_paths,
    entry_paths,
    scattered_fractions,
    seen_inclusions,
)
from translucent.diffusion.grid import BodyGrid
from translucent.diffusion.interfaces import BodyInterface, scattered_escape
from translucent.diffusion.keys import kept
from translucent.diffusion.walls import SlabSolution, Walls
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffusion_coefficient, half_space_reflectance
from translucent.formulas.diffusion import UNIFORM_COSINE
from translucent.formulas.phase import ISOTROPIC, PhaseFunction
from translucent.media.medium import Medium

#: Sets of rays, of a light or of the environment, whose effects are kept: at most, and numbers in all of them together.
KEPT_RAYS, KEPT_NUMBERS = 8, 1 << 23

#: Relative residual of the solver for factors that are near 1.
ROUGH = 1e-3

#: The same at first, while it is not known what falls on the body again; and as a fraction of the change of that.
FIRST, OF_CHANGE = 1e-2, 0.1

#: Largest number of times that light of the body falls on the body again, and the change at which it is enough.
MOST_BOUNCES, ENOUGH = 24, 1e-3

#: Largest change at which a small part of the light is good enough.
MOST_MISSED = 0.1

#: Largest fraction of the light that may return to the surface; at that one, a hundred times as much is to come.
MOST_RETURNED = 0.99

#: Bounds of the correction by uniform light.
LEAST_CORRECTION, MOST_CORRECTION = 0.5, 2.0

_TINY = np.finfo(np.float64).tiny

#: Fraction of the probability to escape that is absorbed at least where what uniform light misses is looked for.
LEAST_ABSORBED = 0.1

#: Least fraction of the fluence that was last scattered by the medium, and not by an inclusion.
LEAST_SCATTERED = 0.05

#: Least fraction of the paths through a body on which light counts as scattered: thinner parts hardly scatter.
LEAST_ON_PATHS = 0.002

#: Least fraction of a cell's volume that absorbs.
_LEAST_ABSORBING = 0.02


@dataclass(frozen=True)
class DiffuseSolution:
    """Solution of diffusion: fluence and flux at the samples of a body's surface, and fluence in its cells.

    Attributes
    ----------
    fluence : (s, 3) float64
        Of light that has been scattered, below the surface.
    entering : (s, 3) float64
        Flux that enters, that of the body itself included.
    inside : (cells, 3) float64
        Fluence in the cells.
    at_inclusions : (i, 3) float64
        Irradiance at the samples of opaque inclusions.
    cosine : (s,) float64
        Mean cosine of the light that enters, inside; see `emergent_radiance`.
    travel : (s, 3) float64
        Mean direction of that light, inside; shorter than 1 where it comes from several.
    leaving : (s, 3) float64
        Flux that leaves the samples: what has been in the body, and what its surface mirrors; over n^2 in a medium of
        index n.
    passing : (s, 3) float64
        Uniform light that leaves the samples without an event, likewise.
    scattered : (s, 3) float64
        Fraction of the paths through the body from each sample on which uniform light is scattered.
    steps : int
        Iterations that the solver took, in all.
    """

    fluence: Array
    entering: Array
    inside: Array
    at_inclusions: Array
    cosine: Array
    travel: Array
    leaving: Array
    passing: Array
    scattered: Array
    steps: int

    def times(self, factor: Array) -> DiffuseSolution:
        """Solution for `factor` (3,) times the light, by color channel."""
        names = ("fluence", "entering", "inside", "at_inclusions", "leaving", "passing")
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    def plus(self, more: DiffuseSolution) -> DiffuseSolution:
        """Sum of two solutions for one body: its light if both fall on it."""
        own, other = self.entering.sum(axis=1), more.entering.sum(axis=1)
        total = np.maximum(own + other, _TINY)
        inverse = (own / (self.cosine + 0.5) + other / (more.cosine + 0.5)) / total
        names = ("fluence", "entering", "inside", "at_inclusions", "leaving", "passing", "steps")
        return replace(
            self,
            cosine=np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0) - 0.5, UNIFORM_COSINE),
            travel=(own[:, None] * self.travel + other[:, None] * more.travel) / total[:, None],
            **{name: getattr(self, name) + getattr(more, name) for name in names},
        )


class Returned(Protocol):
    """Flux (s,) that enters a body again in a color channel, for a flux (s,) that leaves it.

    Of a body inside clear ones, see `BodyInterface.enclosed`, what leaves it on paths on which all light is scattered.
    """

    def __call__(self, leaving: Array, channel: int) -> Array:
        """(s,): flux that enters."""
        ...


class BodySystem:
    """Linear systems of diffusion of one body and medium, one for each color channel.

    Parameters
    ----------
    grid : BodyGrid
    medium : Medium
        In channels in which it does not scatter nothing is found.
    roughness : float
        Of its surface.
    dense : Densities, optional
        Of the body; default: `even_densities`.
    walls : Walls, optional
        Of the grid; default: `Walls.of` it.
    colors : (i, 3) float64, optional
        Fraction of the light that inclusions reflect at their samples; default: half.
    corrected : bool
        What diffusion gets wrong of uniform light around such a body without losses is taken out: it takes as long as
        all else.
    warm_starts : bool
        Solutions start from those for earlier light, in few steps. They then depend on it, within `TOLERANCE`.
    outside : (s,) float64, optional
        Index of what is around the body, at its samples; default: air.

    Attributes
    ----------
    interface : BodyInterface
    """

    @np.errstate(under="ignore")
    def __init__(
        self,
        grid: BodyGrid,
        medium: Medium,
        roughness: float,
        dense: Densities | None = None,
        *,
        walls: Walls | None = None,
        colors: Array | None = None,
        corrected: bool = True,
        warm_starts: bool = False,
        outside: Array | None = None,
    ) -> None:
        self.interface = BodyInterface.of(medium.ior, roughness, outside)
        self._squares = np.ones((1, 1)) if outside is None else outside[:, None] ** 2
        self._warm_starts, ior = warm_starts, self.interface.ior
        self._arriving: OrderedDict[Hashable, tuple[dict[int, _DirectionalEffects], Array]] = OrderedDict()
        self._emitted = 4.0 * np.pi * self.interface.outside**2 * np.asarray(medium.emission)
        reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
        self._grid, self._dense = grid, dense or even_densities(grid)
        count = 0 if grid.inclusions is None else len(grid.inclusions.points)
        colors = np.full((count, 3), 0.5) if colors is None else colors
        paths, walls = diffuse_paths(grid, self._dense, ior), walls or Walls.of(grid)
        self._channels = {
            channel: _ChannelSystem(
                grid,
                self.interface,
                float(absorption),
                float(scattering),
                self._dense,
                paths,
                scattered_fractions(grid, self._dense, ior, float(absorption + scattering)),
                medium.phase_function,
                seen=seen_inclusions(grid, self._dense, ior, float(absorption + scattering)),
                reflected=np.asarray(colors[:, channel]),
                walls=walls,
                corrected=corrected,
            )
            for channel, (absorption, scattering) in enumerate(zip(np.asarray(medium.absorption), reduced, strict=True))
            if scattering > 0.0
        }

    @np.errstate(under="ignore")
    def solved(
        self,
        entering: Array,
        returned: Returned | None,
        inside: Array,
        rays: Sequence[EnteringRays] = (),
        *,
        part: float = 1.0,
    ) -> DiffuseSolution:
        """Light at the body's surface.

        Parameters
        ----------
        entering : (s, 3)
            Flux that enters at the samples from outside, in W/m^2, from all around.
        returned : callable, optional
            Flux (s,) that enters again in a color channel, for a flux (s,) that leaves the samples.
        inside : (cells, 3)
            Power of lights inside each cell, in W.
        rays : sequence of EnteringRays
        part : float
            This light as a fraction of all light, if it is added to other light: below 1, it is solved less
            precisely, and the medium does not emit again.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        fluence, flux, cells = np.zeros_like(entering), entering.copy(), np.zeros_like(inside)
        scattered, leaving, passing = np.ones_like(entering), np.zeros_like(entering), np.zeros_like(entering)
        count = 0 if self._grid.inclusions is None else len(self._grid.inclusions.points)
        inclusions = np.zeros((count, 3))
        steps, normals = 0, self._grid.face_normals
        numbers = 3 * (9 * len(flux) + self._grid.count)
        most = max(2, min(KEPT_RAYS, KEPT_NUMBERS // max(numbers, 1)))
        straights = [
            kept(self._arriving, ray, partial(self._directional, ray), most) for ray in rays if len(ray.samples)
        ]
        directed, incidence = np.zeros(len(flux)), sum((sums for _, sums in straights), np.zeros((4, len(flux))))
        for channel, system in self._channels.items():
            emission = float(self._emitted[channel])
            straight = reduce(_DirectionalEffects.plus, (each[channel] for each, _ in straights), system.nothing)
            directed = directed + straight.first.flux
            found = system.solved(
                entering[:, channel],
                None if returned is None else partial(returned, channel=channel),
                inside[:, channel],
                emission,
                straight,
                self._warm_starts,
                part,
            )
            fluence[:, channel], flux[:, channel], leaving[:, channel], cells[:, channel], taken = found
            passing[:, channel] = system.through * (flux[:, channel] - straight.first.flux)
            inclusions[:, channel] = system.at_inclusions(cells[:, channel], flux[:, channel], straight)
            fluence[:, channel] = system.without_inclusions(fluence[:, channel], inclusions[:, channel])
            scattered[:, channel] = system.scattered
            steps += taken
        total = flux.sum(axis=1)
        cosine = _mean_cosine(total, directed, incidence[0])
        travel = _mean_direction(total, directed, incidence[1:].T, normals)
        leaving, passing = (light / self._squares for light in (leaving, passing))
        return DiffuseSolution(fluence, flux, cells, inclusions, cosine, travel, leaving, passing, scattered, steps)

    def _directional(self, ray: EnteringRays) -> tuple[dict[int, _DirectionalEffects], Array]:
        """Effects of rays that enter, by channel.

        And sums (4, s), over the channels, of the flux over 1/2 and its cosine, and of it times its direction.
        """
        path = entry_paths(ray, self._grid, self._dense)
        shift = LateralShift.of(self._grid, ray, self.interface.ior) if ray.from_one else None
        effects, flux = dict[int, _DirectionalEffects](), np.zeros(())
        for channel, system in self._channels.items():
            found = system.directional(ray.entering[:, channel], ray.mirrored[:, channel], path, shift)
            effects[channel], flux = found[0], flux + found[1]
        columns = [flux / (0.5 + path.cosine), *(flux * along for along in path.directions.T)]
        return effects, moved_along(columns, path.samples, len(self._grid.points), shift)


def _mean_cosine(flux: Array, directed: Array, inverse: Array) -> Array:
    """(s,): mean cosine of the light that enters, with which 1 / (mu + m) is the mean of all light, at mu = 1/2.

    The part `directed` (s,) of the flux (s,), over 1/2 and its cosine, is `inverse` (s,); the rest is uniform.
    """
    rest = np.maximum(flux - directed, 0.0)
    total = np.maximum(rest + directed, np.finfo(np.float64).tiny)
    mean = (inverse + rest / (0.5 + UNIFORM_COSINE)) / total
    return np.where(mean > 0.0, 1.0 / np.where(mean > 0.0, mean, 1.0) - 0.5, UNIFORM_COSINE)


def _mean_direction(flux: Array, directed: Array, travel: Array, normals: Array) -> Array:
    """(s, 3): mean direction of the light that enters at samples with normals (s, 3), as of `_mean_cosine`."""
    rest = np.maximum(flux - directed, 0.0)
    # 2/3 is the mean cosine of uniform light.
    total = np.maximum(rest + directed, np.finfo(np.float64).tiny)[:, None]
    return np.asarray((travel - 2.0 / 3.0 * rest[:, None] * normals) / total)


@dataclass(frozen=True, eq=False)
class _DirectionalEffects:
    """Effects of entering rays in one channel: first events and reflected flux at samples (s,), power in the cells.

    And fluence in walls (s,), and the power that comes to the samples of inclusions (i,) unscattered.
    """

    first: ShiftedEvents
    mirrored: Array
    slab: Array
    power: Array
    reaching: Array

    def plus(self, more: _DirectionalEffects) -> _DirectionalEffects:
        """Effects of the rays of both."""
        names = ("mirrored", "slab", "power", "reaching")
        return _DirectionalEffects(
            self.first.plus(more.first), *(getattr(self, name) + getattr(more, name) for name in names)
        )


class _ChannelSystem:
    """Linear system of diffusion in one color channel."""

    def __init__(
        self,
        grid: BodyGrid,
        interface: BodyInterface,
        absorption: float,
        scattering: float,
        dense: Densities,
        paths: EntryPaths,
        scattered: Array,
        phase: PhaseFunction = ISOTROPIC,
        *,
        seen: sparse.csr_array | None = None,
        reflected: Array | None = None,
        walls: Walls,
        corrected: bool,
    ) -> None:
        self._grid, ior = grid, interface.ior
        self._exit_fraction, self._mirrored = interface.exit_share, interface.mirrored
        extinction = absorption + scattering
        self._albedo = scattering / extinction
        d = float(diffusion_coefficient(absorption, scattering))
        self._read, depth = grid.below[0], dense.depth
        spread = grid.spread * (self._read @ dense.cells)
        curvature = grid.curvature * np.where(depth > 0.0, grid.below[1] / np.where(depth > 0.0, depth, 1.0), 0.0)
        layer = LayerSolution.of(depth, float(np.sqrt(absorption / d)), interface.conductance / d, spread, curvature)
        self._attenuated = layer.at_surface
        # 4 V / S is the mean chord (Cauchy).
        chord = 4.0 * float(dense.cells @ grid.volumes) / (grid.area * len(depth))
        # Of diffusion, and of all events.
        self._extinctions = extinction, absorption + scattering / (1.0 - phase.mean_cosine)
        self._enclosed = interface.enclosed
        self._ior, self._chord, self._interface = ior, chord, interface.main
        self._even = np.broadcast_to(np.asarray(interface.uniform, np.float64), len(depth))
        self._walls = walls
        slab = SlabSolution(walls, ior, absorption, scattering, phase) if walls.any else None
        self._first = FirstEvents(grid, layer, ior, absorption, scattering, phase, chord, slab)
        diffuse, self._paths = self._first.of(paths), paths
        # Cells that the surface cuts count a little too many events, or too few. The lengths of paths say how many: at
        # edges, where many leave the body on another side, and in all.
        around = np.maximum(diffuse.counted[grid.nearest].mean(axis=1), _TINY)
        fewer = np.minimum(scattered / around, 1.0) if dense.is_even else np.ones(len(around))
        total = max(float(grid.areas @ (fewer * diffuse.counted)), _TINY)
        self._diffuse = diffuse.scaled(fewer * (float(grid.areas @ scattered) / total))
        reflected = np.zeros(0) if reflected is None else reflected
        self._inclusions = _InclusionLosses.of(grid, absorption, d, reflected)
        lost = grid.areas * d * layer.conductance
        absorbing = np.maximum(grid.cores, _LEAST_ABSORBING * grid.volumes)
        absorbed = absorption * dense.cells * absorbing
        lost = np.concatenate([lost, self._inclusions.lost])
        self._cells = CellSystem(grid, dense.diffusion_coefficients(d), absorbed, lost)

        def system(part: float, *, corrected: bool = True) -> _ChannelSystem:
            """Linear system of an absorbing medium around lossless inclusions."""
            a, b, white = part * extinction, (1.0 - part) * extinction, np.ones(len(self._inclusions.lost))
            same = partial(_ChannelSystem, grid, interface, a, b, dense, paths, scattered, seen=seen, walls=walls)
            return same(reflected=white, corrected=corrected)

        self._absorbing, self._correction, self._brighter = system, np.ones(len(depth)), np.ones(())
        seen = sparse.csr_array((len(depth), 0)) if seen is None else seen
        #: (s,), (s,): fractions of the light that is scattered in the body, and that passes it.
        self.scattered, self.through = scattered, 1.0 - scattered - seen.sum(axis=1)
        self._seen = seen
        if corrected:
            # What half-spaces absorb has not been in the body long enough to get to other parts of it.
            reflectance = half_space_reflectance(round(self._albedo, 6), ior)
            factors = system(0.0, corrected=False).by_uniform_light()
            self._correction, self._brighter = (1.0 + reflectance * (np.asarray(factor) - 1.0) for factor in factors)

    def by_uniform_light(self) -> tuple[Array, float]:
        """Factors that make a lossless body invisible in uniform light: (s,) on the fluence, and one for inclusions.

        Such a body is invisible, whatever its shape: all light that leaves has been scattered, except what passes
        straight through. Diffusion sends too much of it out of parts no thicker than a free path, and too little out
        of folds.
        """
        even = self._even
        source = self._power(even)
        cells, _ = self._cells.solved(source, self._cells.even(source), ROUGH)
        found = (self._read @ cells) * self._attenuated + self._diffuse.near * even
        own, across = self._diffuse.slab
        found = self._exit_fraction / even * self._with_walls(found, self._in_walls(own * even, across * even))
        surface = np.clip((1.0 - self.through) / np.maximum(found, _TINY), LEAST_CORRECTION, MOST_CORRECTION)
        # Few paths reach each sample of an inclusion: all of them count together.
        reaching = self._inclusions.reaching(self._grid, self._paths, self._diffuse.reached * even)
        rest = self._ior**2 / self._interface.entering * self._inclusions.area * len(reaching) - float(reaching.sum())
        solved = self._inclusions.area * float(self._inclusions.diffuse(cells, reaching).sum())
        return np.asarray(surface), min(max(rest / max(solved, _TINY), LEAST_CORRECTION), MOST_CORRECTION)

    def _in_walls(self, own: Array, other: Array) -> Array:
        """(s,): fluence in thin walls by light at the samples (s,), of their own side and of the other one."""
        return np.asarray(own + self._walls.area * other[self._walls.across])

    def _with_walls(self, fluence: Array, slab: Array) -> Array:
        """(s,): fluence by cells (s,), and that of slabs (s,) in walls."""
        return np.asarray(fluence + self._walls.part * (slab - fluence))

    @cached_property
    def _uniform(self) -> tuple[Array, Array, float]:
        """(cells,), (s,): fluence for a unit of flux that enters everywhere; and the factor by which both are scaled.

        As long as little is absorbed on a chord the fluence is even, and as much of the scattered light leaves as the
        probability to escape says. Diffusion lets a few per cent more out of thin parts.
        """
        source = self._power(self._even)
        cells, _ = self._cells.solved(source, self._cells.even(source))
        found = (
            np.maximum((self._read @ cells) * self._attenuated + self._diffuse.near * self._even, 0.0)
            * self._correction
        )
        areas, absorbed, extinction = self._grid.areas, 1.0 - self._albedo, self._extinctions[0]
        left = float(areas @ (self._exit_fraction * found)) / max(float(areas @ (self._even * self.scattered)), _TINY)
        even = self._albedo * scattered_escape(self._escape(extinction), self._albedo) / max(left, _TINY)
        factor = 1.0 + float(optics.transmittance(absorbed * extinction * self._chord)) * (even - 1.0)
        return factor * cells, np.asarray(factor * found), factor

    def _emitted(self, emission: float) -> tuple[Array, Array, float]:
        """Fluence in the cells (cells,), and at the samples (s,), of emitted light that has been scattered.

        Where the body and all around it glow alike, everything has one radiance: what the medium sends out is what
        uniform light misses (Kirchhoff 1860). So of q / sigma_a the part 1 - S is left, S the radiance of scattered
        light in uniform light of 1. Rays see the part q / sigma_t of it that nothing has scattered; its flux is the
        third value. `emission` is 4 pi q in W/m^3.
        """
        (extinction, every), entering = self._extinctions, self._interface.entering
        absorbed, escape = 1.0 - self._albedo, self._escape(extinction)
        # Of a medium that absorbs little this is the difference of nearly the same: then the one of a medium that
        # absorbs more is scaled to its power.
        part = max(absorbed, LEAST_ABSORBED * escape)
        system, (power, given) = self, (scattered_escape(escape, 1.0 - one) * (1.0 - one) for one in (absorbed, part))
        if part > absorbed or self._grid.inclusions is not None:
            system = self._absorbing(part)
        cells, fluence, _ = system._uniform
        # Rays take what is scattered ahead for lost, and diffusion for unscattered: it stays here.
        ahead = float(optics.opacity(every * self._chord) / optics.opacity(extinction * self._chord))
        all_of_it = 0.25 * emission * entering / (part * extinction)
        left = (all_of_it - 0.25 * emission * entering / every * ahead) / self._interface.exit_share
        inside, at_samples = (
            power / given * np.maximum(left * scattered - all_of_it * found, 0.0)
            for scattered, found in ((self.scattered.mean(), cells), (self.scattered, fluence))
        )
        if self._grid.inclusions is not None:
            at_samples *= self._uniform[1] / np.maximum(fluence, _TINY)
        return inside, at_samples, 0.25 * emission * self._ior**2 * self._chord * self._escape(every)

    def _escape(self, extinction: float) -> float:
        """Fraction of light from inside that leaves without an event, for an extinction at a density of 1."""
        mean = self._chord / (2.0 * self._grid.body.mean_thickness)
        return self._grid.escape_paths(self._ior).probability(extinction * mean)

    @cached_property
    def nothing(self) -> _DirectionalEffects:
        """Effects of no rays."""
        none = np.zeros(len(self._grid.points))
        return _DirectionalEffects(
            ShiftedEvents(none, none, none),
            none,
            none,
            np.zeros(self._grid.count),
            np.zeros(len(self._inclusions.lost)),
        )

    def directional(
        self, entering: Array, mirrored: Array, paths: EntryPaths, shift: LateralShift | None
    ) -> tuple[_DirectionalEffects, Array]:
        """Effects of rays that enter with a flux (k,), and are reflected with another: first events on their paths.

        Also returns the flux, see `FirstEvents.shifted`.
        """
        events = self._first.of(paths)
        first, flux = self._first.shifted(paths, events, entering, shift)
        power = events.power(self._grid, paths.samples, entering, first.above)
        reaching = self._inclusions.reaching(self._grid, paths, events.reached * entering)
        power = power + self._inclusions.sent(reaching)
        count = len(self._grid.points)
        own, other = (np.bincount(paths.samples, part * entering, count).astype(np.float64) for part in events.slab)
        reflected = np.asarray(np.bincount(paths.samples, mirrored, count), np.float64)
        return _DirectionalEffects(first, reflected, self._in_walls(own, other), power, reaching), flux

    def at_inclusions(self, cells: Array, flux: Array, straight: _DirectionalEffects) -> Array:
        """Irradiance at the samples of inclusions (i,), for what `solved` finds."""
        uniform = self._diffuse.reached * (flux - straight.first.flux)
        reaching = self._inclusions.reaching(self._grid, self._paths, uniform) + straight.reaching
        return np.asarray(self._brighter * self._inclusions.diffuse(cells, reaching) + reaching / self._inclusions.area)

    def without_inclusions(self, fluence: Array, at_inclusions: Array) -> Array:
        """(s,): fluence by the light that the medium scattered last, and not inclusions: rays see these themselves."""
        sent = self._inclusions.reflected * at_inclusions * self._interface.entering / self._ior**2
        return np.asarray(np.maximum(fluence - self._seen @ sent / self._exit_fraction, LEAST_SCATTERED * fluence))

    def _power(self, flux: Array) -> Array:
        """(cells,): power that uniform light with a flux (s,) adds by scattering and internal reflection."""
        power = self._diffuse.power(self._grid, slice(None), flux)
        if self._grid.inclusions is None:
            return power
        reaching = self._inclusions.reaching(self._grid, self._paths, self._diffuse.reached * flux)
        return np.asarray(power + self._inclusions.sent(reaching))

    def solved(
        self,
        entering: Array,
        returned: Callable[[Array], Array] | None,
        power: Array,
        emission: float,
        straight: _DirectionalEffects,
        warm_starts: bool,
        part: float,
    ) -> tuple[Array, Array, Array, Array, int]:
        """Fluence, flux that enters and that leaves at the samples, fluence in the cells, and steps.

        Light of the body falls on it again, as `returned` says of a flux that leaves, until little changes.
        """
        emitted_inside, emitted, unscattered = (
            self._emitted(emission) if part == 1.0 and emission > 0.0 else (0.0, 0.0, 0.0)
        )
        inside = self._albedo * power + straight.power
        # What walls emit themselves is known to the cells alone.
        walls = self._walls.any and emission == 0.0

        def source(flux: Array) -> Array:
            return np.asarray(self._power(flux) + inside)

        # Emitting media are often thin, and their uniform light is known.
        correction = self._correction * (self._uniform[2] if emission > 0.0 else 1.0)

        def at_surface(cells: Array, flux: Array) -> Array:
            fluence = (self._read @ cells) * self._attenuated + self._diffuse.near * flux + straight.first.near
            if walls:
                own, across = self._diffuse.slab
                fluence = self._with_walls(fluence, self._in_walls(own * flux, across * flux) + straight.slab)
            return np.asarray(np.maximum(fluence, 0.0) * correction + emitted)

        def leaving(fluence: Array, flux: Array) -> Array:
            # What the surface mirrors goes on as if it was diffuse.
            return np.asarray(self._exit_fraction * fluence + self._mirrored * flux + straight.mirrored + unscattered)

        def received(fluence: Array, flux: Array) -> Array:
            if returned is None:
                return entering
            if self._enclosed:  # paths follow the rest
                sent = self._exit_fraction * fluence + unscattered
                return entering + returned(sent / np.maximum(self.scattered, LEAST_ON_PATHS))
            # Light that nothing scatters or absorbs on its way through falls on other parts, too; rays see it alone.
            return entering + returned(leaving(fluence, flux) + self.through * flux)

        flux, given, steps = entering, source(entering), 0
        near = self._cells.even(given)
        before, last = np.zeros_like(entering), min(TOLERANCE / part, FIRST)
        tolerance = last
        if returned is not None:
            flux, tolerance = received(at_surface(near, entering), entering), FIRST
            given = source(flux)
        for _ in range(MOST_BOUNCES):
            near, taken = self._cells.solved(given, None if warm_starts else near, tolerance)
            steps += taken
            fluence = at_surface(near, flux)
            change = received(fluence, flux) - flux
            # Fraction of the last change that returns now. In a hollow it is nearly all, and always the same: so much
            # is still to come.
            again = float((change * before).sum()) / max(float((before**2).sum()), _TINY)
            again = min(max(again, 0.0), MOST_RETURNED)
            flux = np.maximum(flux + change / (1.0 - again), 0.0)
            most = np.abs(flux + straight.first.flux).max(initial=0.0)
            largest = np.abs(change).max(initial=0.0)
            if tolerance == last and largest <= min(ENOUGH / part, MOST_MISSED) * (1.0 - again) * most:
                break
            tolerance = min(max(OF_CHANGE * largest / max(most, _TINY), last), FIRST)
            before = change if again == 0.0 else np.zeros_like(entering)
            given = source(flux)
        # Emitted light leaves at each angle as what is scattered of uniform light does: with as much that enters.
        even = emitted / np.maximum(self._uniform[1], _TINY) if part == 1.0 and emission > 0.0 else 0.0
        return (
            fluence,
            flux + straight.first.flux + even,
            leaving(fluence, flux),
            np.maximum(near, 0.0) + emitted_inside,
            steps,
        )


@dataclass(frozen=True, eq=False)
class _InclusionLosses:
    """Light at opaque inclusions in one color channel: a part of it is reflected into the body, the rest is lost.

    A surface that reflects a part a diffusely, and receives J of diffuse light and R that nothing has scattered, takes
    the flux F = (1 - a) J - a R of the diffuse light. With J = phi / 4 + F / 2 so is J = (phi / 2 - a R) / (1 + a) and
    F = ((1 - a) phi / 2 - 2 a R) / (1 + a).

    Attributes
    ----------
    read : (i, cells) csr_array
    attenuated : (i,) float64
        Fluence at the surface over that where it is read.
    lost : (i,) float64
        See `CellSystem`.
    reflected : (i,) float64
    area : float
        Around each sample, in m^2.
    """

    read: sparse.csr_array
    attenuated: Array
    lost: Array
    reflected: Array
    area: float

    @classmethod
    def of(cls, grid: BodyGrid, absorption: float, d: float, reflected: Array) -> _InclusionLosses:
        """Inclusion losses of a grid."""
        if (inner := grid.inclusions) is None:
            return cls(sparse.csr_array((0, grid.count)), np.zeros(0), np.zeros(0), np.zeros(0), 1.0)
        condition = (1.0 - reflected) / (2.0 * (1.0 + reflected)) / d
        layer = LayerSolution.of(inner.depth, float(np.sqrt(absorption / d)), condition, inner.spread)
        lost = inner.area * d * layer.conductance
        return cls(inner.read, layer.at_surface, lost, reflected, inner.area)

    def diffuse(self, cells: Array, reaching: Array) -> Array:
        """(i,): irradiance by diffuse light, for a fluence (cells,) and a power (i,) that comes unscattered."""
        found = 0.5 * (self.read @ cells) * self.attenuated - self.reflected * reaching / self.area
        return np.asarray(np.maximum(found, 0.0) / (1.0 + self.reflected))

    def reaching(self, grid: BodyGrid, paths: EntryPaths, flux: Array) -> Array:
        """(i,): power in W that comes unscattered, for a flux (k,) of paths that reach inclusions."""
        hit = np.isfinite(paths.limit)
        power = grid.areas[paths.samples[hit]] * flux[hit]
        return np.asarray(np.bincount(paths.inclusion[hit], power, len(self.lost)), np.float64)

    def sent(self, reaching: Array) -> Array:
        """(cells,): power that is reflected into the cells."""
        sent = 2.0 * self.reflected / (1.0 + self.reflected) * reaching
        return np.asarray(self.read.T @ (self.attenuated * sent))
