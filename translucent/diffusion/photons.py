"""Paths of photons from the lights of a scene through its interfaces and media.

The CPU's twin of ``shaders/transport/photon_step.glsl``: the same aims and starts, and the same choices by chance. It
yields each segment between two surfaces, and not only where photons land.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask, expanded, slices
from translucent.diffusion.grid import plane_points
from translucent.diffusion.interfaces import AIR, InterfaceTable
from translucent.formulas import optics
from translucent.formulas.bsdf import Interaction, Lobes, below_coat, microfacet_normal, sampled_branches
from translucent.formulas.light import cone_attenuation, sphere_point
from translucent.geometry.ray_caster import SceneRayCaster, dot
from translucent.media.medium import Medium
from translucent.planning.bodies import same_medium
from translucent.planning.caustics import Caustics, PhotonAim, photon_aims
from translucent.planning.rendered import scatterer_of
from translucent.scene.scene import Object, Scene

#: Photons that are followed together.
BATCH = 1 << 15

#: Surfaces on the path of a photon after which it is given up.
MOST_SURFACES = 96

#: Fraction of its power below which a photon ends by Russian roulette, or continues with this.
ROULETTE = 0.05

#: Largest distance between surfaces in one place, in radii of the scene.
TOGETHER = 2e-7


@dataclass(frozen=True, eq=False)
class PhotonSegments:
    """Straight segments of photon paths, from one surface to the next.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In metres in the world; directions have unit length.
    length : (n,) float64
        In metres.
    power : (n, 3) float64
        In W, where they begin.
    extinction : (n, 3) float64
        In 1/m, of all that fills the place; what is scattered ahead counts as unscattered.
    filling : (n, objects) float64
        How often each object's medium fills the place.
    before, after : (n, objects) float64
        The same on the other sides of the two surfaces, where light passes these straight on; else as `filling`.
    bent : (n,) bool
        An interface has refracted or reflected them.
    entered : (n,) int64
        Object of the effective medium here and not before, -1 for none.
    bent_before : (n,) bool
        An interface has refracted or reflected them before they have entered.
    lands : (n,) bool
        They end on an opaque surface.
    number : (n,) int64
        Of the photons.
    """

    origins: Array
    directions: Array
    length: Array
    power: Array
    extinction: Array
    filling: Array
    before: Array
    after: Array
    bent: Mask
    entered: Integers
    bent_before: Mask
    lands: Mask
    number: Integers

    def where(self, chosen: Mask | Integers) -> PhotonSegments:
        """Selection of segments."""
        return PhotonSegments(*(getattr(self, one.name)[chosen] for one in fields(self)))


@dataclass(eq=False)
class Photons:
    """Photons on their paths; `last` (n, groups) are the faces that they are on, -1 for none.

    `windings` and `since` (n, objects) count how often they are in each object, and when they came in; `number` (n,)
    tells them apart.
    """

    origins: Array
    directions: Array
    power: Array
    started: Array
    windings: npt.NDArray[np.int16]
    since: Integers
    last: Integers
    before: Array
    bent: Mask
    entered: Integers
    bent_before: Mask
    channel: Integers
    number: Integers

    def where(self, chosen: Mask | Integers) -> Photons:
        """Selection of photons."""
        return Photons(*(getattr(self, one.name)[chosen] for one in fields(self)))


def joined(parts: Sequence[Photons]) -> Photons:
    """All photons of some parts."""
    return Photons(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(Photons)))


def photon_segments(scene: Scene, photons: int, seed: int) -> Iterator[PhotonSegments]:
    """Segments of the paths of about `photons` photons from the lights of a scene.

    At a rough interface a photon interacts with one microfacet, and no other one blocks it.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed, even, or sheets.
    photons : int
    seed : int
        Of the random numbers.
    """
    for step in PhotonSegmentTracer(scene, np.random.default_rng((seed, 0x6D656469))).steps(photons):
        yield step.segments


class PhotonStep(NamedTuple):
    """Photons after the next surface on their paths.

    Attributes
    ----------
    segments : PhotonSegments
        Up to there.
    going : Photons
        Photons that go on.
    landed : Photons
        Photons that have reached an opaque surface, `Photons.last`.
    left : Photons
        Photons with no surface ahead.
    """

    segments: PhotonSegments
    going: Photons
    landed: Photons
    left: Photons


class PhotonSegmentTracer:
    """Tracer of photons through one scene.

    Parameters
    ----------
    scene : Scene
        Its bodies are closed, even, or sheets.
    rng : Generator
    """

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self.scene, self.rng, objects = scene, rng, scene.objects
        hittable = [i for i, item in enumerate(objects) if not item.covers]
        self._caster = SceneRayCaster([objects[i] for i in hittable])
        #: Object of each face; at index -1, of none.
        self._item = np.append(np.array(hittable)[self._caster.faces.item], AIR)
        self._table = InterfaceTable(scene, [item.sheet_thickness for item in objects])
        #: (objects, 3): in 1/m; what is scattered ahead counts as unscattered.
        self._extinction = np.stack([_reduced_extinction(item) for item in objects])

    def steps(self, photons: int) -> Iterator[PhotonStep]:
        """Steps of about `photons` photons from the lights."""
        for aim in photon_aims(self.scene, np.zeros(3), photons):
            starts = (plane_points(aim.photons) + self.rng.random(2)) % 1.0
            for first in range(0, aim.photons, BATCH):
                going = self.begun(aim, starts[first : first + BATCH])
                for _ in range(MOST_SURFACES):
                    if not len(going.origins):
                        break
                    step = self.step(going)
                    going = step.going
                    yield step

    def begun(self, aim: PhotonAim, starts: Array) -> Photons:
        """Photons at the light, or where they come near the scene."""
        scene, count, objects = self.scene, len(starts), len(self.scene.objects)
        lights = np.tile(aim.light[:3], (count, 1))
        if aim.light_radius > 0.0:
            lights += aim.light_radius * sphere_point(self.rng.random((count, 3)))
        if aim.right.any():
            power = np.tile(aim.flux / aim.photons, (count, 1))
            target = aim.middle + (2.0 * starts - 1.0) @ np.stack([aim.right, aim.up])
            directions = lights
            origins = target - 2.0 * scene.diagonal * directions
            if aim.light[3]:
                to_target = target - lights
                distance = np.linalg.norm(to_target, axis=1)
                directions = to_target / distance[:, None]
                across = np.cross(aim.right, aim.up)
                cosine = np.abs(directions @ (across / np.linalg.norm(across)))
                power *= (cosine / distance**2 * cone_attenuation(directions, aim.cone))[:, None]
                origins = lights
        else:
            up, angle = 2.0 * starts[:, 0] - 1.0, 2.0 * np.pi * starts[:, 1]
            level = np.sqrt(np.maximum((1.0 - up) * (1.0 + up), 0.0))
            directions = np.stack([level * np.cos(angle), level * np.sin(angle), up], axis=1)
            origins = lights
            power = cone_attenuation(directions, aim.cone)[:, None] * aim.flux / aim.photons
        windings = np.zeros((count, objects), np.int16)
        windings[:, list(aim.inside)] = 1
        begun = self.begun_at(origins, directions, power, windings)
        return begun.where(np.flatnonzero(begun.power.any(axis=1)))

    def begun_at(self, origins: Array, directions: Array, power: Array, windings: npt.NDArray[np.int16]) -> Photons:
        """Photons from points (n, 3) in unit directions (n, 3); `windings` (n, objects) count what they begin in.

        Of nested bodies, they have entered smaller ones later.
        """
        count = len(origins)
        channel = np.full(count, 1)
        if self._table.dispersed:
            channel = self.rng.integers(3, size=count)
            power = power * 3.0 * np.eye(3)[channel]
        smaller = np.argsort(np.argsort([-item.radius for item in self.scene.objects], kind="stable"))
        since = np.where(windings > 0, smaller, 0)
        last, filling = np.full((count, self._caster.groups), -1), self._filling(windings, since)
        unbent, nothing, number = np.zeros(count, dtype=bool), np.full(count, AIR), np.arange(count)
        return Photons(
            origins, directions, power, power, windings, since, last, filling, unbent, nothing, unbent, channel, number
        )

    def surfaces_of(self, photons: Photons) -> tuple[Integers, Integers]:
        """Opaque object (n,) that photons have landed on, and the number (n,) of its face."""
        item = self._item[photons.last]
        column = self._table.is_opaque[item].argmax(axis=1)
        row = np.arange(len(column))
        return item[row, column], self._caster.faces.number[photons.last[row, column]]

    def iors_around(self, photons: Photons) -> Array:
        """(n,): indices of refraction where photons are."""
        return np.asarray(self._table.iors[self._effective(photons.windings, photons.since), photons.channel])

    def step(self, going: Photons) -> PhotonStep:
        """Follow photons to the next surface, and on from there."""
        caster = self._caster
        face, distance = caster.nearest((going.origins - caster.center) / caster.radius, going.directions, going.last)
        nearest = distance.min(axis=1)
        found = np.isfinite(nearest)
        face = np.where(distance <= nearest[:, None] + TOGETHER, face, -1)[found]
        left, going, length = going.where(~found), going.where(found), nearest[found] * caster.radius
        filling = self._filling(going.windings, going.since)
        extinction = filling @ self._extinction
        points = going.origins + length[:, None] * going.directions
        with np.errstate(under="ignore"):
            power = going.power * optics.transmittance(extinction * length[:, None])
        windings, since = self._crossed(going, face)
        beyond = self._filling(windings, since)
        after, straight, lands = self._interacted(going, face, points, power, windings, since)
        segments = PhotonSegments(
            going.origins,
            going.directions,
            length,
            going.power,
            extinction,
            filling,
            going.before,
            np.where(straight[:, None], beyond, filling),
            going.bent,
            going.entered,
            going.bent_before,
            lands,
            going.number,
        )
        # Behind a surface that refracts or reflects, no light comes straight from the other side.
        after.before = np.where(straight[:, None], filling, self._filling(after.windings, after.since))
        further = self._surviving(after.where(np.flatnonzero(~lands & after.power.any(axis=1))))
        return PhotonStep(segments, further, after.where(lands), left)

    def _crossed(self, going: Photons, face: Integers) -> tuple[npt.NDArray[np.int16], Integers]:
        """Winding numbers (n, objects) beyond surfaces, and when photons came in."""
        windings, since = going.windings.copy(), going.since.copy()
        time = since.max(axis=1, initial=0) + 1
        for own, item in zip(face.T, self._item[face].T, strict=True):
            ray = np.flatnonzero(self._table.is_solid[item])
            enters = dot(self._caster.faces.outward[own[ray]], going.directions[ray]) < 0.0
            windings[ray, item[ray]] += np.where(enters, 1, -1).astype(np.int16)
            first = ray[enters & (windings[ray, item[ray]] == 1)]
            since[first, item[first]] = time[first]
        return windings, since

    def _interacted(
        self,
        going: Photons,
        face: Integers,
        points: Array,
        power: Array,
        windings: npt.NDArray[np.int16],
        since: Integers,
    ) -> tuple[Photons, Mask, Mask]:
        """Interact photons with surfaces, one random branch each; also masks of photons that go straight on or land.

        `power` is what each has left at the surface; `windings` and `since` hold on its other side.
        """
        table, item = self._table, self._item[face]
        before, after = self._effective(going.windings, going.since), self._effective(windings, since)
        lands = table.is_opaque[item].any(axis=1)
        # No light moves through edges of meshes unseen: what would be in the air again leaves.
        changes = table.alters_light(before, after, going.channel) & ~lands
        column, sheet = table.interfaces(item, before, after, changes, table.is_wall | table.is_film)
        row = np.arange(len(face))
        sheet &= ~lands
        own = np.flatnonzero((changes | sheet) & (item[row, column] != AIR))
        directions, power = going.directions.copy(), power.copy()
        passes, straight = np.ones(len(face), dtype=bool), ~changes
        bent = np.zeros(len(face), dtype=bool)
        if own.size:
            hit, hit_item = face[own, column[own]], item[own, column[own]]
            local = (points[own] - self._caster.center) / self._caster.radius
            at = table.interaction(
                hit_item,
                before[own],
                np.where(sheet, before, after)[own],
                going.channel[own],
                directions[own],
                self._caster.facing_normals(hit, local, directions[own]),
            )
            transmitted, weight, onward = self._sampled(at, table.alpha[hit_item], power[own])
            directions[own], passes[own] = onward, transmitted
            power[own] *= weight
            straight[own] = transmitted & (at.thin_walled | (at.ior == 1.0))
            bent[own] = ~straight[own]
        photons = Photons(
            points,
            directions,
            power,
            going.started,
            np.where(passes[:, None], windings, going.windings),
            np.where(passes[:, None], since, going.since),
            face,
            going.before,
            going.bent | bent,
            np.where(passes & (before != after), after, AIR),
            going.bent,
            going.channel,
            going.number,
        )
        return photons, straight, lands

    def _sampled(self, at: Interaction, alpha: Array, power: Array) -> tuple[Mask, Array, Array]:
        """Mask (k,) of photons that are transmitted, factors (k, 3) on their power, and directions (k, 3)."""
        facets = at.normal.copy()
        rough = np.flatnonzero((alpha > 0.0) & ~at.thin_walled & (at.ior != 1.0))
        if rough.size:
            samples = self.rng.random((rough.size, 2))
            facets[rough] = microfacet_normal(at.normal[rough], at.direction[rough], alpha[rough], samples)
        cosine, coat = at.cosine(facets), at.coat_reflectance()
        below = below_coat(at.lobes(optics.fresnel_dielectric(cosine, at.ior), cosine)[0], coat)
        lobes = Lobes(below.reflection + coat, below.transmission * at.base)
        transmitted, weight = sampled_branches(lobes, power, 1.0 - self.rng.random(len(alpha)))
        onward = np.where(transmitted[:, None], at.refracted(facets), at.reflected(facets))
        return transmitted, weight, onward / np.linalg.norm(onward, axis=1, keepdims=True)

    def _effective(self, windings: npt.NDArray[np.int16], since: Integers) -> Integers:
        """(n,): object of the effective medium, or `AIR` (Schmidt & Budge 2002)."""
        key = np.where((windings > 0) & self._table.decides, self._table.rank * (1 << 40) + since, -1)
        best = key.argmax(axis=1)
        return np.where(key[np.arange(len(key)), best] >= 0, best, AIR)

    def _filling(self, windings: npt.NDArray[np.int16], since: Integers) -> Array:
        """(n, objects): how often each medium fills the places of photons."""
        found = np.where(self._table.is_solid[:-1], np.maximum(windings, 0), 0).astype(np.float64)
        if self.scene.overlap == "priority":
            own = np.arange(found.shape[1]) == self._effective(windings, since)[:, None]
            return np.where(own & (found > 0.0), 1.0, 0.0)
        if self.scene.overlap == "union":
            found = np.minimum(found, 1.0)
            for one, other in self._alike:
                found[:, other] *= found[:, one] == 0.0
        return found

    @cached_property
    def _alike(self) -> list[tuple[int, int]]:
        """Pairs of objects with one medium."""
        objects, solid = self.scene.objects, np.flatnonzero(self._table.is_solid).tolist()
        return [(i, j) for j in solid for i in solid if i < j and same_medium(objects[i], objects[j])]

    def _surviving(self, photons: Photons) -> Photons:
        """Photons that survive Russian roulette, with a probability by the power that they have left."""
        left = np.max(photons.power / np.maximum(photons.started.max(axis=1, keepdims=True), 1e-300), axis=1)
        chance = np.minimum(left / ROULETTE, 1.0)
        lives = self.rng.random(len(chance)) < chance
        found = photons.where(lives)
        found.power = found.power / chance[lives, None]
        return found


def _reduced_extinction(item: Object) -> Array:
    """(3,): extinction in 1/m of an object's medium, without forward scattering."""
    medium = scatterer_of(item)
    if medium is None or item.sheet_thickness is not None:
        return np.zeros(3)
    assert isinstance(medium, Medium)
    return np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)


