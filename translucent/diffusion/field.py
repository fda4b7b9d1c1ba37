"""Subsurface light of a body by diffusion, as pictures look it up: two volumes for each of six sides of its surface."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.diffusion.entering import (
    Pose,
    dimming_bodies,
    environment_parts,
    from_light,
    light_passed,
    nearest_parts,
    radiance_without_suns,
    rays_of_photons,
    sky_light,
    suns_of,
)
from translucent.diffusion.entering_rays import EnteringRays, joined_rays, two_of_many
from translucent.diffusion.environment_ahead import EnvironmentAhead
from translucent.diffusion.exchange import Exchange, Patches, direct_irradiance
from translucent.diffusion.grid import BodyGrid
from translucent.diffusion.interfaces import BodyInterface
from translucent.diffusion.irradiance_maps import EnclosedPaths, PathExchange
from translucent.diffusion.keys import dimming_key, environment_key, kept, light_key, may_dim
from translucent.diffusion.lit_body import LitBody
from translucent.diffusion.photons import EnteringPhotons
from translucent.diffusion.sides import GridPlacement, beside
from translucent.diffusion.solution import LEAST_ON_PATHS, BodySystem, DiffuseSolution
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface, exit_quadrature
from translucent.formulas.diffusion import (
    LEAST_COSINE,
    SAMPLE_REACH,
    UNIFORM_COSINE,
    emergent_radiance,
    first_events_excess,
    in_scattered_shares,
    last_event_fraction,
    mean_first_events_excess,
)
from translucent.formulas.phase import PhaseFunction
from translucent.geometry.ray_caster import RayCaster
from translucent.media.medium import Medium
from translucent.scene.lights import DirectionalLight, PositionalLight, by_spheres
from translucent.scene.scene import Light, Object, Scene

#: Values in cells: (6, x, y, z, 3) for each side of a surface, or (2 x, 3 y, z, 3) beside each other.
Volume = npt.NDArray[np.float32]

#: Mean cosine of scattering, at least, of media without an interface whose light is seen by the angle that it turns by
#: at first events. Behind an interface light enters and leaves in a cone, and that angle is about the same for all.
DIRECTED = 0.05

#: Mean flux on a body from others, as a fraction of what the brightest sends out, below which it is left out; and the
#: largest number of rounds of light between bodies.
ENOUGH, MOST_ROUNDS = 5e-3, 8

#: Largest `part` of light that is added to other light: with 1, `BodySystem.solved` would count emission again.
MOST_PART = 0.99

#: Fraction of a cell that is inside from which all of it is.
_WHOLE = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class DiffusionField:
    """Light of a body at its surface, on a grid of cells that turns with the body.

    Attributes
    ----------
    fluence, entering : (6, x, y, z, 3) float32
        Of scattered light below the surface; and flux that enters there times the albedo; for each side, see
        `SurfaceSides`.
    cosine : (6, x, y, z, 1) float32
        Mean cosine of that light, inside.
    travel : (6, x, y, z, 3) float32, optional
        Mean direction of that light, inside, along the axes of the grid, plus 1; None where it does not matter, see
        `DIRECTED`.
    scattered : (6, x, y, z, 3) float32
        Fraction of the paths through the body, from its surface, on which light is scattered; 1 deep inside.
    inclusions : (x, y, z, 3) float32, optional
        Irradiance on opaque objects inside, spread beyond their surfaces.
    placement : GridPlacement
    albedo : (3,) float64
        Of single scattering after similarity: sigma_s' / (sigma_a + sigma_s').
    phase : PhaseFunction
    conductance, exit_share : float
        Of the interface; see `DiffuseInterface`.
    exits : (3,), (3,) float64
        See `exit_quadrature`; weights are larger where a rough interface lets more through.
    leaving : (s, 3) float64
        Flux that leaves the samples of the surface; see `DiffuseSolution`.
    steps : int
        Iterations of the solver.
    cells : int
        In the system.
    ior : float
        Of the medium.
    ahead : (3,) float64
        Fraction of its extinction by light that is scattered ahead, g sigma_s / sigma_t: unscattered light here.
    in_scattered : tuple of two (3,) float64
        See `in_scattered_shares`.
    behind : EnvironmentAhead, optional
        What forward scattering leaves of the environment, in the direction in which a ray leaves the body.
    """

    fluence: Volume
    entering: Volume
    cosine: Volume
    travel: Volume | None
    scattered: Volume
    inclusions: Volume | None
    placement: GridPlacement
    albedo: Array
    phase: PhaseFunction
    conductance: float
    exit_share: float
    exits: tuple[Array, Array]
    leaving: Array
    steps: int
    cells: int
    ior: float
    ahead: Array
    in_scattered: tuple[Array, Array]
    behind: EnvironmentAhead | None = None

    @cached_property
    def volumes(self) -> tuple[Volume, ...]:
        """Arrays (2 x, 3 y, z, 3) that pictures look up: along paths on which all light is scattered.

        Sides are beside each other: outwards and inwards along each axis in two columns, the axes in three rows. Then
        come `travel`, `inclusions` and `behind`, if there are any.
        """
        with np.errstate(under="ignore"):
            sides = [beside(self.fluence / self.scattered), beside(self._scattered_entering)]
        if self.travel is not None:
            sides.append(beside(self.travel))
        if self.inclusions is not None:
            sides.append(self.inclusions)
        return (*sides,) if self.behind is None else (*sides, self.behind.radiance)

    def radiance(self, points: Array, normals: Array, cosine: Array) -> Array:
        """(k, 3): basic radiance L / n^2 below points of the surface, towards it: the mean over paths through the body.

        Parameters
        ----------
        points, normals : (k, 3) float64
            In metres; normals outwards.
        cosine : (k,) float64
            Of the directions there, inside.
        """
        volumes = self.fluence, np.concatenate([self.entering, self.cosine], axis=-1)
        fluence, entering = (self.at_surface(volume, points, normals) for volume in volumes)
        return self._emergent(fluence, entering, cosine)

    def above_last_events(
        self, points: Array, normals: Array, directions: Array, path: Array, optical_depth: Array
    ) -> Array:
        """(k, 3): points of the surface above the places where light was scattered last that leaves at `points` (k, 3).

        As entering light is first scattered beside where it enters (`LateralShift`), paths being the same in both
        directions. The twin of ``above_last_event`` in ``shaders/shade/diffused_light.glsl``.

        Parameters
        ----------
        points, normals, directions : (k, 3) float64
            Of the surface; and of rays from there into the body.
        path : (k,) float64
            Of the rays through the body, in metres.
        optical_depth : (k, 3) float64
            Of these.
        """
        depth = ((1.0 - self.ahead) * optical_depth).mean(axis=1)
        level = directions - np.einsum("ki,ki->k", directions, normals)[:, None] * normals
        along = level * (path * last_event_fraction(depth))[:, None]
        most = SAMPLE_REACH * self.placement.step
        return np.asarray(points + along * (most / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), most)))

    def scattered_radiance(self, points: Array, normals: Array, directions: Array, cosine: Array) -> Array:
        """`radiance` as if all light was scattered on the path through the body: the twin of ``diffused_light.glsl``.

        Its file is in ``shaders/shade``. Along a real path the fraction counts that is scattered there. It is seen
        against rays in directions (k, 3).
        """
        with np.errstate(under="ignore"):
            volumes = self.fluence / self.scattered, self._scattered_entering
        fluence, entering = (self.at_surface(volume, points, normals) for volume in volumes)
        if self.travel is None:
            return self._emergent(fluence, entering, cosine)
        travel = self.at_surface(self.travel, points, normals) - 1.0
        # What comes through the body and goes on ahead is found by renderers: see `scattered_ahead`.
        outwards = np.maximum((travel * (normals @ self.placement.turn)).sum(axis=1), 0.0)
        lit = 1.0 - np.minimum(outwards / np.maximum(cosine, LEAST_COSINE), 1.0)[:, None]
        return self._emergent(fluence, entering, cosine, travel, directions @ self.placement.turn, lit)

    def irradiance_entering(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance across its direction of light that enters at points (k, 3) with normals (k, 3)."""
        entering = self.at_surface(self._scattered_entering, points, normals)
        albedo = np.maximum(self.albedo, np.finfo(np.float32).tiny)
        return np.asarray(entering[:, :3] / (np.clip(entering[:, 3:], LEAST_COSINE, 1.0) * albedo))

    @property
    def _scattered_entering(self) -> Volume:
        """(6, x, y, z, 4): `entering` along paths on which all light is scattered, and `cosine`."""
        return np.concatenate([self.entering / self.scattered, self.cosine], axis=-1)

    def at_surface(self, volume: Volume, points: Array, normals: Array) -> Array:
        """(k, n): values (6, x, y, z, n) of cells at points (k, 3) of the surface with normals (k, 3)."""
        return self.placement.read(volume, points, normals)

    def _emergent(
        self,
        fluence: Array,
        entering: Array,
        cosine: Array,
        travel: Array | None = None,
        directions: Array | None = None,
        lit: Array | float = 1.0,
    ) -> Array:
        """Radiance against rays at cosines (k,), and in directions (k, 3) in the grid where light has one (k, 3).

        `lit` (k, 1) is the fraction of first events that count with their angle.
        """
        mean = np.clip(entering[:, 3:], LEAST_COSINE, 1.0)

        def light(mu: npt.ArrayLike) -> Array:
            return emergent_radiance(fluence, entering[:, :3], self.albedo, self.conductance, mean, mu)

        with np.errstate(under="ignore"):
            flux = np.sum([weight * light(mu) for mu, weight in zip(*self.exits, strict=True)], axis=0)
            found = light(cosine[:, None])
            if travel is not None and directions is not None:
                together = np.linalg.norm(travel, axis=1)
                # Light from several directions is scattered as by a phase function with smaller moments: even light,
                # whose mean direction is 2 / 3 long, as by one without any.
                phase = np.tile(self.phase.parameters, (len(travel), 1))
                phase[:, :2] *= np.clip(3.0 * together - 2.0, 0.0, 1.0)[:, None]
                scale = 1.0 / (self.albedo + (1.0 - self.albedo) * (1.0 - self.phase.mean_cosine))
                turned = -(travel * directions).sum(axis=1) / np.maximum(together, np.finfo(np.float64).tiny)
                once = lit * entering[:, :3]
                found = found + once / (cosine[:, None] + mean) * first_events_excess(phase, scale, turned[:, None])
                for mu, weight in zip(*self.exits, strict=True):
                    excess = mean_first_events_excess(phase, scale, mean, mu)
                    flux = flux + weight * once / (mu + mean) * excess
            scaled = found * self.exit_share * fluence / np.maximum(flux, 1e-30)
            return np.asarray(scaled / (4.0 * np.pi * self.ior**2))


