"""Surfaces that photons meet: the nearest ones by Embree, the media on both sides, and what they do to light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.diffusion.dimming import embree_mesh
from translucent.formulas import optics
from translucent.formulas.bsdf import (
    Lobes,
    below_coat,
    interface_lobes,
    kept_on_side,
    microfacet_normal,
    sampled_branches,
)
from translucent.formulas.interface import CLEARCOAT_IOR, channel_iors, reflected_direction, refracted_direction
from translucent.geometry.embree import STEP, starts
from translucent.geometry.normals import drawn_normals
from translucent.media.medium import Medium
from translucent.planning.bodies import same_medium
from translucent.planning.rendered import scatterer_of
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: Faces of one object of which none counts after which a ray passes it.
MOST_REJECTED = 4

#: Largest error, in radii of a mesh, of a place on the plane of a face: beyond it the ray runs along the plane.
PLANE_ERROR = 1e-4

#: Distance within which surfaces are in one place, as a share of the scene's diagonal.
TOGETHER = 1e-7

#: Smallest cosine between a smooth normal and a ray that meets it.
EDGE_ON = 1e-3

#: Index of no object.
AIR = -1


@dataclass(frozen=True, eq=False)
class Met:
    """Surfaces that rays meet first.

    Attributes
    ----------
    distance : (n,) float64
        In metres, inf for none.
    faces : (n, objects) int64
        Of each object in that place, -1 for none.
    """

    distance: Array
    faces: Integers

    def where(self, chosen: Mask) -> Met:
        """Selection of rays."""
        return Met(self.distance[chosen], self.faces[chosen])


@dataclass(eq=False)
class Turn:
    """Photons at surfaces.

    Attributes
    ----------
    directions, power : (n, 3) float64
        Beyond.
    passes : (n,) bool
        They are on the other side.
    straight : (n,) bool
        Nothing has happened to their direction.
    bent : (n,) bool
        They have been bent or mirrored.
    ended : (n,) bool
        They have met something opaque.
    """

    directions: Array
    power: Array
    passes: Mask
    straight: Mask
    bent: Mask
    ended: Mask


class PhotonSurfaces:
    """Surfaces of a scene.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        objects = scene.objects
        self._shapes = [_Shape(item) for item in objects]
        self._opaque = np.array([item.medium is None for item in objects])
        self._sheet = np.array([item.sheet_thickness is not None for item in objects])
        self._walls = np.array([item.has_interface for item in objects])
        self._metres = np.array([item.sheet_thickness or 0.0 for item in objects])
        self._sheet_extinction = np.stack(
            [np.zeros(3) if item.medium is None else np.asarray(item.medium.extinction) for item in objects]
        )
        self._unseen = np.array([item.covers for item in objects])
        self._solid = ~self._opaque & ~self._sheet
        counts = [item.has_interface or scene.overlap == "priority" for item in objects]
        self._decides = self._solid & np.array(counts)
        self._rank = np.unique([item.priority for item in objects], return_inverse=True)[1].ravel()
        looks = [item.surface or Surface() for item in objects]
        iors = channel_iors(
            [item.medium.ior if item.medium else 1.0 for item in objects], [s.dispersion for s in looks]
        )
        self._iors = np.vstack([iors, np.ones(3)])
        self._plain = np.array([*(item.plain for item in objects), True])
        self._alpha = np.array([look.roughness for look in looks]) ** 2
        self._films = np.array([(s.iridescence, s.iridescence_ior, s.iridescence_thickness) for s in looks], np.float64)
        self._coats = np.array([look.clearcoat for look in looks])
        self._tint = np.array([look.transmission * np.asarray(look.color, np.float64) for look in looks])
        self._transmission = np.array([look.transmission for look in looks])
        self.disperses = any(look.dispersion > 0.0 for look, own in zip(looks, ~self._opaque, strict=True) if own)
        #: (objects, 3): in 1/m; what is scattered ahead counts as unscattered.
        self.extinction = np.stack([_reduced(item) for item in objects])

    def nearest(self, origins: Array, directions: Array, last: Integers) -> Met:
        """First surfaces ahead of rays, but for the faces (n, objects) that they are on."""
        count = len(self._shapes)
        faces, distance = np.full((len(origins), count), -1), np.full((len(origins), count), np.inf)
        for i in np.flatnonzero(~self._unseen):
            faces[:, i], distance[:, i] = self._shapes[i].nearest(origins, directions, last[:, i])
        nearest = distance.min(axis=1, initial=np.inf)
        here = distance <= nearest[:, None] + TOGETHER * self.scene.diagonal
        return Met(nearest, np.where(here & (faces >= 0), faces, -1))

    def crossed(
        self, windings: npt.NDArray[np.int16], since: Integers, met: Met, directions: Array
    ) -> tuple[npt.NDArray[np.int16], Integers]:
        """Counts of how often rays are in each object beyond surfaces, and when they came in."""
        windings, since = windings.copy(), since.copy()
        time = since.max(axis=1, initial=0) + 1
        for i in np.flatnonzero(self._solid):
            ray = np.flatnonzero(met.faces[:, i] >= 0)
            enters = (self._shapes[i].outward[met.faces[ray, i]] * directions[ray]).sum(axis=1) < 0.0
            windings[ray, i] += np.where(enters, 1, -1).astype(np.int16)
            first = ray[enters & (windings[ray, i] == 1)]
            since[first, i] = time[first]
        return windings, since

    def dominant(self, windings: npt.NDArray[np.int16], since: Integers) -> Integers:
        """(n,): object that decides the index of refraction, or `AIR` (Schmidt & Budge 2002)."""
        key = np.where((windings > 0) & self._decides, self._rank * (1 << 40) + since, -1)
        best = key.argmax(axis=1)
        return np.where(key[np.arange(len(key)), best] >= 0, best, AIR)

    def filling(self, windings: npt.NDArray[np.int16], since: Integers) -> Array:
        """(n, objects): how often each medium fills the places of rays."""
        found = np.where(self._solid, np.maximum(windings, 0), 0).astype(np.float64)
        if self.scene.overlap == "priority":
            own = np.arange(found.shape[1]) == self.dominant(windings, since)[:, None]
            return np.where(own & (found > 0.0), 1.0, 0.0)
        if self.scene.overlap == "union":
            found = np.minimum(found, 1.0)
            for one, other in self._alike:
                found[:, other] *= found[:, one] == 0.0
        return found

    @cached_property
    def _alike(self) -> list[tuple[int, int]]:
        """Pairs of objects with one medium."""
        objects = self.scene.objects
        solid = [int(i) for i in np.flatnonzero(self._solid)]
        return [(i, j) for j in solid for i in solid if i < j and same_medium(objects[i], objects[j])]

    def turned(
        self,
        met: Met,
        points: Array,
        directions: Array,
        before: Integers,
        after: Integers,
        channel: Integers,
        power: Array,
        rng: np.random.Generator,
    ) -> Turn:
        """Fate of photons at surfaces, between the objects that decide on both sides, one branch by chance."""
        count = len(points)
        there = met.faces >= 0
        ended = (there & self._opaque).any(axis=1)
        # No light moves through edges of meshes unseen: what would be in the air again leaves.
        differs = self._iors[before, channel] != self._iors[after, channel]
        solid = (before != after) & (differs | ~self._plain[before] | ~self._plain[after]) & ~ended
        sheets = there & self._sheet
        sheet = sheets.any(axis=1) & ~solid & ~ended
        found = Turn(
            directions.copy(),
            power.copy(),
            np.ones(count, dtype=bool),
            ~solid,
            np.zeros(count, dtype=bool),
            ended,
        )
        entered = there[np.arange(count), after] & (after != AIR)
        item = np.where(sheet, sheets.argmax(axis=1), np.where(entered, after, before))
        own = np.flatnonzero((solid | sheet) & there[np.arange(count), item])
        if own.size:
            self._interfaces(found, own, item[own], met, points, before, after, channel, sheet, rng)
        return found

    def _interfaces(
        self,
        found: Turn,
        own: Integers,
        item: Integers,
        met: Met,
        points: Array,
        before: Integers,
        after: Integers,
        channel: Integers,
        sheet: Mask,
        rng: np.random.Generator,
    ) -> None:
        sheet, way = sheet[own], found.directions[own]
        smooth, flat = self._normals(item, met.faces[own, item], points[own], way)
        other = np.where(sheet, item, after[own])
        ior = self._iors[other, channel[own]] / self._iors[before[own], channel[own]]
        facets = _facets(smooth, way, np.where(sheet | (ior == 1.0), 0.0, self._alpha[item]), rng)
        enters = sheet | (item == other)
        lobes = self._lobes(item, facets, way, ior, self._iors[before[own], channel[own]], sheet, enters)
        tint = np.where(enters[:, None], self._tint[item], self._transmission[item, None])
        lobes = Lobes(lobes.reflection, lobes.transmission * tint)
        passes, weight = sampled_branches(lobes, found.power[own], 1.0 - rng.random(len(own)))
        found.power[own] *= weight
        refracted = np.where(sheet[:, None], way, refracted_direction(way, facets, ior))
        onward = np.where(passes[:, None], refracted, reflected_direction(way, facets))
        onward = kept_on_side(onward, np.where(passes[:, None], -flat, flat))
        found.directions[own] = onward / np.linalg.norm(onward, axis=1, keepdims=True)
        found.passes[own] = passes
        found.straight[own] = passes & (sheet | (ior == 1.0))
        found.bent[own] = ~found.straight[own]

    def _lobes(
        self, item: Integers, facets: Array, way: Array, ior: Array, ior_before: Array, sheet: Mask, enters: Mask
    ) -> Lobes:
        """Lobes of interfaces at microfacets, with their films and, from outside, their clear coats."""
        cosine = np.clip(-(facets * way).sum(axis=1), 0.0, 1.0)
        bare = np.where(sheet & ~self._walls[item], 0.0, optics.fresnel_dielectric(cosine, ior))
        path = optics.thin_layer_thickness(self._metres[item], cosine, ior)
        depth = self._sheet_extinction[item] * path[:, None]
        lobes, _ = interface_lobes(bare, cosine, ior, self._films[item], ior_before, sheet, depth)
        coat = np.where(enters, self._coats[item], 0.0) * optics.fresnel_dielectric(cosine, CLEARCOAT_IOR)
        below = below_coat(lobes, coat[:, None])
        return Lobes(below.reflection + coat[:, None], below.transmission)

    def _normals(self, item: Integers, face: Integers, points: Array, way: Array) -> tuple[Array, Array]:
        """Unit normals (k, 3) towards where photons come from: of smooth surfaces, and of their faces."""
        smooth, flat = np.zeros((2, len(item), 3))
        for i in np.unique(item):
            own = np.flatnonzero(item == i)
            smooth[own], flat[own] = self._shapes[i].normals(face[own], points[own])
        away = (flat * way).sum(axis=1) > 0.0
        flat[away] *= -1.0
        smooth[away] *= -1.0
        facing = (smooth * way).sum(axis=1)
        edge_on = facing > -EDGE_ON
        smooth[edge_on] -= (facing[edge_on] + EDGE_ON)[:, None] * way[edge_on]
        return smooth / np.linalg.norm(smooth, axis=1, keepdims=True), flat


