"""Interfaces on rays: the first point on each ray at which its medium changes.

Of several bodies at one point, the one of the highest priority decides what light is in; of equal ones, the one that
the ray entered last (Schmidt & Budge 2002, "Simple nested dielectrics in ray traced images"). A ray carries an interior
list of the bodies that it is in, so that the walls of two bodies at one point are one interface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.formulas.interface import CLEARCOAT_IOR, channel_iors
from translucent.formulas.optics import fresnel_dielectric
from translucent.formulas.thin_film import thin_film_reflectance
from translucent.geometry.normals import corner_normals
from translucent.reference.compositing import _layers
from translucent.reference.hits import Hits, world_normals
from translucent.scene.scene import Scene
from translucent.scene.surface import Surface

#: Distance within which surfaces coincide, as a fraction of the scene's diagonal.
TOGETHER = 1e-9

#: Smallest cosine between an interface's normal and a ray that hits it.
EDGE_ON = 1e-3

#: Index meaning outside all bodies.
AIR = -1


@dataclass(frozen=True, eq=False)
class Inside:
    """Interior lists of rays: how often each body contains their points, and since when.

    Attributes
    ----------
    windings : (n, objects) int32
        How often each body contains the point.
    since : (n, objects) int64
        When it was entered last, by a count of each ray's crossings.
    """

    windings: npt.NDArray[np.int32]
    since: Integers

    def where(self, chosen: Integers | Mask) -> Inside:
        """Selection of rays by indices or a mask."""
        return Inside(self.windings[chosen], self.since[chosen])


@dataclass(frozen=True, eq=False)
class FirstInterfaces:
    """First interface on each ray; all arrays (n,).

    Attributes
    ----------
    distance : float64
        In metres along the ray; inf where there is none.
    item : int64
        Of `Scene.objects`, whose interface it is; of no meaning without one.
    face : int64
        Of its mesh.
    barycentric : (n, 3) float64
    before, after : int64
        Object that light is in on this side and on the other; `AIR` where in none. Equal for a sheet.
    here, there : Inside
        On this side, and on the other.
    """

    distance: Array
    item: Integers
    face: Integers
    barycentric: Array
    before: Integers
    after: Integers
    here: Inside
    there: Inside

    def where(self, chosen: Integers) -> FirstInterfaces:
        """Selection of rays by indices."""
        return FirstInterfaces(
            self.distance[chosen],
            self.item[chosen],
            self.face[chosen],
            self.barycentric[chosen],
            self.before[chosen],
            self.after[chosen],
            self.here.where(chosen),
            self.there.where(chosen),
        )


class Optics:
    """Optical properties of a scene's interfaces, for one color of light or for all together.

    Parameters
    ----------
    scene : Scene
    sheets : sequence of float or None
        Thickness in metres of the sheet that each object is, or None.
    channel : int, optional
        Color of light whose indices of refraction count; None where all are alike.
    """

    def __init__(self, scene: Scene, sheets: Sequence[float | None], channel: int | None = None) -> None:
        self.scene, self.sheets = scene, sheets
        self.surfaces = [body.surface or Surface() for body in scene.objects]
        media = [body.medium.ior if body.medium else 1.0 for body in scene.objects]
        iors = channel_iors(media, [surface.dispersion for surface in self.surfaces])
        #: (objects + 1,): the last is that of `AIR`, index -1.
        self.iors = np.append(iors[:, 1 if channel is None else channel], 1.0)
        solid = [body.medium is not None and metres is None for body, metres in zip(scene.objects, sheets, strict=True)]
        self.solids = [i for i, is_solid in enumerate(solid) if is_solid]
        counts = [body.has_interface or scene.overlap == "priority" for body in scene.objects]
        #: (objects,): objects that determine the medium of light.
        self.decides = np.array(solid) & np.array(counts)
        #: Sheets with an optical effect beyond absorption along the path.
        self.walls = [i for i, body in enumerate(scene.objects) if sheets[i] is not None and body.has_interface]
        _, self._rank = np.unique([body.priority for body in scene.objects], return_inverse=True)
        self._films = np.array(
            [(s.iridescence, s.iridescence_ior, s.iridescence_thickness) for s in self.surfaces], dtype=np.float64
        )
        #: (objects,): fraction of each that has a clear coat.
        self.coats = np.array([s.clearcoat for s in self.surfaces])
        self._corner_normals: dict[int, Array] = {}

    def corner_normals(self, item: int) -> Array:
        """(m, 3, 3): normals of an object's surface at the corners of its faces, as they are drawn."""
        if item not in self._corner_normals:
            self._corner_normals[item] = corner_normals(self.scene.objects[item].mesh)
        return self._corner_normals[item]

    def filmed(self, bare: Array, item: Integers, before: Integers, cosine: Array, ior: Array) -> Array:
        """(k, 3): reflectance of interfaces that reflect `bare` (k,) without the films of their objects on them.

        `before` are the objects that light comes from, or `AIR`; the cosine of incidence and the relative index
        `ior` are (k,).
        """
        reflectance = np.repeat(bare[:, None], 3, axis=1)
        some = np.flatnonzero(self._films[item, 0])
        if some.size:
            covered, film, metres = self._films[item[some]].T
            inside = film / self.iors[before[some]]
            colored = thin_film_reflectance(cosine[some], ior[some], inside, film * metres)
            reflectance[some] += covered[:, None] * (colored - reflectance[some])
        return reflectance

    def coated(self, item: Integers, outside: Mask, cosine: Array) -> Array:
        """(k,): reflectance of clear coats, for light that comes from outside."""
        coat = np.where(outside, self.coats[item], 0.0)
        return coat * fresnel_dielectric(cosine, CLEARCOAT_IOR) if coat.any() else coat

    @property
    def tolerance(self) -> float:
        """Distance in metres within which surfaces coincide."""
        return TOGETHER * self.scene.diagonal

    def effective_medium(self, inside: Inside) -> Integers:
        """(n,): object of the effective medium around each ray, or `AIR`."""
        present = (inside.windings > 0) & self.decides
        key = np.where(present, self._rank * (1 << 40) + inside.since, -1)
        best = key.argmax(axis=1)
        return np.where(present.any(axis=1), best, AIR)

    def matters(self, before: Integers, after: Integers) -> Mask:
        """(n,): whether a change of medium has an optical effect."""
        plain = np.array([body.plain for body in self.scene.objects] + [True])
        changes = (self.iors[before] != self.iors[after]) | ~plain[before] | ~plain[after]
        return np.asarray((before != after) & changes)

    def outside(self, count: int) -> Inside:
        """Interior lists of rays outside all bodies."""
        shape = (count, len(self.scene.objects))
        return Inside(np.zeros(shape, np.int32), np.zeros(shape, np.int64))

    def at_origins(self, hits: Sequence[Hits], count: int) -> Inside:
        """Interior lists of rays at their origins, from all surfaces behind these."""
        return self.crossed([line.where(line.distance < 0) for line in hits], self.outside(count))

    def crossed(self, hits: Sequence[Hits], inside: Inside) -> Inside:
        """Interior lists of rays behind all surfaces on them; `inside` are those at their origins."""
        return _InterfaceWalk(self, hits, inside).through()

    def first_interfaces(self, hits: Sequence[Hits], inside: Inside) -> FirstInterfaces:
        """First interfaces among the surfaces ahead of rays that start `inside` bodies."""
        return _InterfaceWalk(self, hits, inside).to_interfaces()


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Ordered crossings of rays with the surfaces of all objects."""

    pixel: Integers
    distance: Array
    item: Integers
    sign: npt.NDArray[np.int8]
    face: Integers
    barycentric: Array

    @classmethod
    def of(cls, hits: Sequence[Hits], items: Sequence[int]) -> _Crossings:
        none = np.empty(0, np.int64)
        parts = [(none, np.empty(0), none, np.empty(0, np.int8), none, np.empty((0, 3)))]
        parts += [
            (line.pixel, line.distance, np.full(len(line.pixel), i), line.sign, line.face, line.barycentric)
            for i, line in ((i, hits[i]) for i in items)
        ]
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        order = np.lexsort((columns[1], columns[0]))
        return cls(*(column[order] for column in columns))

    def where(self, chosen: Integers) -> _Crossings:
        return _Crossings(*(getattr(self, field.name)[chosen] for field in fields(self)))


class _InterfaceWalk:
    """Walk of all rays from surface to surface, until their effective medium changes."""

    def __init__(self, optics: Optics, hits: Sequence[Hits], inside: Inside) -> None:
        self.optics = optics
        self.crossings = _Crossings.of(hits, [*optics.solids, *optics.walls])
        self.inside = Inside(inside.windings.copy(), inside.since.copy())
        count, objects = inside.windings.shape
        self.face = np.full((count, objects), -1)
        self.barycentric = np.zeros((count, objects, 3))
        self.time = inside.since.max(axis=1, initial=0)

    def through(self) -> Inside:
        """Interior lists behind all surfaces."""
        for layer in _layers(self.crossings.pixel):
            self._cross(self.crossings.where(layer))
        return self.inside

    def to_interfaces(self) -> FirstInterfaces:
        """First interface of each ray."""
        count = len(self.time)
        self.here = Inside(self.inside.windings.copy(), self.inside.since.copy())
        self.before = self.optics.effective_medium(self.inside)
        self.reached = np.full(count, -np.inf)
        self.sheet = np.full(count, -1)
        stopped = np.zeros(count, dtype=bool)
        is_wall = np.isin(np.arange(len(self.optics.surfaces)), self.optics.walls)
        for layer in _layers(self.crossings.pixel):
            crossings = self.crossings.where(layer[~stopped[self.crossings.pixel[layer]]])
            ray = crossings.pixel
            apart = crossings.distance > self.reached[ray] + self.optics.tolerance
            stopped[ray[apart]] = self._changed(ray[apart])
            going = np.flatnonzero(~stopped[ray])
            self._begin_point(crossings.where(going[apart[going]]))
            crossings = crossings.where(going)
            sheet = is_wall[crossings.item]
            self._cross(crossings.where(np.flatnonzero(~sheet)))
            self._cross_sheet(crossings.where(np.flatnonzero(sheet)))
            stopped[crossings.pixel[sheet]] = True
        return self._interfaces()

    def _cross(self, crossings: _Crossings) -> None:
        ray, item = crossings.pixel, crossings.item
        self.time[ray] += 1
        self.inside.windings[ray, item] += crossings.sign
        entered = (crossings.sign > 0) & (self.inside.windings[ray, item] == 1)
        self.inside.since[ray[entered], item[entered]] = self.time[ray[entered]]
        self.face[ray, item] = crossings.face
        self.barycentric[ray, item] = crossings.barycentric

    def _begin_point(self, crossings: _Crossings) -> None:
        ray = crossings.pixel
        self.reached[ray] = crossings.distance
        self.before[ray] = self.optics.effective_medium(self.inside.where(ray))
        self.here.windings[ray], self.here.since[ray] = self.inside.windings[ray], self.inside.since[ray]
        self.face[ray] = -1

    def _cross_sheet(self, crossings: _Crossings) -> None:
        ray = crossings.pixel
        # With a wall of a body at the same point, the wall goes first.
        free = ~self._changed(ray)
        self.sheet[ray[free]] = crossings.item[free]
        self.face[ray[free], crossings.item[free]] = crossings.face[free]
        self.barycentric[ray[free], crossings.item[free]] = crossings.barycentric[free]

    def _changed(self, ray: Integers) -> Mask:
        return self.optics.matters(self.before[ray], self.optics.effective_medium(self.inside.where(ray)))

    def _interfaces(self) -> FirstInterfaces:
        rays = np.arange(len(self.time))
        after = self.optics.effective_medium(self.inside)
        is_sheet = self.sheet >= 0
        found = is_sheet | self.optics.matters(self.before, after)
        # The interface is that of the body that is entered; where the ray only leaves one, of that.
        entered = (after != AIR) & (self.face[rays, after] >= 0)
        item = np.where(is_sheet, self.sheet, np.where(entered, after, self.before))
        return FirstInterfaces(
            np.where(found, self.reached, np.inf),
            item,
            self.face[rays, item],
            self.barycentric[rays, item],
            self.before,
            np.where(is_sheet, self.before, after),
            self.here,
            self.inside,
        )


def interface_normals(own: Optics, interfaces: FirstInterfaces, directions: Array) -> tuple[Array, Array]:
    """Unit normals (n, 3) of interfaces, towards where rays (n, 3) come from: of smooth surfaces, and of their faces.

    Smooth normals may look away from a ray that their face looks at: it hits the interface edge-on.
    """
    smooth, flat = np.zeros((2, len(directions), 3))
    for i in np.unique(interfaces.item):
        own_rays = np.flatnonzero(interfaces.item == i)
        body, face = own.scene.objects[i], interfaces.face[own_rays]
        flat[own_rays] = world_normals(body, face)
        corners = np.einsum("kij,ki->kj", own.corner_normals(int(i))[face], interfaces.barycentric[own_rays])
        smooth[own_rays] = corners @ np.linalg.inv(body.matrix[:3, :3])
    away = np.einsum("ki,ki->k", flat, directions) > 0
    flat[away] *= -1.0
    smooth[away] *= -1.0
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    facing = np.einsum("ki,ki->k", smooth, directions)
    edge_on = facing > -EDGE_ON
    smooth[edge_on] -= (facing[edge_on] + EDGE_ON)[:, None] * directions[edge_on]
    return smooth / np.linalg.norm(smooth, axis=1, keepdims=True), flat