class DiffusingBody:
    """Solver of the subsurface light of one body and medium, for any lights.

    Attributes
    ----------
    lit : LitBody

    Parameters
    ----------
    lit : LitBody
    medium : Medium
    roughness : float
        Of its surface.
    system : BodySystem, optional
        Of its shape, medium and roughness, where it is known.
    corrected, warm_starts : bool
        See `BodySystem`.
    """

    #: Photons carry the light of suns, too.
    enclosed = False

    @np.errstate(under="ignore")
    def __init__(
        self,
        lit: LitBody,
        medium: Medium,
        roughness: float,
        system: BodySystem | None = None,
        *,
        corrected: bool = True,
        warm_starts: bool = False,
    ) -> None:
        self.lit, self._medium, self._roughness = lit, medium, roughness
        self._interface = diffuse_interface(medium.ior, roughness)
        self._system = system or BodySystem(
            lit.grid,
            medium,
            roughness,
            lit.shape.densities,
            walls=lit.shape.walls,
            corrected=corrected,
            warm_starts=warm_starts,
        )

    @cached_property
    def _exchange(self) -> Exchange | PathExchange:
        """Light of the body, and of others, that falls on it."""
        return self.lit.exchange(self._medium.ior, self._roughness)

    @np.errstate(under="ignore")
    def field(
        self, scene: Scene, body: int, photons: EnteringPhotons | None = None, stops: RayCaster | None = None
    ) -> DiffusionField:
        """Subsurface light of the body in a scene; see `solved`."""
        return self.field_of(self.solved(scene, body, photons, stops))

    @np.errstate(under="ignore")
    def field_of(self, found: DiffuseSolution) -> DiffusionField:
        """Subsurface light of a solution."""
        return _field(self.lit, self._medium, self._system.interface, found)

    @np.errstate(under="ignore")
    def solved(
        self, scene: Scene, body: int, photons: EnteringPhotons | None = None, stops: RayCaster | None = None
    ) -> DiffuseSolution:
        """Light of the body in a scene, for its environment and lights; `body` is its number.

        `photons` carry the light that other bodies, whose surfaces are `stops`, refract and reflect; none of it goes
        straight through these.
        """
        dimming, grid, pose = dimming_bodies(scene, body), self.lit.grid, self.lit.pose
        through = (self._medium.ior, self._roughness, tuple(map(dimming_key, dimming)), stops)
        suns = suns_of(scene.environment)

        def rays_of(lights: Sequence[Light], stops: RayCaster | None) -> tuple[Array, EnteringRays]:
            casters, ior, interface = self.lit.casters, self._medium.ior, self._interface
            found = [from_light(grid, casters, light, ior, interface, dimming, stops) for light in lights]
            together = joined_rays(found, from_one=True)
            return np.zeros((0, 3)), two_of_many(together, grid.face_normals) if len(lights) > 2 else together

        arriving, most = self.lit.arriving, 1 + len(scene.lights) + len(suns)
        around = environment_key(scene.environment), through, self._sky_key(scene)
        entering, bright = kept(arriving, around, partial(self._light_around, scene, dimming), most)
        rays, inside = [bright], np.zeros((grid.count, 3))
        outside = list[Light]()
        for light in scene.lights:
            if isinstance(light, PositionalLight) and (cell := _cell_at(grid, pose, light.position)) >= 0:
                inside[cell] += 4.0 * np.pi * light.mean_share * np.asarray(light.intensity)
            else:
                outside.append(light)
        for lights in by_spheres(outside):
            key = *map(light_key, lights), through
            rays.append(kept(arriving, key, partial(rays_of, lights, stops), most)[1])
        for sun in suns:
            past = stops if self.enclosed else None  # photons carry none of its light
            rays.append(kept(arriving, ("sun", light_key(sun), through), partial(rays_of, [sun], past), most)[1])
        if photons is not None:
            rays.append(rays_of_photons(photons, grid, pose))
        entering = entering + self._from_patches(scene, body, suns)
        returned = self._exchange.returned if self._exchange.any else None
        return self._system.solved(entering, returned, inside, rays)

    def from_others(self, others: Sequence[DiffuseSolution | None]) -> Array:
        """(s, 3): flux that enters from `lit.others`, each with its light or none."""
        sent = [
            np.zeros((2, body.surface.count, 3)) if one is None else np.stack([one.leaving, one.passing])
            for one, body in zip(others, self.lit.others, strict=True)
        ]
        return self._exchange.from_others(*np.concatenate(sent, axis=1))

    @np.errstate(under="ignore")
    def lit_by(self, entering: Array, part: float) -> DiffuseSolution:
        """Light of the body by a flux (s, 3) that enters, which is a fraction `part` of all light."""
        returned, inside = self._exchange.returned if self._exchange.any else None, np.zeros((self.lit.grid.count, 3))
        return self._system.solved(entering, returned, inside, part=part)

    def _irradiance(self, patches: Patches, scene: Scene, body: int, suns: Sequence[DirectionalLight]) -> Array:
        """(p, 3): light of lights and environment on patches of opaque surfaces, as far as the body lets it through."""
        surfaces, own = self.lit.casters.opaque, scene.objects[body]
        assert surfaces is not None
        passing = [*dimming_bodies(scene, body), *([own] if may_dim(own) else [])]
        passed = partial(light_passed, passing)
        straight = direct_irradiance(patches.points, patches.normals, (*scene.lights, *suns), surfaces.caster, passed)
        return straight + patches.from_sky(partial(radiance_without_suns, scene.environment))

    def _from_patches(self, scene: Scene, body: int, suns: Sequence[DirectionalLight]) -> Array | float:
        """(s, 3): flux that enters from opaque surfaces."""
        if not isinstance(self._exchange, Exchange) or (patches := self.lit.patches) is None:
            return 0.0
        radiosity = patches.radiosity(self._irradiance(patches, scene, body, suns))
        return self._exchange.received(radiosity)

    def _sky_key(self, scene: Scene) -> Hashable:
        """All that `_light_around` depends on beside the environment and the bodies on its path."""
        return ()

    def _light_around(self, scene: Scene, others: list[Object]) -> tuple[Array, EnteringRays]:
        """Light of the environment that enters, less what other bodies on its path absorb."""
        directions, turn = self.lit.shape.sky.directions, self.lit.pose.turn
        return self._from_sky(environment_parts(scene.environment, directions, turn, suns=False), others)

    def _from_sky(self, parts: Array, others: list[Object]) -> tuple[Array, EnteringRays]:
        """Flux (s, 3) that enters from radiance over solid angles (k, 3), less what other bodies on its path absorb.

        Parts of the sky that are brighter than the rest are returned as rays. Light that others scatter continues
        elsewhere, and as much comes from there: in uniform light it is not missing.
        """
        if not parts.any():
            return np.zeros((len(self.lit.grid.points), 3)), joined_rays([])
        sky, ior = self.lit.shape.sky, self._medium.ior
        received = self.lit.entrance(ior, self._roughness).received[None]
        means = parts / nearest_parts(sky.directions)[1][:, None]
        absorbing = [body for body in others if body.medium is not None and np.any(body.medium.absorption)]
        if absorbing:
            received = np.repeat(received, 3, axis=0)
        for body, paths in zip(absorbing, self.lit.sky_paths(absorbing), strict=True):
            assert body.medium is not None
            sample, direction = paths.nonzero()
            received[:, sample, direction] *= optics.transmittance(
                np.multiply.outer(body.medium.absorption, paths.data)
            )
        mirrored = (1.0 - diffuse_interface(ior).entering) / self._interface.entering
        return sky_light(sky, received, means, self.lit.grid.normals, ior, mirrored)


