"""Radiance along rays that bend: a ray tree through the meshes of a scene, all segments of a level at once.

Nested dielectrics are those of Schmidt & Budge 2002, "Simple nested dielectrics in ray traced images". All radiance is
basic radiance L / n^2, which does not change where light enters a denser medium; emission counts as it would in a
medium that is index-matched. `translucent.reference.refracted` follows all branches, and this tree those that matter
most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.beams import Beams, joined
from translucent.cpu.caster import Caster
from translucent.cpu.diffused import DiffusedLight
from translucent.cpu.facets import Spread
from translucent.cpu.footprints import first_footprints, moved_on, parted
from translucent.cpu.interface_light import InterfaceLight
from translucent.cpu.legs import LegMedia
from translucent.cpu.media_record import NOTHING, Items, Record, RecordedMedia, empty_records, enter, has, leave
from translucent.cpu.meetings import Interfaces, Meetings, Places
from translucent.cpu.surroundings import Surroundings
from translucent.cpu.threads import end_if_stopped
from translucent.cpu.vectors import dot, largest, unit
from translucent.formulas.diffusion import HAZE_ROUGHNESS
from translucent.formulas.interface import reflected_direction
from translucent.reference.hits import Hits
from translucent.reference.interfaces import Optics
from translucent.reference.opaque import OpaqueHits, reflected_radiance
from translucent.reference.rays import Rays
from translucent.reference.surface_light import SurfaceLight

#: Share of each color below which a branch is not followed: it sees the environment at once.
FAINTEST = 1.0 / 1024.0

#: Largest distance between surfaces in one place, in radii of the scene.
TOGETHER = 1e-7

#: Luminance of linear RGB (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: Distance from the center of the scene, in radii, at which rays from afar begin.
BEFORE = 1.01


@dataclass(frozen=True, eq=False)
class TracedLight:
    """Radiance (n, 3) of rays, and whether (n,) all parts of them left the bodies that they entered."""

    radiance: Array
    valid: Mask


class RayTree:
    """Tracer of the camera's rays through the interfaces of a scene.

    At an interface that reflects and refracts, the stronger branch is followed. The weaker one is followed, too, where
    the path has forks left, of which it uses up one; else it sees the environment in its direction, as if nothing were
    ahead. So do both at the last interface.

    Parameters
    ----------
    light : SurfaceLight
        On the surfaces of the scene.
    caster : Caster
        Of the objects of the scene.
    aspect : float
        Width of the picture divided by its height.
    depth : int
        Interfaces that a path meets, at most.
    forks : int
        How often a path takes the weaker branch, at most.
    diffused : DiffusedLight
        Of the bodies of the scene.
    pixel : float
        Extent of a pixel in metres, or in metres at distance 1, over which the environment is averaged; 0 for points.
    """

    def __init__(
        self,
        light: SurfaceLight,
        caster: Caster,
        aspect: float,
        depth: int,
        forks: int,
        diffused: DiffusedLight,
        pixel: float = 0.0,
    ) -> None:
        scene = light.scene
        self.light, self.scene, self.caster, self.depth, self.forks = light, scene, caster, depth, forks
        self.diffused, self.pixel = diffused, pixel
        self.surroundings = Surroundings(scene, aspect)
        dispersed = any(body.surface is not None and body.surface.dispersion > 0 for body in scene.bodies)
        self._channels = [
            Optics(scene, light.paths.sheets, channel) for channel in ((0, 1, 2) if dispersed else (None,))
        ]

    def see(self, rays: Rays, hits: Sequence[Hits], pixel: Integers, spread: Spread | None) -> TracedLight:
        """Trace rays of the camera.

        Parameters
        ----------
        rays : Rays
        hits : sequence of Hits
            Of each object, as `line_hits` gives them: those behind the origins tell what these are inside.
        pixel : (n,) int64
            Each takes other points of `spread`.
        spread : Spread, optional
            For the microfacets of rough interfaces. Without it all that they do is to blur the environment.
        """
        found = TracedLight(np.zeros((len(rays), 3)), np.ones(len(rays), dtype=bool))
        for channel, own in enumerate(self._channels):
            carried = np.eye(3)[channel] if len(self._channels) > 1 else np.ones(3)
            _Growth(self, own, found, rays.backdrop, pixel, spread).grow(rays, hits, carried)
        return found


class _Growth:
    """Growth of a ray tree, for light with the same indices of refraction."""

    def __init__(
        self, tree: RayTree, own: Optics, found: TracedLight, backdrop: Array, pixel: Integers, spread: Spread | None
    ) -> None:
        self.tree, self.own, self.found = tree, own, found
        self.backdrop, self.pixel, self.spread = backdrop, pixel, spread
        self.scene, self.caster = tree.scene, tree.caster
        self.media = RecordedMedia(tree.scene, own)
        self.legs = LegMedia(tree.scene, own, self.media, tree.light)
        self.interfaces, self.light = Interfaces(tree.caster, own), InterfaceLight(own, tree.light)
        self.shift = tree.scene.camera.eye - tree.caster.center
        # One entry more, at index -1, for nothing.
        kinds = np.zeros((3, len(tree.scene.objects) + 1), dtype=bool)
        kinds[0, own.solids] = kinds[1, own.walls] = True
        kinds[2, [i for i, body in enumerate(tree.scene.objects) if body.medium is None]] = True
        self.is_solid, self.is_wall, self.is_opaque = kinds
        self.is_open = self.is_solid.copy()
        self.is_open[own.solids] = [not tree.scene.objects[i].mesh.diagnosis.solid for i in own.solids]
        self.is_film = np.append(~kinds[:, :-1].any(axis=0), False)

    def grow(self, rays: Rays, hits: Sequence[Hits], carried: Array) -> None:
        """Follow rays of the camera along their branches; each starts with the light `carried` (3,)."""
        count = len(rays)
        with np.errstate(under="ignore"):
            origins = (rays.origins + self.shift) / self.caster.radius
        beams = Beams(
            origins,
            rays.directions,
            np.tile(carried, (count, 1)),
            np.arange(count),
            self._records(hits, count),
            np.zeros(count, np.int64),
            np.full(count, self.tree.forks),
            np.full((count, self.caster.groups), -1),
            np.zeros(count, dtype=bool),
            np.zeros(count),
            self._pixel_footprints(rays.directions),
        )
        # The eye may be far away, where float32 is coarse.
        start = np.maximum(-dot(origins, rays.directions) - BEFORE, 0.0)
        beams = self._step(beams, start)
        while len(beams):
            beams = self._step(beams)

    def _pixel_footprints(self, directions: Array) -> Array:
        """Footprints of rays of the camera; none where the environment is smooth, no picture."""
        seen = self.scene.environment.map is not None
        samples = 1 if self.spread is None else self.spread.samples
        return first_footprints(self.scene.camera, directions, seen * self.tree.pixel, samples, self.caster.radius)

    def _records(self, hits: Sequence[Hits], count: int) -> Record:
        """Records of rays at their origins, from all surfaces behind them."""
        record = empty_records(count)
        behind = [(i, hits[i].where(hits[i].distance < 0)) for i in self.own.solids]
        pixel, distance, sign, item = (
            np.concatenate([np.empty(0, np.int64), *parts])
            for parts in (
                [line.pixel for _, line in behind],
                [line.distance for _, line in behind],
                [line.sign for _, line in behind],
                [np.full(len(line.pixel), i) for i, line in behind],
            )
        )
        order = np.lexsort((distance, pixel))
        ray = pixel[order].astype(np.int64)
        rank = np.arange(len(ray)) - np.searchsorted(ray, ray)
        for level in range(int(rank.max(initial=-1)) + 1):
            now = order[rank == level]
            self._cross(record, ray[rank == level], item[now].astype(np.int16), sign[now] > 0, ray[rank == level])
        return record

    def _cross(self, record: Record, ray: Integers, item: Items, entering: Mask, owner: Integers) -> None:
        """Cross surfaces of solids, each ray (k,) one of them; where this cannot be, the pixel is not valid."""
        on, off = np.flatnonzero(entering), np.flatnonzero(~entering)
        self.found.valid[owner[on[enter(record, ray[on], item[on])]]] = False
        self.found.valid[owner[off[leave(record, ray[off], item[off])]]] = False

    def _step(self, beams: Beams, start: Array | None = None) -> Beams:
        """Follow beams to the next surfaces; what continues from there."""
        end_if_stopped()
        face, distance = self.caster.nearest(beams.origins, beams.directions, beams.last, start)
        self._correct(beams, face, distance)
        place = -largest(-distance)
        free = np.isinf(place)
        self._look_up(beams.where(free))
        open_ended = beams.record[free, 0] != NOTHING
        self.found.valid[beams.owner[free][open_ended]] = False
        met = np.flatnonzero(~free)
        face = np.where(distance[met] <= place[met, None] + TOGETHER, face[met], -1)
        beams = self._through_media(beams.where(met), place[met])
        points = beams.origins + place[met, None] * beams.directions
        footprint = moved_on(beams.footprint, place[met])
        return self._at_surfaces(replace(beams, origins=points, last=face, footprint=footprint))

    def _correct(self, beams: Beams, face: Integers, distance: Array) -> None:
        """Search in float64 where surfaces do not fit the records: beams leave what they are not in, or never leave."""
        place = -largest(-distance)
        doubt: Mask = np.isinf(place) & (beams.record[:, 0] != NOTHING)
        for own, at in zip(face.T, distance.T, strict=True):
            ray = np.flatnonzero((own >= 0) & (at <= place + TOGETHER))
            item = self.caster.faces.item[own[ray]]
            leaves = self.is_solid[item] & ~self._enters(own[ray], beams.directions[ray])
            doubt[ray[leaves & ~has(beams.record[ray], item)]] = True
        some = np.flatnonzero(doubt)
        if some.size:
            face[some], distance[some] = self.caster.nearest_exactly(beams.origins[some], beams.directions[some])

    def _enters(self, face: Integers, directions: Array) -> Mask:
        return np.asarray(dot(self.caster.faces.outward[face], directions) < 0)

    def _through_media(self, beams: Beams, length: Array) -> Beams:
        """Attenuate beams over the distances (n,) to the next surface, in radii, and add what media emit."""
        inside = np.flatnonzero(beams.record[:, 0] != NOTHING)
        if not inside.size:
            return beams
        own = beams.where(inside)
        emitted, passed = self.legs.along(self._rays(own), own.record, length[inside] * self.caster.radius)
        if emitted is not None:
            self._add(own, emitted)
        if self.tree.diffused:
            self._add_haze(own, passed)
        throughput = beams.throughput.copy()
        with np.errstate(under="ignore"):
            throughput[inside] *= passed
        return replace(beams, throughput=throughput)

    def _add_haze(self, beams: Beams, passed: Array) -> None:
        """Add what is scattered ahead, where diffusion takes it for unscattered."""
        ahead, far, near = np.moveaxis(self.tree.diffused.haze(self.media.dominant(beams.record)), 1, 0)
        hazy = np.flatnonzero(ahead.any(axis=1))
        if hazy.size:
            own, ahead, far, near = beams.where(hazy), ahead[hazy], far[hazy], near[hazy]
            # Of the optical depth, which varies as the density does, the part by such events does not count.
            with np.errstate(under="ignore"):
                through = passed[hazy] ** (1.0 - ahead)
            behind, before = (
                self.tree.surroundings.blurred(own, sign * own.directions, HAZE_ROUGHNESS) for sign in (1.0, -1.0)
            )
            self._add(own, (through - passed[hazy]) * (far * behind + near * before))

    def _at_surfaces(self, beams: Beams) -> Beams:
        """Cross the surfaces that beams, with their origins there, have come to; what continues from there."""
        item = np.where(beams.last >= 0, self.caster.faces.item[beams.last], NOTHING)
        beams = self._through_films(beams, item)
        opaque = self.is_opaque[item]
        stopped = np.asarray(opaque.any(axis=1))
        if stopped.any():
            # Whether a ray is rightly in an open body, what is behind the opaque object would tell.
            astray = self.is_open[beams.record[stopped]].any(axis=1)
            self.found.valid[beams.owner[stopped][astray]] = False
            self._end(beams.where(stopped), item[stopped], opaque[stopped].argmax(axis=1))
            beams, item = beams.where(~stopped), item[~stopped]
        before, record = self.media.dominant(beams.record), beams.record.copy()
        for own, face in zip(item.T, beams.last.T, strict=True):
            ray = np.flatnonzero(self.is_solid[own])
            entering = self._enters(face[ray], beams.directions[ray])
            self._cross(record, ray, own[ray].astype(np.int16), entering, beams.owner[ray])
        after = self.media.dominant(record)
        changed = self.own.matters(before, after) | (before != after) & self.tree.diffused.leaves(before, after)
        wall = self.is_wall[item]
        # With a wall of a body at the same place, the wall goes first.
        sheet = ~changed & wall.any(axis=1)
        # The interface is that of the body that is entered; where the ray only leaves one, of that.
        entered = (item == after[:, None]) & (item != NOTHING)
        column = np.where(entered.any(axis=1), entered.argmax(axis=1), (item == before[:, None]).argmax(axis=1))
        column = np.where(sheet, wall.argmax(axis=1), column)
        met = np.flatnonzero(changed | sheet)
        places = Places(
            item[met, column[met]], beams.last[met, column[met]], before[met], np.where(sheet, before, after)[met]
        )
        onwards = np.flatnonzero(~changed & ~sheet)
        straight = replace(beams.where(onwards), record=record[onwards])
        return joined([straight, *self._branches(beams.where(met), record[met], places)])

    def _through_films(self, beams: Beams, item: Integers) -> Beams:
        """Dim beams by sheets without an interface, and add what these emit or show."""
        for column in np.flatnonzero(self.is_film[item].any(axis=0)):
            chosen = np.flatnonzero(self.is_film[item[:, column]])
            own = beams.where(chosen)
            face, ray = own.last[:, column], np.arange(len(own))
            sign = np.where(self._enters(face, own.directions), 1, -1).astype(np.int8)
            weights = self.caster.barycentric(face, own.origins)
            seen = Hits(ray, np.zeros(len(own)), sign, self.caster.faces.number[face], weights)
            shown, passed = self.legs.through_films(self._rays(own), item[chosen, column], seen)
            self._add(own, shown)
            throughput = beams.throughput.copy()
            with np.errstate(under="ignore"):
                throughput[chosen] *= passed
            beams = replace(beams, throughput=throughput)
        return beams

    def _branches(self, beams: Beams, there: Record, places: Places) -> list[Beams]:
        """Branches that are followed from interfaces; `there` are the records behind these."""
        met = self.interfaces.meet(beams, places, self.pixel[beams.owner], self.spread)
        self._add(beams, self.light.radiance(self._rays(beams), met))
        self._add_coats(beams, met)
        beams = replace(beams, met=beams.met + 1)
        back, on = self._both(beams, there, met, places.before == places.after)
        if beams.footprint.size:
            ways = parted(self.caster, beams, places, met)
            back, on = (replace(branch, footprint=way) for branch, way in zip((back, on), ways, strict=True))
        if self.tree.diffused:
            for branch in (back, on):
                points = self._rays(branch).origins + self.scene.camera.eye
                body = self.media.dominant(branch.record)
                self._add(branch, self.tree.diffused.radiance(body, points, branch.directions, met.normals))
        brightness = largest(back.throughput), largest(on.throughput)
        is_back, is_on = (bright > 0.0 for bright in brightness)
        stronger = back.throughput @ LUMINANCE > on.throughput @ LUMINANCE
        more = beams.met < self.tree.depth
        forks = beams.forks > 0
        back = replace(back, forks=np.where(stronger, beams.forks, beams.forks - (is_on & forks)))
        on = replace(on, forks=np.where(stronger, beams.forks - (is_back & forks), beams.forks))
        kept = []
        firsts = stronger | ~is_on, ~stronger | ~is_back
        for branch, bright, first in zip((back, on), brightness, firsts, strict=True):
            exists = bright > 0.0
            follow = more & (first | forks) & (bright >= FAINTEST)
            self._look_up(branch.where(exists & ~follow))
            kept.append(branch.where(follow))
        return kept

    def _add_coats(self, beams: Beams, met: Meetings) -> None:
        """Add the environment as clear coats mirror it that are not as rough as what is below."""
        coated = np.flatnonzero(met.coated)
        if coated.size:
            own = beams.where(coated)
            ways = reflected_direction(own.directions, met.normals[coated])
            mirrored = self.tree.surroundings.blurred(own, ways, met.coat_roughness[coated])
            self._add(own, met.coated[coated, None] * mirrored)

    def _both(self, beams: Beams, there: Record, met: Meetings, sheet: Mask) -> tuple[Beams, Beams]:
        """Reflected and refracted branches at interfaces, those of sheets included; some carry no light."""
        with np.errstate(under="ignore"):
            back, on = beams.throughput * met.reflectance, beams.throughput * met.passing
        ways = met.reflected.copy()
        # A path that ends under total reflection is taken to leave straight on: of all that it might see, this is
        # nearest to the truth.
        trapped = (beams.met >= self.tree.depth) & (largest(met.passed) == 0.0) & ~sheet
        ways[trapped] = beams.directions[trapped]
        mirrored = np.ones(len(beams), dtype=bool)
        reflected = replace(
            beams, directions=unit(ways), throughput=back, reflected=mirrored, blur=beams.blur + met.blur_reflected
        )
        refracted = replace(
            beams,
            directions=unit(met.refracted),
            throughput=on,
            record=np.where(sheet[:, None], beams.record, there),
            blur=beams.blur + met.blur_refracted,
        )
        return reflected, refracted

    def _end(self, beams: Beams, item: Integers, column: Integers) -> None:
        """Add what opaque surfaces reflect at which beams end, those in the `column` (n,) of `item`."""
        ray = np.arange(len(beams))
        number = self.caster.faces.number[beams.last[ray, column]]
        wall = OpaqueHits(np.zeros(len(beams)), item[ray, column], number)
        self._add(beams, reflected_radiance(self.scene, self._rays(beams), wall, self.tree.light.on_opaque))

    def _look_up(self, beams: Beams) -> None:
        if len(beams):
            self._add(beams, self.tree.surroundings.radiance(beams, self._rays(beams)))

    def _rays(self, beams: Beams) -> Rays:
        """The beams in metres from the eye."""
        points = beams.origins * self.caster.radius - self.shift
        return Rays(points, beams.directions, self.backdrop[beams.owner])

    def _add(self, beams: Beams, radiance: Array) -> None:
        with np.errstate(under="ignore", over="ignore"):
            light = beams.throughput * radiance
        for channel in range(3):
            self.found.radiance[:, channel] += np.bincount(beams.owner, light[:, channel], len(self.found.valid))
