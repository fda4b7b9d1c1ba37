"""Light that interfaces refract and reflect onto opaque objects, and into bodies that are inside clear ones.

Random paths from samples of each object's surface gather it: they end at the environment, or at opaque objects, which
light each other in a few rounds. Pictures look it up in a volume around the object, by the normal. Paths from samples
of a body in which light diffuses come to such bodies, too: back to itself where a clear body around it reflects light.

References
----------
Goral, Torrance, Greenberg & Battaile 1984, "Modeling the interaction of light between diffuse surfaces"; Greger,
Shirley, Hubbard & Greenberg 1998, "The irradiance volume".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt
from scipy import sparse

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.entering import (
    Pose,
    dimming_bodies,
    light_passed,
    opaque_surfaces,
    radiance_without_suns,
    windings_at,
)
from translucent.diffusion.entering_rays import EnteringRays, two_of_many
from translucent.diffusion.exchange import (
    ROUNDS,
    GroundPoints,
    OpaqueSurfaces,
    cosine_directions,
    direct_irradiance,
    hemispheres,
)
from translucent.diffusion.grid import BodyGrid, body_grid, nearest_samples
from translucent.diffusion.lit_body import LitBody, own_frame
from translucent.diffusion.photons import BATCH, MOST_SURFACES, Photons, PhotonSegments, PhotonSegmentTracer, joined
from translucent.diffusion.sides import GridPlacement, SurfaceSides, beside
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.formulas.interface import refracted_direction
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.scene import Object, Scene

#: Samples on each object, of all together, and paths from each: the fit of the volume takes the mean of about 16.
SAMPLES, MOST_SAMPLES, RAYS = 2048, 6144, 48

#: Start of paths above the surface, as a fraction of a cell.
_ABOVE = 1e-4


@dataclass(frozen=True, eq=False)
class IrradianceMap:
    """Irradiance on an opaque object without the straight light of lights.

    Attributes
    ----------
    lit : bool
        It is inside bodies, and photons have carried the light of all lights there.
    values : (6, x, y, z, 3) float32
        For each side, see `SurfaceSides`; as basic radiance, E / n^2 in a medium of index n.
    placement : GridPlacement
    """

    lit: bool
    values: Floats
    placement: GridPlacement

    @property
    def volumes(self) -> tuple[Floats]:
        """Array (2 x, 3 y, z, 3) that pictures look up, with the sides beside each other."""
        return (beside(self.values),)

    def holds(self, points: Array) -> npt.NDArray[np.bool_]:
        """(k,): whether points (k, 3) of the world are in the volume."""
        place = self.placement.places(points)
        return np.asarray(((place >= 0.0) & (place <= self.values.shape[1:4])).all(axis=1))

    def at(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance at points (k, 3) of the surface with normals (k, 3)."""
        return self.placement.read(self.values, points, normals)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples of an opaque object: its grid, its pose, and the numbers of the samples among those of all objects."""

    grid: BodyGrid
    pose: Pose
    numbers: Integers

    @property
    def points(self) -> Array:
        return self.pose.outwards(self.grid.points) + self.pose.shift

    @property
    def normals(self) -> Array:
        return self.pose.outwards(self.grid.face_normals)

    def nearest(self, places: Array, towards: Array) -> Integers:
        """(k,): index among these of the nearest one to places (k, 3) that look `towards` (k, 3)."""
        return nearest_samples(self.points, self.normals, self.grid.area, places, towards)

    def map(self, irradiance: Array, *, lit: bool) -> IrradianceMap:
        (values,) = SurfaceSides.of(self.grid).volumes([(irradiance[self.numbers], 0.0)])
        return IrradianceMap(lit, values, GridPlacement.of(self.grid.cells, self.pose))


def irradiance_maps(scene: Scene, objects: Sequence[int], photons: int = 0) -> dict[int, IrradianceMap]:
    """Irradiance on closed opaque objects, by their numbers.

    Parameters
    ----------
    scene : Scene
    objects : sequence of int
    photons : int
        Number of photons that carry the light of lights to objects inside bodies. With 0, it comes straight.
    """
    samples = _samples(scene, objects, min(SAMPLES, MOST_SAMPLES // len(objects)))
    gathering = _Gathering(scene, samples)
    lit = gathering.enclosed if photons else set()
    irradiance = gathering.irradiance(lit, photons)
    return {i: own.map(irradiance, lit=i in lit) for i, own in samples.items()}


def _samples(scene: Scene, objects: Sequence[int], count: int) -> dict[int, _Samples]:
    """Samples on closed objects, by their numbers, and about `count` on each."""
    found: dict[int, _Samples] = {}
    first = 0
    for i in objects:
        own = own_frame(scene.objects[i])
        corners = own.world_vertices[own.mesh.faces]
        sides = corners[:, 1:] - corners[:, :1]
        area = 0.5 * float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())
        grid = body_grid(own, np.sqrt(3.0 * area / count))
        found[i] = _Samples(grid, Pose.of(scene.objects[i].matrix)[0], first + np.arange(len(grid.points)))
        first += len(grid.points)
    return found


class _Gathering:
    """Paths from all samples, and the light that they find."""

    def __init__(self, scene: Scene, samples: dict[int, _Samples]) -> None:
        self.scene, self.samples = scene, samples
        self.count = sum(len(own.numbers) for own in samples.values())
        self.tracer = PhotonSegmentTracer(scene, np.random.default_rng(0))
        self.surfaces = OpaqueSurfaces(scene.opaque)
        self.dimming = dimming_bodies(scene, -1)
        self.points = np.concatenate([own.points for own in samples.values()])
        self.normals = np.concatenate([own.normals for own in samples.values()])
        steps = [np.full(len(own.numbers), own.grid.cells.step) for own in samples.values()]
        self.starts = self.points + _ABOVE * np.concatenate(steps)[:, None] * self.normals
        #: Index of each object of the scene among the opaque ones with faces.
        numbers = {id(item): k for k, item in enumerate(self.surfaces.objects)}
        self.opaque = np.array([numbers.get(id(item), -1) for item in scene.objects])
        self.inside = windings_at(scene, self.starts, self.normals)
        self.first: Array = np.zeros((self.count, 3))
        #: Sample that receives light, sample that sends it, and the fraction that arrives.
        self.links: list[tuple[Integers, Integers, Array]] = []

    @property
    def enclosed(self) -> set[int]:
        """Objects that are all inside bodies."""
        within = np.asarray(self.inside.any(axis=1))
        return {i for i, own in self.samples.items() if within[own.numbers].all()}

    def irradiance(self, lit: set[int], photons: int) -> Array:
        """(s, 3): irradiance at the samples; on objects `lit` with that of lights, by photons."""
        self._trace()
        direct = self._direct(self.points, self.normals)
        bent = self._by_photons(lit, photons) if lit else np.zeros((self.count, 3))
        for i in lit:
            direct[self.samples[i].numbers] = bent[self.samples[i].numbers]
        receiver, sender, fraction = (np.concatenate(part) for part in zip(*self.links, strict=True))
        found = self.first.copy()
        for channel in range(3):
            exchange = sparse.csr_array((fraction[:, channel], (receiver, sender)), (self.count, self.count))
            for _ in range(ROUNDS):
                found[:, channel] = self.first[:, channel] + exchange @ (found[:, channel] + direct[:, channel])
        return found + bent

    def _by_photons(self, lit: set[int], photons: int) -> Array:
        """(s, 3): irradiance by photons that interfaces have refracted or reflected, on objects `lit`."""
        power = np.zeros((self.count, 3))
        for step in self.tracer.steps(photons):
            landed = step.landed.where(step.landed.bent)
            item, face = self.tracer.surfaces_of(landed)
            normals = self.surfaces.normals(self.surfaces.first[self.opaque[item]] + face)
            # In a medium of index n, power is of the irradiance, and n^2 times as much as of E / n^2.
            arriving = landed.power / self.tracer.iors_around(landed)[:, None] ** 2
            for i in lit.intersection(item.tolist()):
                own, here = self.samples[i], np.flatnonzero(item == i)
                sample = own.numbers[own.nearest(landed.origins[here], normals[here])]
                for channel in range(3):
                    power[:, channel] += np.bincount(sample, arriving[here, channel], self.count)
        areas = np.concatenate([own.grid.areas for own in self.samples.values()])
        return np.asarray(power / areas[:, None])

    def _trace(self) -> None:
        tracer = self.tracer
        none = np.zeros(0, np.int64)
        self.links.append((none, none, np.zeros((0, 3))))
        for part in np.array_split(np.arange(self.count), self.count * RAYS // BATCH + 1):
            own, directions = hemispheres(self.normals[part], RAYS)
            owner = part[own]
            whole = np.full((len(owner), 3), 1.0 / RAYS)
            going = tracer.begun_at(self.starts[owner], directions, whole, self.inside[owner])
            for _ in range(MOST_SURFACES):
                if not len(going.number):
                    break
                step = tracer.step(going)
                left = step.left
                self._add(owner[left.number], left.power * np.pi * self.scene.environment.lighting(left.directions))
                going = joined((step.going, self._land(owner, step.landed, *tracer.surfaces_of(step.landed))))

    def _add(self, owner: Integers, light: Array) -> None:
        for channel in range(3):
            self.first[:, channel] += np.bincount(owner, light[:, channel], self.count)

    def _land(self, owner: Integers, landed: Photons, item: Integers, face: Integers) -> Photons:
        """Link the samples of paths to those where they have landed; on other objects, paths go on, diffusely."""
        surfaces, points = self.surfaces, landed.origins
        number = surfaces.first[self.opaque[item]] + face
        reflected, emitted = surfaces.light(number, points)
        normals = surfaces.normals(number)
        normals = np.where((normals * landed.directions).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        self._add(owner[landed.number], landed.power * np.pi * emitted)
        fraction = landed.power * reflected
        known = np.isin(item, list(self.samples))
        for i in np.unique(item[known]):
            own, here = self.samples[i], np.flatnonzero(item == i)
            sender = own.nearest(points[here], normals[here])
            self.links.append((owner[landed.number[here]], own.numbers[sender], fraction[here]))
        other = np.flatnonzero(~known)
        if other.size and self.scene.lights:
            self._add(owner[landed.number[other]], fraction[other] * self._direct(points[other], normals[other]))
        further = landed.where(other)
        further.power = fraction[other]
        further.directions = cosine_directions(normals[other], *self.tracer.rng.random((2, other.size)))
        return further

    def _direct(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance of lights at points (k, 3) of opaque surfaces, straight through media."""

        def passed(starts: Array, directions: Array, distance: Array) -> Array:
            return light_passed(self.dimming, starts, directions, distance)

        return direct_irradiance(points, normals, self.scene.lights, self.surfaces.caster, passed)