class EnclosedBody(DiffusingBody):
    """Solver of a body that is inside clear ones: light comes to it, and from it back to it, through their interfaces.

    Parameters
    ----------
    paths : EnclosedPaths
        Of the light on the body.
    lit, medium, roughness, system
        As of `DiffusingBody`.
    """

    enclosed = True

    def __init__(
        self, paths: EnclosedPaths, lit: LitBody, medium: Medium, roughness: float, system: BodySystem
    ) -> None:
        super().__init__(lit, medium, roughness, system)
        self._paths = paths

    @cached_property
    def _exchange(self) -> Exchange | PathExchange:
        return self._paths.exchange

    def _sky_key(self, scene: Scene) -> Hashable:
        return self._paths, tuple(map(light_key, scene.lights)) if self._paths.meets_opaque else ()

    def _light_around(self, scene: Scene, others: list[Object]) -> tuple[Array, EnteringRays]:
        return self._paths.light(scene)


def _cell_at(grid: BodyGrid, pose: Pose, position: npt.ArrayLike) -> int:
    """Number of the cell at a position, -1 outside the body; in cells that are cut, the nearest sample decides."""
    point = pose.inwards(np.asarray(position) - pose.shift)
    place = np.floor((point - grid.cells.low) / grid.cells.step).astype(int)
    if (place < 0).any() or (place >= grid.number.shape).any():
        return -1
    if grid.cells.inside[tuple(place)] < _WHOLE:
        nearest = int(((grid.points - point) ** 2).sum(axis=1).argmin())
        if (point - grid.points[nearest]) @ grid.face_normals[nearest] > 0.0:
            return -1
    return int(grid.number[tuple(place)])


