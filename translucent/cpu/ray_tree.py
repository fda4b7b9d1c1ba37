"""Radiance along rays that reflect and refract: a ray tree through the scene, all segments of a level at once.

Nested dielectrics are those of Schmidt & Budge 2002, "Simple nested dielectrics in ray traced images". All radiance is
basic radiance L / n^2, which does not change where light enters a denser medium; emission counts as it would in a
medium that is index-matched. `translucent.reference.refracted` follows all branches, and this tree the strongest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.hits import ExactRayCaster
from translucent.cpu.interactions import BranchInteractions, InterfaceHits, InterfaceLight, MicrofacetSamples, interact
from translucent.cpu.interior_list import (
    NOTHING,
    Branches,
    InteriorList,
    InteriorMedia,
    Items,
    empty_interior_lists,
    enter,
    has,
    joined,
    leave,
)
from translucent.cpu.surroundings import Surroundings, first_footprints, moved_on, split_footprints
from translucent.diffusion.field import DiffusionField
from translucent.diffusion.interfaces import AIR, InterfaceTable
from translucent.formulas import optics
from translucent.formulas.diffusion import (
    IN_SCATTERED_ROUGHNESS,
    scattered_ahead,
    staying_fraction,
)
from translucent.formulas.interface import reflected_direction, refracted_direction
from translucent.geometry.ray_caster import dot, unit
from translucent.reference.compositing import composite, emission_of_mixtures
from translucent.reference.hits import Hits, Rays
from translucent.reference.intervals import Intervals
from translucent.reference.light_paths import SurfaceLight, direction_and_distance
from translucent.reference.surfaces import OpaqueHits, reflected_radiance, scene_crossings
from translucent.reference.volume import Volume, volume_segments
from translucent.threads import end_if_stopped


class SegmentMedia:
    """Media of a scene, with emission and transmittance along ray segments.

    Parameters
    ----------
    media : InteriorMedia
    light : SurfaceLight
        On layers.
    """

    def __init__(self, media: InteriorMedia, light: SurfaceLight) -> None:
        self.scene, self.media, self.light, self.volume = light.scene, media, light, Volume(light.scene)
        #: Sheets without an interface.
        table = media.table
        self.films = tuple(None if wall else metres for wall, metres in zip(table.is_wall, table.sheets, strict=False))

    def along(self, rays: Rays, interior: InteriorList, length: Array) -> tuple[Array | None, Array]:
        """Emitted radiance, None if there is none, and transmittance (k, 3) over `length` metres (k,) of rays."""
        if self.scene.varies:
            return self._varied(rays, interior, length)
        extinction, emission = self.media.coefficients(interior)
        with np.errstate(over="ignore", under="ignore"):
            passed = np.exp(-extinction * length[:, None])
            if not self.media.emits:
                return None, passed
            return optics.emitted_radiance(emission, extinction, length[:, None]), passed

    def _varied(self, rays: Rays, interior: InteriorList, length: Array) -> tuple[Array, Array]:
        """Emitted radiance and transmittance (k, 3), as `along`, in media of varying density."""
        ray, entry = np.nonzero(interior != NOTHING)
        # One interval for each entry, however often a body winds around the segment.
        intervals = Intervals(
            ray,
            np.zeros(len(ray)),
            length[ray],
            interior[ray, entry].astype(np.int64),
            np.ones(len(ray), dtype=np.int64),
        )
        return self._composited(rays, intervals, [_no_hits()] * len(self.films), (None,) * len(self.films))

    def through_films(self, rays: Rays, item: Integers, film_hits: Hits) -> tuple[Array, Array]:
        """Emitted radiance and transmittance (k, 3) of sheets, item (k,), at the origins of rays; a hit on each."""
        hits = [_no_hits()] * len(self.films)
        for i in np.unique(item):
            hits[i] = film_hits.where(item == i)
        none = np.empty(0, np.int64)
        return self._composited(rays, Intervals(none, np.empty(0), np.empty(0), none, none), hits, self.films)

    def _composited(
        self, rays: Rays, intervals: Intervals, hits: Sequence[Hits], sheets: Sequence[float | None]
    ) -> tuple[Array, Array]:
        end = np.full(len(rays), np.inf)
        crossings = scene_crossings(self.scene, rays, hits, sheets, end, self.light.on_interfaces)
        segments, filling = volume_segments(self.scene, self.volume, rays, intervals, crossings)
        emitted, depth = composite(emission_of_mixtures(self.volume, rays, segments, filling), len(rays))
        return emitted, optics.transmittance(depth)


def _no_hits() -> Hits:
    none = np.empty(0, np.int64)
    return Hits(none, np.empty(0), np.empty(0, np.int8), none, np.empty((0, 3)))


class DiffusionFields:
    """Subsurface light of the bodies of a scene.

    Parameters
    ----------
    fields : mapping of int to DiffusionField
        By the number of the object.
    """

    def __init__(self, fields: Mapping[int, DiffusionField]) -> None:
        self._fields = dict(fields)

    def __bool__(self) -> bool:
        """True if light diffuses in any body."""
        return bool(self._fields)

    def leaves(self, before: Integers, after: Integers) -> Mask:
        """(k,): whether light diffuses in either of the effective media on the two sides of a surface."""
        return np.asarray(np.isin(np.stack([before, after]), list(self._fields)).any(axis=0))

    def ahead(self, body: Integers) -> Array:
        """(k, 3): fraction of the extinction in bodies (k,) by forward scattering."""
        found = np.zeros((len(body), 3))
        for number, field in self._fields.items():
            found[body == number] = field.ahead
        return found

    def ior(self, body: Integers) -> Array:
        """(k,): indices of refraction of bodies (k,) in which light diffuses, 1 of others."""
        found = np.ones(len(body))
        for number, field in self._fields.items():
            found[body == number] = field.ior
        return found

    def environment_behind(self, body: Integers, directions: Array, depth: Array, other: Array) -> Array:
        """(k, 3): environment in directions (k, 3), as bodies (k,) blur it by scattering of depths (k, 3) ahead.

        It is `other` (k, 3) for bodies that hold no picture of it.
        """
        found = other.copy()
        for number, field in self._fields.items():
            if field.behind is not None and (chosen := np.flatnonzero(body == number)).size:
                found[chosen] = field.behind.at(directions[chosen], depth[chosen] / field.phase.mean_cosine)
        return found

    def anisotropy(self, body: Integers) -> Array:
        """(k,): g of bodies (k,) in which light diffuses and that scatter ahead, 0 of others."""
        found = np.zeros(len(body))
        for number, field in self._fields.items():
            found[body == number] = max(field.phase.mean_cosine, 0.0)
        return found

    def irradiance_entering(self, body: Integers, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance of light that enters bodies (k,), see `DiffusionField.irradiance_entering`."""
        found = np.zeros(points.shape)
        for number, field in self._fields.items():
            own = np.flatnonzero(body == number)
            found[own] = field.irradiance_entering(points[own], normals[own])
        return found

    def radiance(
        self, body: Integers, points: Array, directions: Array, normals: Array, path: Array, optical_depth: Array
    ) -> Array:
        """(k, 3): basic radiance against rays that start at points (k, 3) of surfaces, inside `body` (k,).

        As if all light was scattered on the rest of their `path` (k,), in metres, through the body, with an
        `optical_depth` (k, 3). `normals` (k, 3) look outwards; where they are 0 there is no surface, and no light.
        """
        found = np.zeros(points.shape)
        cosine, surface = np.abs(dot(directions, normals)), normals.any(axis=1)
        for number, field in self._fields.items():
            own = np.flatnonzero((body == number) & surface)
            if own.size:
                rays = normals[own], directions[own]
                above = field.above_last_events(points[own], *rays, path[own], optical_depth[own])
                found[own] = field.scattered_radiance(above, *rays, cosine[own])
        return found


