"""Irradiance on opaque objects by light that interfaces refract and reflect, and that opaque objects reflect.

Random paths from samples of each object's surface gather it: they end at the environment, or at opaque objects, which
light each other in a few rounds. Pictures look it up in a volume around the object, by the normal.

References
----------
Goral, Torrance, Greenberg & Battaile 1984, "Modeling the interaction of light between diffuse surfaces"; Greger,
Shirley, Hubbard & Greenberg 1998, "The irradiance volume".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse

from translucent.arrays import Array, Floats, Integers
from translucent.diffusion.entering import Pose, dimming_bodies, light_passed, windings_at
from translucent.diffusion.exchange import ROUNDS, OpaqueSurfaces, cosine_directions, direct_irradiance, hemispheres
from translucent.diffusion.grid import BodyGrid, body_grid, nearest_samples
from translucent.diffusion.lit_body import own_frame
from translucent.diffusion.photons import BATCH, MOST_SURFACES, Photons, PhotonSegmentTracer, joined
from translucent.diffusion.sides import GridPlacement, SurfaceSides, beside
from translucent.scene.scene import Scene

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
    samples: dict[int, _Samples] = {}
    count = 0
    for i in objects:
        own = own_frame(scene.objects[i])
        corners = own.world_vertices[own.mesh.faces]
        sides = corners[:, 1:] - corners[:, :1]
        area = 0.5 * float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())
        grid = body_grid(own, np.sqrt(3.0 * area / min(SAMPLES, MOST_SAMPLES // len(objects))))
        samples[i] = _Samples(grid, Pose.of(scene.objects[i].matrix)[0], count + np.arange(len(grid.points)))
        count += len(grid.points)
    gathering = _Gathering(scene, samples, count)
    lit = gathering.enclosed if photons else set()
    irradiance = gathering.irradiance(lit, photons)
    return {i: own.map(irradiance, lit=i in lit) for i, own in samples.items()}


class _Gathering:
    """Paths from all samples, and the light that they find."""

    def __init__(self, scene: Scene, samples: dict[int, _Samples], count: int) -> None:
        self.scene, self.samples, self.count = scene, samples, count
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
        self.first: Array = np.zeros((count, 3))
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