def _field(lit: LitBody, medium: Medium, interface: BodyInterface, found: DiffuseSolution) -> DiffusionField:
    grid, extinction = lit.grid, medium.extinction
    reduced = np.asarray(medium.scattering) * (1.0 - medium.anisotropy)
    total = reduced + np.asarray(medium.absorption)
    albedo = np.where(total > 0.0, reduced / np.where(total > 0.0, total, 1.0), 0.0)
    polished, brightness = diffuse_interface(interface.ior), np.reshape(interface.brightness, (-1, 1))
    scattered = np.maximum(found.scattered, LEAST_ON_PATHS)
    directed = interface.ior == 1.0 and abs(medium.anisotropy) >= DIRECTED
    parts: list[tuple[Array, Array | float]] = [
        (brightness * found.fluence, found.inside),
        (brightness * albedo * found.entering, 0.0),
        (found.cosine[:, None], UNIFORM_COSINE),
        (scattered, 1.0),
    ]
    # Of signs of their own, and no part of a grid is negative.
    parts += [(1.0 + found.travel, 1.0)] if directed else []
    fluence, entering, cosine, on_paths, *travel = lit.shape.sides.volumes(parts)
    on_paths[on_paths == 0.0] = 1.0
    inclusions = None if grid.inclusions is None else lit.shape.on_inclusions(found.at_inclusions)
    # Light leaves as through a polished interface, and more of it through a rough one.
    cosines, weights = exit_quadrature(interface.ior)
    ahead = np.asarray(medium.scattering) * max(medium.anisotropy, 0.0)
    # Of diffuse light, four times the volume over the area.
    chord = 2.0 * lit.casters.body.mean_thickness * float(np.average(lit.shape.densities.cells, weights=grid.volumes))
    return DiffusionField(
        fluence=fluence,
        entering=entering,
        cosine=cosine,
        inclusions=inclusions,
        travel=travel[0] if directed else None,
        scattered=on_paths,
        placement=GridPlacement.of(grid.cells, lit.pose),
        albedo=albedo,
        phase=medium.phase_function,
        conductance=interface.main.conductance,
        exit_share=interface.main.exit_share,
        exits=(cosines, interface.main.entering / polished.entering * weights),
        leaving=found.leaving,
        steps=found.steps,
        cells=grid.count,
        ior=medium.ior,
        ahead=ahead / np.where(extinction > 0.0, extinction, 1.0),
        in_scattered=in_scattered_shares(
            polished.reflected, optics.transmittance(np.asarray(medium.absorption) * chord)
        ),
    )


