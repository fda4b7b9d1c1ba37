"""All intersections of any rays with the objects of a scene, in float64.

Light paths do not come in pictures, so each ray has a plane of its own: shifted to its origin and sheared along it, a
mesh is seen as in `translucent.reference.hits`, and the same exact edge functions decide (Woop et al. 2013).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Integers
from translucent.reference.boxes import BoxTree, Lines
from translucent.reference.hits import Hits, cross_triangles, sorted_hits
from translucent.scene.scene import Object, Scene

#: Enlargement of the scene's bounding sphere, as a share.
MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class TracedObject:
    """Object for ray casting, in metres from the eye.

    Attributes
    ----------
    body : Object
    corners : (m, 3, 3) float64
        Of its faces.
    """

    body: Object
    corners: Array

    @classmethod
    def of(cls, body: Object, eye: Array) -> TracedObject:
        """Object relative to `eye` (3,)."""
        x, y, z = (body.mesh.vertices - body.mesh.center).T[:, :, None] * body.matrix[:3, :3].T[:, None]
        # The mesh keeps its shape to the last digit wherever it is: only the one offset to the eye is large.
        corners = (x + y + z + center_from(body, eye))[body.mesh.faces]
        return cls(body, corners)

    @cached_property
    def tree(self) -> BoxTree:
        """Boxes around the faces."""
        return BoxTree.of(self.corners)

    def hits(self, lines: Lines) -> Hits:
        """All surfaces on the lines; `Hits.pixel` is the number of the line."""
        hits = self.crossings(lines, self.tree.candidates(lines))
        return hits.where((hits.distance >= lines.start[hits.pixel]) & (hits.distance <= lines.end[hits.pixel]))

    def crossings(self, lines: Lines, candidates: Iterable[tuple[Integers, Integers]]) -> Hits:
        """All of the candidates, pairs (k,), (k,) of a line and a face, that meet, anywhere on the line."""
        parts = []
        for line, face in candidates:
            seen = _sheared(self.corners[face] - lines.origins[line, None], lines.directions[line])
            keep, *found = cross_triangles(seen, np.ones(seen.shape[:2]), np.zeros((len(seen), 2)), perspective=False)
            parts.append((line[keep], face[keep], *found))
        return sorted_hits(parts, -1 if self.body.faces_inwards else 1)


def center_from(body: Object, eye: Array) -> Array:
    """(3,): the center of an object's mesh in metres from `eye` (3,), rounded once."""
    terms = np.column_stack([body.matrix[:3, :3] * body.mesh.center, body.matrix[:3, 3], -eye])
    return np.array([math.fsum(row) for row in terms])


class Tracer:
    """Ray caster for all objects of a scene.

    Parameters
    ----------
    scene : Scene
        Points are in metres from the eye of its camera, along the axes of the world.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.objects = [TracedObject.of(body, scene.camera.eye) for body in scene.objects]
        low = np.min([traced.corners.min(axis=(0, 1)) for traced in self.objects], axis=0)
        high = np.max([traced.corners.max(axis=(0, 1)) for traced in self.objects], axis=0)
        self.center = 0.5 * (low + high)
        self.radius = 0.5 * float(np.linalg.norm(high - low)) * (1.0 + MARGIN)

    def hits(self, lines: Lines) -> list[Hits]:
        """The surfaces of each object on the lines."""
        return [traced.hits(lines) for traced in self.objects]

    def ball(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Entry and exit of lines in the scene's bounding sphere: distances (n,), equal for lines that miss it."""
        to_center = self.center - origins
        middle = np.einsum("ki,ki->k", to_center, directions)
        across = np.linalg.norm(to_center - middle[:, None] * directions, axis=1)
        half = np.sqrt(np.maximum((self.radius - across) * (self.radius + across), 0.0))
        return middle - half, middle + half


def _sheared(vectors: Array, directions: Array) -> Array:
    """(k, 3, 3): vectors (k, 3, 3) in the frame of unit directions (k, 3): right, up, and the distance along the ray.

    Equal vectors give bit-equal results whatever triangle they belong to.
    """
    rows = np.arange(len(directions))
    forward = np.abs(directions).argmax(axis=1)
    right, up = (forward + 1) % 3, (forward + 2) % 3
    # As a camera does, look along -z of a right-handed frame.
    away = directions[rows, forward] > 0
    right, up = np.where(away, up, right), np.where(away, right, up)
    depth = directions[rows, forward][:, None]
    x, y, z = (vectors[rows, :, axis] for axis in (right, up, forward))
    with np.errstate(under="ignore"):
        distance = z / depth
        shear = directions[rows, right][:, None], directions[rows, up][:, None]
        return np.stack([x - shear[0] * distance, y - shear[1] * distance, distance], axis=-1)