#: Samples on surfaces of clear bodies that emit, in all, paths from each, and classes of angles with the normal.
EMITTERS, EMITTED_RAYS, ANGLES = 1024, 16, 8

#: Start of paths into a body above its surface, as a fraction of a cell: float32 must tell the two apart.
_BEFORE = 1e-2

#: Texels that are lit together.
_TEXELS = 256


def emitted_irradiance(scene: Scene, bodies: Sequence[int], points: GroundPoints) -> Array:
    """(texels, 3): irradiance on a ground by what media of clear bodies emit.

    These bodies do not hide each other, or themselves: their light goes through.

    Parameters
    ----------
    scene : Scene
    bodies : sequence of int
        Those that emit, and clear ones around them.
    points : GroundPoints
    """
    samples = _samples(scene, bodies, EMITTERS // len(bodies))
    normals = np.concatenate([own.normals for own in samples.values()])
    starts = np.concatenate([own.points + _BEFORE * own.grid.cells.step * own.normals for own in samples.values()])
    areas = np.concatenate([own.grid.areas for own in samples.values()])
    outside = ~windings_at(scene, starts, normals).any(axis=1)
    starts, normals, areas = starts[outside], normals[outside], areas[outside]
    radiance, by_angle = _emitted_radiance(scene, bodies, starts, normals)
    hiding = [
        item
        for i, item in enumerate(scene.objects)
        if i != points.number and (item.medium is None or treatment_of(item) is Treatment.DIFFUSION)
    ]
    caster = opaque_surfaces(hiding)
    found = np.zeros(points.points.shape)
    for part in np.array_split(np.arange(len(found)), len(found) // _TEXELS + 1):
        towards = starts - points.points[part, None]
        square = (towards**2).sum(axis=2)
        above = np.maximum(towards @ points.normal, 0.0)
        below = np.maximum(-(towards * normals).sum(axis=2), 0.0)
        # Each sample is a disc of its area (Wallace, Elmquist & Haines 1989).
        factor = above * below * areas / (square * (square + areas / np.pi))
        if caster is not None:
            texel, sample = np.nonzero(factor)
            ways = towards[texel, sample]
            hidden = caster.caster.nearest(starts[sample] - ways, ways)[1] < 1.0
            factor[texel[hidden], sample[hidden]] = 0.0
        cosine = below / np.sqrt(square)
        factor *= np.interp(cosine, (np.arange(ANGLES) + 0.5) / ANGLES, by_angle)
        found[part] = factor @ radiance
    return found


def _emitted_radiance(scene: Scene, bodies: Sequence[int], starts: Array, normals: Array) -> tuple[Array, Array]:
    """(s, 3): mean radiance that leaves clear bodies at samples of their surfaces, and its factor (a,) by the cosine.

    Paths back into a body end where they leave it: what comes there is the light of others.
    """
    emission = np.zeros((len(scene.objects), 3))
    emission[list(bodies)] = [scene.source(scene.objects[i]) for i in bodies]
    tracer = PhotonSegmentTracer(scene, np.random.default_rng(0))
    owner, out = hemispheres(normals, EMITTED_RAYS)
    found = np.zeros((len(owner), 3))
    windings = np.zeros((len(owner), len(scene.objects)), np.int16)
    going = tracer.begun_at(starts[owner], -out, np.ones((len(owner), 3)), windings)
    for _ in range(MOST_SURFACES):
        step = tracer.step(going)
        on = step.segments
        mean = optics.mean_transmittance(on.extinction * on.length[:, None])
        found[on.number] += on.power * (on.filling @ emission) * mean * on.length[:, None]
        going = step.going.where(np.asarray(step.going.windings.any(axis=1)))
        if not len(going.number):
            break
    cosine = (out * normals[owner]).sum(axis=1)
    angle = np.minimum((cosine * ANGLES).astype(np.int64), ANGLES - 1)
    by_angle = np.bincount(angle, found.sum(axis=1), ANGLES) / np.maximum(np.bincount(angle, minlength=ANGLES), 1)
    mean = found.reshape(len(starts), EMITTED_RAYS, 3).mean(axis=1)
    return mean, by_angle / max(float(found.sum(axis=1).mean()), np.finfo(np.float64).tiny)


#: Paths from all samples of a body together, and from each at least and at most.
PATHS, FEWEST, MOST = 1 << 18, 8, 48

#: Bounds of the correction by which the paths of a sample let in the known fraction of uniform light.
_CORRECTION = (0.5, 2.0)


@dataclass(frozen=True, eq=False)
class PathExchange:
    """Flux that enters a body for the flux that leaves it, and others, by way of interfaces and opaque objects.

    Attributes
    ----------
    itself, others : three (s, s) csr_array, three (s, o) csr_array
        By color channel: for the samples of the body, and for flux over n^2 at those of all others, one after another.
    mean : (s, s) csr_array
        Over samples around each: paths are few.
    """

    itself: Sequence[sparse.csr_array]
    others: Sequence[sparse.csr_array]
    mean: sparse.csr_array

    @property
    def any(self) -> bool:
        """True if light that leaves the body falls on it again."""
        return any(one.nnz for one in self.itself)

    def returned(self, leaving: Array, channel: int) -> Array:
        """(s,): flux that enters in a color channel for a flux (s,) that leaves where all light is scattered."""
        return np.asarray(self.mean @ (self.itself[channel] @ leaving))

    def from_others(self, leaving: Array, passing: Array) -> Array:
        """(s, 3): flux that enters for fluxes (o, 3) that leave other bodies, scattered and unscattered."""
        sent = leaving + passing
        found = [self.mean @ (self.others[channel] @ sent[:, channel]) for channel in range(3)]
        return np.stack(found, axis=1)


class EnclosedPaths:
    """Paths from the samples of a body, backwards along the light that falls on it through interfaces.

    They carry L / n^2, which refraction leaves as it is, less what media take. Opaque objects scatter them.

    Parameters
    ----------
    scene : Scene
    body : int
    lit : dict of int to LitBody
        All bodies of the scene in which light diffuses, by number.

    Attributes
    ----------
    outside : (s,) float64
        Index of refraction around each sample.
    exchange : PathExchange
    """

    def __init__(self, scene: Scene, body: int, lit: Mapping[int, LitBody]) -> None:
        own, self._lit = lit[body], lit
        self._grid, pose = own.grid, own.pose
        self._own, self._ior = body, _index(scene.objects[body])
        points = pose.outwards(self._grid.points) + pose.shift
        normals = pose.outwards(self._grid.face_normals)
        starts = points + _ABOVE * self._grid.cells.step * normals
        count = len(points)
        self._rays = int(np.clip(PATHS // max(count, 1), FEWEST, MOST))
        self._tracer = PhotonSegmentTracer(scene, np.random.default_rng(0))
        self._surfaces = opaque_surfaces(scene.opaque)
        #: Number of the first face of each object among those of the opaque ones.
        firsts = (
            {}
            if self._surfaces is None
            else dict(zip(map(id, self._surfaces.objects), self._surfaces.first, strict=False))
        )
        self._first = np.array([firsts.get(id(item), -1) for item in scene.objects])
        owner, directions = hemispheres(normals, self._rays)
        inside = windings_at(scene, starts, normals)[owner]
        begun = self._tracer.begun_at(starts[owner], directions, np.ones((len(owner), 3)), inside)
        indices = self._tracer.iors_around(begun)
        self.outside: Array = indices.reshape(count, -1)[:, 0]
        self._enters(owner, directions, normals, indices)
        self._left: list[tuple[Integers, Array, Array]] = []
        self._met: list[tuple[Integers, Array, Array, Array, Array]] = []
        self._links: list[tuple[Integers, Integers, Integers, Array]] = []
        for part in np.array_split(np.arange(len(owner)), len(owner) // BATCH + 1):
            self._follow(begun.where(part))

    def _enters(self, owner: Integers, directions: Array, normals: Array, indices: Array) -> None:
        """Fractions of the light on each path that enter and that the interface reflects, and directions inside."""
        relative = self._ior / indices
        cosine = (directions * normals[owner]).sum(axis=1)
        entering = 1.0 - optics.fresnel_dielectric(cosine, relative)
        exact = np.array([diffuse_interface(one).entering for one in np.unique(relative)])
        exact = exact[np.unique(relative, return_inverse=True)[1].ravel()].reshape(-1, self._rays)[:, 0]
        mean = np.maximum(entering.reshape(-1, self._rays).mean(axis=1), 1e-9)
        self._entering = entering * np.clip(exact / mean, *_CORRECTION)[owner]
        self._mirrored = np.maximum(1.0 - self._entering, 0.0)
        inside = refracted_direction(-directions, normals[owner], relative)
        self._inside = self._lit[self._own].pose.inwards(inside)

    def _follow(self, going: Photons) -> None:
        for _ in range(MOST_SURFACES):
            if not len(going.number):
                return
            step = self._tracer.step(going)
            self._scatter(step.segments, going.number[~np.isin(going.number, step.left.number)])
            self._left.append((step.left.number, step.left.directions, step.left.power))
            going = step.going
            if self._surfaces is not None:
                going = joined((going, self._land(step.landed, self._surfaces)))

    def _scatter(self, segments: PhotonSegments, number: Integers) -> None:
        """Light that bodies scatter onto segments of the paths of numbered rays, where these come into the bodies."""
        for k, other in self._lit.items():
            at = np.flatnonzero(segments.filling[:, k] > 0.0)
            power = segments.power[at] * optics.opacity(segments.extinction[at] * segments.length[at, None])
            sample = other.nearest_sample(segments.origins[at])
            self._links.append((np.full(len(at), k), number[at], sample, power))

    def _land(self, landed: Photons, surfaces: OpaqueSurfaces) -> Photons:
        """Paths that go on from opaque objects, diffusely."""
        item, face = self._tracer.surfaces_of(landed)
        number = self._first[item] + face
        reflected, emitted = surfaces.light(number, landed.origins)
        normals = surfaces.normals(number)
        normals = np.where((normals * landed.directions).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        fraction = landed.power * reflected
        self._met.append((landed.number, landed.origins, normals, fraction, landed.power * emitted))
        landed.power = fraction
        landed.directions = cosine_directions(normals, *self._tracer.rng.random((2, len(item))))
        return landed

    @property
    def meets_opaque(self) -> bool:
        """True if some paths come to opaque objects, which lights light straight."""
        return any(len(one[0]) for one in self._met)

    @cached_property
    def exchange(self) -> PathExchange:
        """Light of this body, and of others, on it."""
        item, ray, sample, power = (np.concatenate(part) for part in zip(*self._links, strict=True))
        owner, count = ray // self._rays, len(self.outside)
        values = (self._entering[ray] * self.outside[owner] ** 2 / self._rays)[:, None] * power
        others = [k for k in self._lit if k != self._own]
        sizes = [len(self._lit[k].grid.points) for k in others]
        offset = dict(zip(others, np.cumsum([0, *sizes]).tolist(), strict=False))
        mine = item == self._own
        # The flux that leaves others is over n^2 already.
        values[mine] /= self.outside[sample[mine], None] ** 2
        column = sample + np.array([offset.get(k, 0) for k in item.tolist()], np.int64)

        def matrices(of: Array, columns: int) -> list[sparse.csr_array]:
            shape = count, columns
            return [sparse.csr_array((values[of, channel], (owner[of], column[of])), shape) for channel in range(3)]

        return PathExchange(matrices(mine, count), matrices(~mine, sum(sizes)), self._grid.mean_around)

    def light(self, scene: Scene) -> tuple[Array, EnteringRays]:
        """Uniform flux (s, 3) that enters, and rays for the rest, from environment and opaque objects of a scene.

        Lights light opaque objects straight.
        """
        found, whole = np.zeros((2, len(self._entering), 3))

        def add(to: Array, ray: Integers, light: Array) -> None:
            for channel in range(3):
                to[:, channel] += np.bincount(ray, light[:, channel], len(to))

        for ray, directions, power in self._left:
            add(found, ray, power * radiance_without_suns(scene.environment, directions))
            add(whole, ray, power)
        dimming = dimming_bodies(scene, -1)
        for ray, points, normals, fraction, emitted in self._met:
            add(found, ray, emitted)
            if len(ray) and scene.lights and self._surfaces is not None:
                passed = partial(light_passed, dimming)
                direct = direct_irradiance(points, normals, scene.lights, self._surfaces.caster, passed)
                add(found, ray, fraction * direct / np.pi)
        count, flux = len(self.outside), np.pi * self.outside**2 / self._rays
        parts = found.reshape(count, -1, 3), whole.reshape(count, -1, 3)
        ratios = np.where(parts[1] > 0.0, parts[0] / np.where(parts[1] > 0.0, parts[1], 1.0), np.inf)
        least = ratios.min(axis=1, keepdims=True)
        least = np.where(np.isfinite(least), least, 0.0)
        uniform = (self._entering.reshape(count, -1, 1) * parts[1] * least).sum(axis=1) * flux[:, None]
        rest = (parts[0] - parts[1] * least).reshape(-1, 3) * np.repeat(flux, self._rays)[:, None]
        used = np.flatnonzero((self._entering > 0.0) & rest.any(axis=1))
        entering, mirrored = (part[used, None] * rest[used] for part in (self._entering, self._mirrored))
        rays = EnteringRays(used // self._rays, self._inside[used], entering, mirrored)
        mean = self._grid.mean_around
        return mean @ uniform, two_of_many(rays, self._grid.face_normals, mean)


def _index(item: Object) -> float:
    assert item.medium is not None
    return item.medium.ior