@np.errstate(under="ignore")
def lit_by_each_other(
    bodies: Mapping[int, DiffusingBody], others: Mapping[int, Sequence[int]], found: Mapping[int, DiffuseSolution]
) -> dict[int, DiffuseSolution]:
    """Solutions of bodies, by number, that light each other.

    `found` are solutions for all other light, and `others` the bodies that each body sees. Light goes from body to body
    in rounds (radiosity, Goral et al. 1984). All rounds together are a sum of the first ones, with a weight for each
    round, body and color channel: those that leave the least flux unaccounted for (minimal residuals, Saad and Schultz
    1986). Further rounds are solved until next to nothing is left on each body.
    """
    total, places, count = dict(found), dict[int, slice](), 0
    for i, body in bodies.items():
        if others[i]:
            places[i] = slice(count, count := count + len(body.lit.grid.points))
    if not places:
        return total
    from scipy.optimize import nnls  # slow to import, and for several bodies only

    whole = max(float(one.leaving.mean()) for one in found.values())

    def received(last: Mapping[int, DiffuseSolution]) -> Array:
        """(s, 3): flux on the samples of all bodies that see others, by the light of some."""
        flux = np.zeros((count, 3))
        for i, place in places.items():
            if last.keys() & set(others[i]):
                flux[place] = bodies[i].from_others([last.get(k) for k in others[i]])
        return flux

    def lit(flux: Array) -> list[int]:
        """Bodies on which a flux (s, 3) is more than next to nothing."""
        return [i for i, place in places.items() if np.abs(flux[place]).mean() > ENOUGH * whole]

    first = flux = received(found)
    answers, missing, weights = list[tuple[int, DiffuseSolution]](), list[Array](), np.zeros((0, 3))
    for _ in range(MOST_ROUNDS):
        if not (bright := lit(flux)):
            break
        following = np.zeros_like(flux)
        for i in bright:
            own = np.zeros_like(flux)
            own[places[i]] = flux[places[i]]
            answers.append((i, bodies[i].lit_by(own[places[i]], min(float(own[places[i]].mean()) / whole, MOST_PART))))
            sent = received(dict(answers[-1:]))
            missing.append(own - sent)
            following += sent
        columns = np.stack(missing, axis=-1)
        # Light adds to light: no weight is negative.
        weights = np.stack([nnls(columns[:, c], first[:, c])[0] for c in range(3)], axis=1)
        if not lit(first - np.einsum("scr,rc->sc", columns, weights)):
            break
        flux = following
    for (i, more), weight in zip(answers, weights, strict=True):
        total[i] = total[i].plus(more.times(weight))
    return total
