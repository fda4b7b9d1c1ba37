"""Nearest surfaces of a scene on any rays: found by Embree in float32, placed in float64.

Embree tells one of several faces in one place. Objects whose bounds touch are therefore in different Embree scenes,
each of which tells its own; objects that are apart share one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Integers
from translucent.geometry.embree import STEP, embree_scene
from translucent.geometry.normals import drawn_normals
from translucent.reference.tracer import Lines, TracedObject, center_from
from translucent.scene.scene import Object


def dot(a: Array, b: Array) -> Array:
    """(k,): scalar products of vectors (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def unit(vectors: Array) -> Array:
    """Vectors (k, 3) with their length made 1, or left at 0."""
    length = np.sqrt(dot(vectors, vectors))
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def largest(values: Array) -> Array:
    """(k,): largest of the columns of (k, n), n at least 1."""
    found = values[:, 0]
    for column in values.T[1:]:
        found = np.maximum(found, column)
    return np.asarray(found)


#: Shortest way from a surface to the next, in radii of the scene: anything nearer counts as behind.
NEAREST = 1e-13

#: Largest error, in radii, of a place on the plane of a face: beyond it the ray runs along the plane.
PLANE_ERROR = 1e-4

#: Share of the scene's radius by which bounds are enlarged before they are compared.
TOUCHING = 1e-4

#: Number of faces of which none counts after which a ray ends.
MOST_REJECTED = 64


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of all objects, those of one after those of another; lengths in radii from the center of the scene.

    Attributes
    ----------
    corner, outward : (m, 3) float64
        First corner, and unit normal out of the body.
    edges : (m, 2, 3) float64
        From the first corner to the others.
    item : (m,) int64
        Of `Scene.objects`.
    number : (m,) int64
        Of the face in its mesh.
    """

    corner: Array
    outward: Array
    edges: Array
    item: Integers
    number: Integers


class Caster:
    """Ray caster for the objects of a scene.

    Parameters
    ----------
    objects : sequence of Object
    bounds : (2, 3) float64
        Of all of them.
    """

    def __init__(self, objects: Sequence[Object], bounds: Array) -> None:
        self.objects = objects
        self.center = bounds.mean(axis=0)
        self.radius = 0.5 * float(np.linalg.norm(bounds[1] - bounds[0]))
        self._groups = _groups(objects, TOUCHING * self.radius)
        parts, self._scenes, self.first = [], [], []
        count = 0
        for group in self._groups:
            self.first.append(count)
            own = [self._corners(i) for i in group]
            parts += [(corners, np.full(len(corners), i)) for i, corners in zip(group, own, strict=True)]
            together = np.concatenate(own)
            count += len(together)
            faces = np.arange(3 * len(together), dtype=np.int32).reshape(-1, 3)
            self._scenes.append(embree_scene(together.reshape(-1, 3).astype(np.float32), faces))
        corners, item = (np.concatenate(part) for part in zip(*parts, strict=True))
        edges = corners[:, 1:] - corners[:, :1]
        outward = np.cross(edges[:, 0], edges[:, 1])
        length = np.linalg.norm(outward, axis=1)
        sides = np.array([-1.0 if body.faces_inwards else 1.0 for body in objects])
        outward *= (sides[item] / np.where(length > 0, length, 1.0))[:, None]
        number = np.concatenate([np.arange(len(part[0])) for part in parts])
        self.faces = Faces(corners[:, 0].copy(), outward, edges, item, number)

    @property
    def groups(self) -> int:
        """Number of Embree scenes."""
        return len(self._scenes)

    @cached_property
    def smooth(self) -> Array:
        """(m, 3, 3) float32: normals out of the body at the corners of the faces, for shading; not of unit length."""
        parts = []
        for i in (i for group in self._groups for i in group):
            body = self.objects[i]
            side = -1.0 if body.mesh.diagnosis.inverted else 1.0
            normals = side * drawn_normals(body.mesh) @ np.linalg.inv(body.matrix[:3, :3])
            length = np.linalg.norm(normals, axis=-1, keepdims=True).max(initial=1e-300)
            parts.append((normals / length).astype(np.float32))
        return np.concatenate(parts)

    def nearest(
        self, origins: Array, directions: Array, last: Integers, start: Array | None = None
    ) -> tuple[Integers, Array]:
        """Nearest faces ahead, one of each Embree scene.

        Parameters
        ----------
        origins, directions : (n, 3) float64
            In radii from the center; directions have unit length.
        last : (n, groups) int64
            Faces that the origins are on, which are not met again; -1 for none.
        start : (n,) float64, optional
            Where Embree begins to search, in radii. Default: a little ahead.

        Returns
        -------
        face : (n, groups) int64
            -1 where there is none.
        distance : (n, groups) float64
            In radii; inf where there is none.
        """
        face, distance = np.full(last.shape, -1), np.full(last.shape, np.inf)
        begin = np.full(len(origins), STEP) if start is None else start
        for group in range(self.groups):
            self._search(group, origins, directions, last[:, group], begin, face[:, group], distance[:, group])
        return face, distance

    def _search(
        self,
        group: int,
        origins: Array,
        directions: Array,
        last: Integers,
        begin: Array,
        face: Integers,
        distance: Array,
    ) -> None:
        """Search the Embree scene `group`, and put what is found into `face` and `distance`."""
        live, start = np.arange(len(origins)), begin
        for _ in range(MOST_REJECTED):
            o, d = origins[live], directions[live]
            with np.errstate(under="ignore", over="ignore"):
                rays = (o + start[:, None] * d).astype(np.float32), d.astype(np.float32)
            hits = self._scenes[group].run(*rays, output=True)
            found = np.flatnonzero(hits["primID"] >= 0)
            if not found.size:
                return
            live, o, d = live[found], o[found], d[found]
            own = hits["primID"][found].astype(np.int64) + self.first[group]
            rough = hits["tfar"][found].astype(np.float64) + start[found]
            exact = self._on_planes(own, o, d, rough)
            counts = (own != last[live]) & (exact > NEAREST)
            face[live[counts]], distance[live[counts]] = own[counts], exact[counts]
            live, start = live[~counts], rough[~counts] + STEP
            if not live.size:
                return

    def _on_planes(self, face: Integers, origins: Array, directions: Array, rough: Array) -> Array:
        """(k,): distances to the planes of faces, near those that are known roughly."""
        normal = self.faces.outward[face]
        with np.errstate(under="ignore", divide="ignore", invalid="ignore", over="ignore"):
            exact = dot(self.faces.corner[face] - origins, normal) / np.einsum("ki,ki->k", directions, normal)
        return np.where(np.abs(exact - rough) <= PLANE_ERROR, exact, rough)

    def nearest_exactly(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """As `nearest`, for few rays: in float64, with exact decisions on edges and vertices."""
        face, distance = np.full((len(origins), self.groups), -1), np.full((len(origins), self.groups), np.inf)
        lines = Lines(origins, directions, np.full(len(origins), NEAREST), np.full(len(origins), np.inf))
        for i, (group, first) in enumerate(self._places):
            hits = self._exact[i].hits(lines)
            ray, nearest = np.unique(hits.pixel, return_index=True)
            closer = hits.distance[nearest] < distance[ray, group]
            ray, nearest = ray[closer], nearest[closer]
            face[ray, group], distance[ray, group] = hits.face[nearest] + first, hits.distance[nearest]
        return face, distance

    def barycentric(self, face: Integers, points: Array) -> Array:
        """(k, 3): weights of the corners of faces at points (k, 3) on them, in radii from the center."""
        one, other = self.faces.edges[face].transpose(1, 0, 2)
        across = points - self.faces.corner[face]
        a, b, c = (dot(x, y) for x, y in ((one, one), (one, other), (other, other)))
        p, q = dot(across, one), dot(across, other)
        area = a * c - b * b
        area = np.where(area > 0, area, 1.0)
        v, w = np.clip((c * p - b * q) / area, 0.0, 1.0), np.clip((a * q - b * p) / area, 0.0, 1.0)
        weights = np.stack([np.maximum(1.0 - v - w, 0.0), v, w], axis=1)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    @cached_property
    def _places(self) -> list[tuple[int, int]]:
        """Group and first face of each object."""
        found = [(0, 0)] * len(self.objects)
        for number, group in enumerate(self._groups):
            first = self.first[number]
            for i in group:
                found[i] = (number, first)
                first += len(self.objects[i].mesh.faces)
        return found

    @cached_property
    def _exact(self) -> list[TracedObject]:
        corners = [self._corners(i) for i in range(len(self.objects))]
        return [TracedObject(body, own) for body, own in zip(self.objects, corners, strict=True)]

    def _corners(self, i: int) -> Array:
        """(m, 3, 3): corners of the faces of an object, in radii from the center."""
        body = self.objects[i]
        vertices = (body.mesh.vertices - body.mesh.center) @ body.matrix[:3, :3].T + center_from(body, self.center)
        with np.errstate(under="ignore"):
            return np.asarray((vertices / self.radius)[body.mesh.faces])


def _groups(objects: Sequence[Object], margin: float) -> list[list[int]]:
    """Objects, divided so that the bounds of no two of a group touch."""
    groups: list[list[int]] = []
    boxes = np.stack([body.bounds for body in objects]) + np.array([[-margin], [margin]])
    for i in range(len(objects)):
        for group in groups:
            others = boxes[group]
            apart = (others[:, 0] > boxes[i, 1]).any(axis=1) | (others[:, 1] < boxes[i, 0]).any(axis=1)
            if apart.all():
                group.append(i)
                break
        else:
            groups.append([i])
    return groups