class _Shape:
    """Faces of an object in the world."""

    def __init__(self, body: Object) -> None:
        self._body = body
        self._embree = embree_mesh(body.mesh)
        linear = body.matrix[:3, :3]
        self._into = np.linalg.inv(linear)
        self._corners = (body.mesh.vertices @ linear.T + body.matrix[:3, 3])[body.mesh.faces]
        side = -1.0 if body.mesh.diagnosis.inverted else 1.0
        normals = side * body.mesh.face_normals @ self._into
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        #: (m, 3): unit normals out of the body.
        self.outward = normals / np.where(length > 0.0, length, 1.0)
        self._side = side

    def nearest(self, origins: Array, directions: Array, last: Integers) -> tuple[Integers, Array]:
        """Nearest faces ahead (n,), -1 for none, and their distances in metres; but for the last ones."""
        embree, body = self._embree, self._body
        local = ((origins - body.matrix[:3, 3]) @ self._into.T - embree.center) / embree.radius
        ways = directions @ self._into.T / embree.radius
        scale = np.linalg.norm(ways, axis=1)
        ways /= scale[:, None]
        face, distance = np.full(len(origins), -1), np.full(len(origins), np.inf)
        start, live = np.maximum(starts(local, ways), STEP), np.arange(len(origins))
        closest = np.linalg.norm(local - (local * ways).sum(axis=1)[:, None] * ways, axis=1)
        live = live[(closest < 1.0 + STEP) & ((local * ways).sum(axis=1) < 1.0 + STEP)]
        for _ in range(MOST_REJECTED):
            if not live.size:
                break
            own, rough = embree.first_hits(local[live] + start[live, None] * ways[live], ways[live])
            live, own, rough = live[own >= 0], own[own >= 0], rough[own >= 0]
            rough = (rough + start[live]) / scale[live]
            exact = self._on_planes(own, origins[live], directions[live], rough, PLANE_ERROR / scale[live])
            counts = (own != last[live]) & (exact > 0.0)
            face[live[counts]], distance[live[counts]] = own[counts], exact[counts]
            start[live] = rough * scale[live] + STEP
            live = live[~counts]
        return face, distance

    def _on_planes(self, face: Integers, origins: Array, directions: Array, rough: Array, most: Array) -> Array:
        """(k,): distances to the planes of faces, near those that float32 knows."""
        normal = self.outward[face]
        slope = (directions * normal).sum(axis=1)
        exact = ((self._corners[face, 0] - origins) * normal).sum(axis=1) / np.where(slope == 0.0, np.inf, slope)
        return np.where(np.abs(exact - rough) <= most, exact, rough)

    def normals(self, face: Integers, points: Array) -> tuple[Array, Array]:
        """Unit normals out of the body at points (k, 3) on faces (k,): smooth ones, and those of the faces."""
        first, one, other = self._corners[face].transpose(1, 0, 2)
        one, other, across = one - first, other - first, points - first
        a, b, c = ((x * y).sum(axis=1) for x, y in ((one, one), (one, other), (other, other)))
        p, q = (across * one).sum(axis=1), (across * other).sum(axis=1)
        area = np.where(a * c - b * b > 0.0, a * c - b * b, 1.0)
        v, w = np.clip((c * p - b * q) / area, 0.0, 1.0), np.clip((a * q - b * p) / area, 0.0, 1.0)
        weights = np.stack([np.maximum(1.0 - v - w, 0.0), v, w], axis=1)
        corners = drawn_normals(self._body.mesh)[face].astype(np.float64)
        smooth = self._side * np.einsum("kij,ki->kj", corners, weights) @ self._into
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        flat = self.outward[face]
        return np.where(length > 0.0, smooth / np.where(length > 0.0, length, 1.0), flat), flat.copy()


def _reduced(item: Object) -> Array:
    """(3,): extinction in 1/m of an object's medium, without what it scatters ahead."""
    medium = scatterer_of(item)
    if medium is None or item.sheet_thickness is not None:
        return np.zeros(3)
    assert isinstance(medium, Medium)
    return np.asarray(medium.absorption) + np.asarray(medium.scattering) * (1.0 - medium.anisotropy)


def _facets(normals: Array, way: Array, alpha: Array, rng: np.random.Generator) -> Array:
    """Normals (k, 3) of microfacets that photons meet."""
    rough = np.flatnonzero(alpha > 0.0)
    found = normals.copy()
    if rough.size:
        shares = rng.random((rough.size, 2))
        found[rough] = microfacet_normal(normals[rough], way[rough], alpha[rough], shares)
    return found