#: Cells of the finer grid along the side of one of light that is scattered again, at most, and in all of a body.
FINER, MOST_CELLS = 4, 1 << 20

#: Largest length of a part of a segment, in cells: a part counts in one cell.
PART = 0.7

#: Cells by which segments are extended beyond the body, so that cells on its surface have all light.
BEYOND = 1.5

#: Parts that are added up together.
_TOGETHER = 1 << 19


@dataclass(frozen=True, eq=False)
class FineCells:
    """Finer cells that subdivide the cells of a grid.

    Attributes
    ----------
    low : (3,) float64
        Corner of the grid in metres.
    step : float
        Side of a fine cell in metres.
    shape : (3,) ints
    finer : int
        Number of fine cells along the side of a coarse one.
    """

    low: Array
    step: float
    shape: tuple[int, int, int]
    finer: int

    @classmethod
    def of(cls, low: Array, step: float, shape: tuple[int, ...]) -> FineCells:
        """Finest subdivision that fits into memory, of a grid with cells of this side."""
        room = np.cbrt(MOST_CELLS / float(np.prod(shape)))
        finer = int(min(max(room, 1.0), FINER))
        return cls(low, step / finer, (shape[0] * finer, shape[1] * finer, shape[2] * finer), finer)

    def coarse(self, values: Array) -> Array:
        """Means (x, y, z, 3) of values (x, y, z, 3) over the cells of the coarse grid."""
        k = self.finer
        x, y, z = (size // k for size in self.shape)
        return np.asarray(values.reshape(x, k, y, k, z, k, -1).mean(axis=(1, 3, 5)))


@dataclass(frozen=True, eq=False)
class EnteringPhotons:
    """Photons that enter a body through its interface.

    Attributes
    ----------
    points, directions : (n, 3) float64
        In metres in the world; and behind the interface.
    power : (n, 3) float64
        In W, without the reflected part.
    """

    points: Array
    directions: Array
    power: Array


@dataclass(frozen=True, eq=False)
class MediaPhotons:
    """Light that photons carry into media after interfaces have refracted or reflected it.

    Attributes
    ----------
    fluence : dict of int to (x, y, z, 3) float64
        In the cells of objects without an interface, in W/m^2. What a medium scatters ahead counts as unscattered, as
        `translucent.diffusion.volume` has it; what it scatters else is not in it.
    entering : dict of int to EnteringPhotons
        Of other objects in which light diffuses: photons that had been refracted or reflected before.
    """

    fluence: dict[int, Array]
    entering: dict[int, EnteringPhotons]


def photons_in_media(
    scene: Scene, caustics: Caustics, grids: Mapping[int, FineCells], bodies: Sequence[int]
) -> MediaPhotons:
    """Follow photons into these cells of objects, and through the interfaces of bodies."""
    sums = {body: np.zeros((int(np.prod(cells.shape)), 3)) for body, cells in grids.items()}
    parts: dict[int, list[PhotonSegments]] = {body: [] for body in bodies}
    rng = np.random.default_rng((caustics.seed, len(grids)))
    for segments in photon_segments(scene, caustics.in_media, caustics.seed):
        turned = segments.where(segments.bent)
        for body, cells in grids.items():
            _add(sums[body], turned.where(turned.filling[:, body] > 0.0), body, cells, rng)
        for body, found in parts.items():
            found.append(turned.where((turned.entered == body) & turned.bent_before))
    fluence = {body: sums[body].reshape(*cells.shape, 3) / cells.step**3 for body, cells in grids.items()}
    return MediaPhotons(fluence, {body: _entering(found) for body, found in parts.items()})


def _entering(parts: list[PhotonSegments]) -> EnteringPhotons:
    none = np.zeros((0, 3))
    return EnteringPhotons(
        np.concatenate([none, *(part.origins for part in parts)]),
        np.concatenate([none, *(part.directions for part in parts)]),
        np.concatenate([none, *(part.power for part in parts)]),
    )


def _add(sums: Array, segments: PhotonSegments, body: int, cells: FineCells, rng: np.random.Generator) -> None:
    """Add power times length of segments in a body to its cells (n, 3)."""
    first = np.where(segments.before[:, body] == 0.0, BEYOND * cells.step, 0.0)
    last = segments.length + np.where(segments.after[:, body] == 0.0, BEYOND * cells.step, 0.0)
    length = first + last
    parts = np.ceil(length / (PART * cells.step)).astype(np.int64)
    size = length / parts
    for some in slices(parts, _TOGETHER):
        own, number = expanded(np.zeros(some.stop - some.start, np.int64), parts[some])
        own += some.start
        # Each part counts in the cell of a random place on it, and with the light that is there.
        along = (number + rng.random(len(own))) * size[own] - first[own]
        points = segments.origins[own] + along[:, None] * segments.directions[own]
        place = np.floor((points - cells.low) / cells.step).astype(np.int64)
        inside = ((place >= 0) & (place < cells.shape)).all(axis=1)
        own, along, place = own[inside], along[inside], place[inside]
        at = np.ravel_multi_index(tuple(place.T), cells.shape)
        with np.errstate(under="ignore"):
            # Behind the surface where it begins there is as much light as at it.
            left = optics.transmittance(segments.extinction[own] * np.maximum(along, 0.0)[:, None])
            weight = segments.power[own] * left * size[own, None]
        for channel in range(3):
            sums[:, channel] += np.bincount(at, weight[:, channel], len(sums))