#: Throughput below which a branch is not followed: it looks up the environment at once.
FAINTEST = 1.0 / 1024.0

#: Largest distance between surfaces in one place, in radii of the scene.
TOGETHER = 1e-7

#: Luminance of linear RGB (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def largest(values: Array) -> Array:
    """(k,): largest of the columns of (k, n), n at least 1."""
    found = values[:, 0]
    for column in values.T[1:]:
        found = np.maximum(found, column)
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class TracedLight:
    """Radiance (n, 3) of rays, and whether (n,) all their branches left the bodies that they entered."""

    radiance: Array
    valid: Mask


class RayTree:
    """Tracer of the camera's rays through the interfaces of a scene.

    At an interface that reflects and refracts, the stronger branch is followed. The weaker one is followed, too, where
    the path has forks left, and uses up one; else it sees the environment in its direction, as if nothing were
    ahead, blurred where it is in a body. So do both at the last interface.

    Parameters
    ----------
    light : SurfaceLight
        On the surfaces of the scene.
    caster : ExactRayCaster
        Of the objects of the scene.
    aspect : float
        Width of the picture divided by its height.
    depth : int
        Interfaces that a path crosses, at most.
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
        caster: ExactRayCaster,
        aspect: float,
        depth: int,
        forks: int,
        diffused: DiffusionFields,
        pixel: float = 0.0,
    ) -> None:
        scene = light.scene
        self.light, self.scene, self.caster, self.depth, self.forks = light, scene, caster, depth, forks
        self.diffused, self.pixel = diffused, pixel
        self.surroundings = Surroundings(scene, aspect)
        self.table = InterfaceTable(scene, light.paths.sheets)
        self._channels = (0, 1, 2) if self.table.dispersed else (1,)

    def see(self, rays: Rays, hits: Sequence[Hits], pixel: Integers, spread: MicrofacetSamples | None) -> TracedLight:
        """Trace rays of the camera.

        Parameters
        ----------
        rays : Rays
        hits : sequence of Hits
            Of each object, as `line_hits` gives them: those behind the origins decide which bodies these are inside.
        pixel : (n,) int64
            Each takes other points of `spread`.
        spread : Spread, optional
            For the microfacets of rough interfaces. Without it all that they do is to blur the environment.
        """
        found = TracedLight(np.zeros((len(rays), 3)), np.ones(len(rays), dtype=bool))
        for channel in self._channels:
            carried = np.eye(3)[channel] if len(self._channels) > 1 else np.ones(3)
            _Growth(self, channel, found, rays.backdrop, pixel, spread).grow(rays, hits, carried)
        return found


def _from_inside(branches: Branches, normals: Array) -> Branches:
    """Branches that start inside bodies at surfaces with `normals` (n, 3), with these outwards."""
    along = dot(branches.directions, normals)
    return replace(branches, outwards=np.where(along[:, None] < 0.0, normals, -normals))


class _Growth:
    """Growth of a ray tree, for light with the same indices of refraction."""

    def __init__(
        self,
        tree: RayTree,
        channel: int,
        found: TracedLight,
        backdrop: Array,
        pixel: Integers,
        spread: MicrofacetSamples | None,
    ) -> None:
        self.tree, self.table, self.channel, self.found = tree, tree.table, channel, found
        self.backdrop, self.pixel, self.spread = backdrop, pixel, spread
        self.scene, self.caster = tree.scene, tree.caster
        self.media = InteriorMedia(self.table)
        self.segments, self.light = SegmentMedia(self.media, tree.light), InterfaceLight(self.table, tree.light)
        self.shift = tree.scene.camera.eye - tree.caster.center
        self.is_open = self.table.is_solid.copy()
        for i in np.flatnonzero(self.is_open).tolist():
            self.is_open[i] = not tree.scene.objects[i].mesh.diagnosis.solid

    def grow(self, rays: Rays, hits: Sequence[Hits], carried: Array) -> None:
        """Follow rays of the camera along their branches; each starts with the light `carried` (3,)."""
        count = len(rays)
        with np.errstate(under="ignore"):
            origins = (rays.origins + self.shift) / self.caster.radius
        branches = Branches(
            origins,
            rays.directions,
            np.tile(carried, (count, 1)),
            np.arange(count),
            self._interior_lists(hits, count),
            np.zeros(count, np.int64),
            np.full(count, self.tree.forks),
            np.full((count, self.caster.groups), -1),
            np.zeros(count, dtype=bool),
            np.zeros(count),
            self._pixel_footprints(rays.directions),
            np.zeros((count, 3)),
            np.zeros((count, 3)),
            np.full(count, NOTHING, np.int64),
        )
        while len(branches):
            branches = self._step(branches)

    def _pixel_footprints(self, directions: Array) -> Array:
        """Footprints of rays of the camera; none where the environment is smooth, no picture."""
        has_map = self.scene.environment.map is not None
        samples = 1 if self.spread is None else self.spread.samples
        return first_footprints(self.scene.camera, directions, has_map * self.tree.pixel, samples, self.caster.radius)

    def _interior_lists(self, hits: Sequence[Hits], count: int) -> InteriorList:
        """Interior lists of rays at their origins, from all surfaces behind these."""
        interior = empty_interior_lists(count)
        behind = [(i, hits[i].where(hits[i].distance < 0)) for i in np.flatnonzero(self.table.is_solid).tolist()]
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
            self._cross(interior, ray[rank == level], item[now].astype(np.int16), sign[now] > 0, ray[rank == level])
        return interior

    def _cross(self, interior: InteriorList, ray: Integers, item: Items, entering: Mask, owner: Integers) -> None:
        """Update interior lists at surfaces of solids; pixels whose lists contradict the surface are invalid."""
        on, off = np.flatnonzero(entering), np.flatnonzero(~entering)
        self.found.valid[owner[on[enter(interior, ray[on], item[on])]]] = False
        self.found.valid[owner[off[leave(interior, ray[off], item[off])]]] = False

    def _step(self, branches: Branches) -> Branches:
        """Follow branches to the next surfaces, and return the branches that continue from there."""
        end_if_stopped()
        face, distance = self.caster.nearest(branches.origins, branches.directions, branches.last)
        self._correct(branches, face, distance)
        place = -largest(-distance)
        free = np.isinf(place)
        self._look_up(branches.where(free))
        open_ended = branches.interior[free, 0] != NOTHING
        self.found.valid[branches.owner[free][open_ended]] = False
        hit = np.flatnonzero(~free)
        face = np.where(distance[hit] <= place[hit, None] + TOGETHER, face[hit], -1)
        branches = self._through_media(branches.where(hit), place[hit], face)
        points = branches.origins + place[hit, None] * branches.directions
        footprint = moved_on(branches.footprint, place[hit])
        return self._at_surfaces(replace(branches, origins=points, last=face, footprint=footprint))

    def _correct(self, branches: Branches, face: Integers, distance: Array) -> None:
        """Search again in float64 where hits contradict interior lists: a branch leaves a body that it is not in."""
        place = -largest(-distance)
        doubt: Mask = np.isinf(place) & (branches.interior[:, 0] != NOTHING)
        for own, at in zip(face.T, distance.T, strict=True):
            ray = np.flatnonzero((own >= 0) & (at <= place + TOGETHER))
            item = self.caster.faces.item[own[ray]]
            leaves = self.table.is_solid[item] & ~self._enters(own[ray], branches.directions[ray])
            doubt[ray[leaves & ~has(branches.interior[ray], item)]] = True
        some = np.flatnonzero(doubt)
        if some.size:
            face[some], distance[some] = self.caster.nearest_exactly(branches.origins[some], branches.directions[some])

    def _enters(self, face: Integers, directions: Array) -> Mask:
        return np.asarray(dot(self.caster.faces.outward[face], directions) < 0)

    def _through_media(self, branches: Branches, length: Array, face: Integers) -> Branches:
        """Attenuate branches over the distances (n,) in radii to the next faces (n, m), and add what media emit."""
        inside = np.flatnonzero(branches.interior[:, 0] != NOTHING)
        if not inside.size:
            return branches
        own = branches.where(inside)
        emitted, passed = self.segments.along(self._rays(own), own.interior, length[inside] * self.caster.radius)
        if emitted is not None:
            self._add(own, emitted)
        throughput, ahead, ahead_body = branches.throughput.copy(), branches.ahead.copy(), branches.ahead_body.copy()
        if self.tree.diffused:
            self._add_diffused(own, passed, length[inside])
            hits = face[inside]
            items = np.where(hits >= 0, self.caster.faces.item[hits], NOTHING)
            on = np.flatnonzero(~self.table.is_opaque[items].any(axis=1))  # others end on an opaque object
            self._add_ahead_from_lights(own.where(on), length[inside][on] * self.caster.radius, passed[on])
            body = self.media.effective(own.interior)
            counted = self.tree.diffused.ahead(body)
            ahead[inside] -= counted * np.log(np.maximum(passed, np.finfo(np.float64).tiny))
            ahead_body[inside] = np.where(counted.any(axis=1), body, ahead_body[inside])
            # Diffusion counts light that is scattered ahead as unscattered, and so do branches.
            with np.errstate(under="ignore"):
                passed = passed ** (1.0 - counted)
        with np.errstate(under="ignore"):
            throughput[inside] *= passed
        return replace(branches, throughput=throughput, ahead=ahead, ahead_body=ahead_body)

    def _add_diffused(self, branches: Branches, passed: Array, length: Array) -> None:
        """Add subsurface light."""
        body = self.media.effective(branches.interior)
        optical_depth, rays = -np.log(np.maximum(passed, np.finfo(np.float64).tiny)), self._rays(branches)
        points, path = rays.origins + self.scene.camera.eye, length * self.caster.radius
        diffused = self.tree.diffused.radiance(body, points, rays.directions, branches.outwards, path, optical_depth)
        with np.errstate(under="ignore"):
            self._add(branches, diffused * (1.0 - passed ** (1.0 - self.tree.diffused.ahead(body))))

    def _add_ahead_from_lights(self, branches: Branches, length: Array, passed: Array) -> None:
        """Add light of the lights that is scattered ahead in walls of parallel sides; length (n,) in metres."""
        body = self.media.effective(branches.interior)
        anisotropy, leaving = self.tree.diffused.anisotropy(body), -dot(branches.outwards, branches.directions)
        walls = np.flatnonzero((anisotropy > 0.0) & (leaving > 0.0))
        if not walls.size:
            return
        branches, anisotropy, leaving = branches.where(walls), anisotropy[walls], leaving[walls]
        rays, ahead = self._rays(branches), self.tree.diffused.ahead(body[walls])
        ends = rays.origins + length[walls, None] * rays.directions
        depth = -np.log(np.maximum(passed[walls], np.finfo(np.float64).tiny))
        found, eye, ior = np.zeros(ends.shape), self.scene.camera.eye, self.tree.diffused.ior(body[walls])
        entering = self.tree.diffused.irradiance_entering(body[walls], ends + eye, rays.directions)
        for light in self.tree.light.paths.lights:
            travel, _ = direction_and_distance(light, ends)
            down = dot(branches.outwards, travel)
            lit = np.flatnonzero(down > 0.0)
            inside = refracted_direction(travel[lit], -branches.outwards[lit], ior[lit])
            within, turn = dot(branches.outwards[lit], inside), -dot(branches.directions[lit], inside)
            enters = (1.0 - optics.fresnel_dielectric(down[lit], ior[lit])) * down[lit] / within
            along = depth[lit] * (leaving[lit] / within)[:, None]
            staying = staying_fraction(leaving, anisotropy)[lit, None]
            part = scattered_ahead(along, ahead[lit], anisotropy[lit, None], turn[:, None], staying)
            part /= 4.0 * np.pi * ior[lit, None] ** 2
            arriving = enters[:, None] * light.irradiance_on(ends[lit], -travel[lit])
            # None where the body itself is before the light.
            sums = entering[lit].sum(axis=1), np.maximum(arriving.sum(axis=1), np.finfo(np.float64).tiny)
            part *= np.minimum(sums[0] / sums[1], 1.0)[:, None]
            found[lit] += part * arriving * self.tree.light.to_interfaces(light, ends[lit])
        self._add(branches, found)

    def _at_surfaces(self, branches: Branches) -> Branches:
        """Interact branches with the surfaces at their origins, and return the branches that continue."""
        item = np.where(branches.last >= 0, self.caster.faces.item[branches.last], NOTHING)
        branches = self._through_films(branches, item)
        opaque = self.table.is_opaque[item]
        stopped = np.asarray(opaque.any(axis=1))
        if stopped.any():
            # Only surfaces behind the opaque object would show that a ray is rightly in an open body.
            astray = self.is_open[branches.interior[stopped]].any(axis=1)
            self.found.valid[branches.owner[stopped][astray]] = False
            self._end(branches.where(stopped), item[stopped], opaque[stopped].argmax(axis=1))
            branches, item = branches.where(~stopped), item[~stopped]
        before, interior = self.media.effective(branches.interior), branches.interior.copy()
        for own, face in zip(item.T, branches.last.T, strict=True):
            ray = np.flatnonzero(self.table.is_solid[own])
            entering = self._enters(face[ray], branches.directions[ray])
            self._cross(interior, ray, own[ray].astype(np.int16), entering, branches.owner[ray])
        after = self.media.effective(interior)
        changed = self.table.alters_light(before, after, self.channel)
        changed |= (before != after) & self.tree.diffused.leaves(before, after)
        column, sheet = self.table.interfaces(item, before, after, changed, self.table.is_wall)
        interacting = np.flatnonzero(changed | sheet)
        places = InterfaceHits(
            item[interacting, column[interacting]],
            branches.last[interacting, column[interacting]],
            before[interacting],
            np.where(sheet, before, after)[interacting],
        )
        onwards = np.flatnonzero(~changed & ~sheet)
        straight = replace(branches.where(onwards), interior=interior[onwards])
        return joined([straight, *self._branches(branches.where(interacting), interior[interacting], places)])

    def _through_films(self, branches: Branches, item: Integers) -> Branches:
        """Attenuate branches by sheets without an interface, and add the radiance of these."""
        for column in np.flatnonzero(self.table.is_film[item].any(axis=0)):
            chosen = np.flatnonzero(self.table.is_film[item[:, column]])
            own = branches.where(chosen)
            face, ray = own.last[:, column], np.arange(len(own))
            sign = np.where(self._enters(face, own.directions), 1, -1).astype(np.int8)
            weights = self.caster.barycentric(face, own.origins)
            film_hits = Hits(ray, np.zeros(len(own)), sign, self.caster.faces.number[face], weights)
            emitted, passed = self.segments.through_films(self._rays(own), item[chosen, column], film_hits)
            self._add(own, emitted)
            throughput = branches.throughput.copy()
            with np.errstate(under="ignore"):
                throughput[chosen] *= passed
            branches = replace(branches, throughput=throughput)
        return branches

    def _branches(self, branches: Branches, there: InteriorList, places: InterfaceHits) -> list[Branches]:
        """Reflected and refracted branches that are followed; `there` are the interior lists behind the interfaces."""
        pixel = self.pixel[branches.owner]
        found = interact(self.table, self.channel, self.caster, branches, places, pixel, self.spread)
        first = (branches.depth == 0) & (places.before == AIR)
        self._add(branches, self.light.radiance(self._rays(branches), found, first))
        self._add_coats(branches, found)
        branches = replace(branches, depth=branches.depth + 1)
        back, on = self._both(branches, there, found)
        if branches.footprint.size:
            footprints = split_footprints(self.caster, branches, places, found)
            back, on = (
                replace(branch, footprint=footprint) for branch, footprint in zip((back, on), footprints, strict=True)
            )
        if self.tree.diffused:
            back, on = (_from_inside(branch, found.at.normal) for branch in (back, on))
        brightness = largest(back.throughput), largest(on.throughput)
        is_back, is_on = (bright > 0.0 for bright in brightness)
        stronger = back.throughput @ LUMINANCE > on.throughput @ LUMINANCE
        more = branches.depth < self.tree.depth
        forks = branches.forks > 0
        back = replace(back, forks=np.where(stronger, branches.forks, branches.forks - (is_on & forks)))
        on = replace(on, forks=np.where(stronger, branches.forks - (is_back & forks), branches.forks))
        kept = []
        firsts = stronger | ~is_on, ~stronger | ~is_back
        for branch, bright, first in zip((back, on), brightness, firsts, strict=True):
            exists = bright > 0.0
            follow = more & (first | forks) & (bright >= FAINTEST)
            ended = branch.where(exists & ~follow)
            # Where light leaves a body is not known: it is as blurred as the roughest mirror shows the environment.
            inside = ended.interior[:, 0] != NOTHING
            self._look_up(replace(ended, blur=np.where(inside, 1.0, ended.blur)))
            kept.append(branch.where(follow))
        return kept

    def _add_coats(self, branches: Branches, found: BranchInteractions) -> None:
        """Add the environment's reflection in clear coats whose roughness differs from that of the interface below."""
        coated = np.flatnonzero(found.coated)
        if coated.size:
            own = branches.where(coated)
            directions = reflected_direction(own.directions, found.at.normal[coated])
            mirrored = self.tree.surroundings.blurred(own, directions, found.coat_roughness[coated])
            self._add(own, found.coated[coated, None] * mirrored)

    def _both(self, branches: Branches, there: InteriorList, found: BranchInteractions) -> tuple[Branches, Branches]:
        """Reflected and refracted branches at interfaces and sheets; some carry no light."""
        with np.errstate(under="ignore"):
            back, on = branches.throughput * found.reflectance, branches.throughput * found.passing
        reflected_directions = found.reflected.copy()
        # A path that ends under total reflection is taken to leave straight on: of all that it might see, this is
        # nearest to the truth.
        trapped = (branches.depth >= self.tree.depth) & (largest(found.transmittance) == 0.0) & ~found.at.thin_walled
        reflected_directions[trapped] = branches.directions[trapped]
        mirrored = np.ones(len(branches), dtype=bool)
        reflected = replace(
            branches,
            directions=unit(reflected_directions),
            throughput=back,
            reflected=mirrored,
            blur=branches.blur + found.blur_reflected,
        )
        refracted = replace(
            branches,
            directions=unit(found.refracted),
            throughput=on,
            interior=np.where(found.at.thin_walled[:, None], branches.interior, there),
            blur=branches.blur + found.blur_refracted,
        )
        return reflected, refracted

    def _end(self, branches: Branches, item: Integers, column: Integers) -> None:
        """End branches at opaque objects, `item` at `column` (n,), and add what these reflect."""
        ray = np.arange(len(branches))
        face = branches.last[ray, column]
        weights = self.caster.barycentric(face, branches.origins)
        wall = OpaqueHits(np.zeros(len(branches)), item[ray, column], self.caster.faces.number[face], weights)
        self._add(branches, reflected_radiance(self.scene, self._rays(branches), wall, self.tree.light.on_opaque))

    def _look_up(self, branches: Branches) -> None:
        if not len(branches):
            return
        radiance = self.tree.surroundings.radiance(branches, self._rays(branches))
        blurred = np.flatnonzero(branches.ahead.any(axis=1))
        if blurred.size:
            own = branches.where(blurred)
            around = self.tree.surroundings.blurred(own, own.directions, IN_SCATTERED_ROUGHNESS)
            around = self.tree.diffused.environment_behind(own.ahead_body, own.directions, own.ahead, around)
            with np.errstate(under="ignore"):
                radiance[blurred] = around + np.exp(-own.ahead) * (radiance[blurred] - around)
        self._add(branches, radiance)

    def _rays(self, branches: Branches) -> Rays:
        """The branches in metres from the eye."""
        points = branches.origins * self.caster.radius - self.shift
        return Rays(points, branches.directions, self.backdrop[branches.owner])

    def _add(self, branches: Branches, radiance: Array) -> None:
        with np.errstate(under="ignore", over="ignore"):
            light = branches.throughput * radiance
        for channel in range(3):
            self.found.radiance[:, channel] += np.bincount(branches.owner, light[:, channel], len(self.found.valid))
