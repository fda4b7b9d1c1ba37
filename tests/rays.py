"""Random rays, and their nearest surfaces by Embree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import translucent as tl
from translucent.arrays import Array, Integers, Mask
from translucent.geometry.bvh import BOX_COST, Hierarchy
from translucent.geometry.ray_caster import RayCaster

#: Paths that differ by no more than this share of a body's radius are the same: corners in float32 are off by 6e-8 of
#: it, origins and directions again, over cosines down to 0.02.
ROUNDING = 1e-5


@dataclass(frozen=True, eq=False)
class Found:
    """Nearest surfaces on rays: path (n,), object (n,) and face (n,), -1 where there is none."""

    path: Array
    object: Integers
    face: Integers

    @classmethod
    def nothing(cls, count: int) -> Found:
        return cls(np.full(count, 1e30), np.full(count, -1), np.full(count, -1))


def random_rays(scene: tl.Scene, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rays that start about the objects, each as often, in all directions, as float32 has them."""
    boxes = np.stack([body.bounds for body in scene.objects])
    center = 0.5 * boxes[:, 0].min(axis=0) + 0.5 * boxes[:, 1].max(axis=0)
    own = boxes[rng.integers(len(boxes), size=count)]
    low, high = own[:, 0] - center, own[:, 1] - center
    origins = 0.5 * (low + high) + rng.uniform(-0.6, 0.6, (count, 3)) * (high - low)
    directions = rng.normal(size=(count, 3))
    aimed = rng.random(count) < 0.5
    targets = boxes[rng.integers(len(boxes), size=count)] - center
    towards = targets[:, 0] + rng.random((count, 3)) * (targets[:, 1] - targets[:, 0]) - origins
    directions[aimed] = towards[aimed]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # What the GPU gets, and so what the truth must be about.
    return origins.astype(np.float32) + center, directions.astype(np.float32).astype(np.float64)


def through(origins: Array, targets: Array) -> tuple[Array, Array]:
    """Rays from points (n, 3) to others."""
    directions = targets - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def embree_nearest(scene: tl.Scene, origins: Array, directions: Array) -> Found:
    """The nearest surface of any object, by an Embree scene for each mesh, in its coordinates."""
    found = Found.nothing(len(origins))
    for number, body in enumerate(scene.objects):
        embree = RayCaster(body.mesh)
        inverse = np.linalg.inv(body.matrix[:3, :3]) / embree.radius
        start = (origins - body.matrix[:3, 3]) @ inverse.T - embree.center / embree.radius
        along = directions @ inverse.T
        scale = np.linalg.norm(along, axis=1)
        along /= scale[:, None]
        ahead = np.maximum(-np.einsum("ki,ki->k", start, along) - 2.0, 0.0)
        face, path = embree.first_hits(start + ahead[:, None] * along, along)
        path = (path + ahead) / scale
        nearer = (face >= 0) & (path < found.path)
        found.path[nearer], found.object[nearer], found.face[nearer] = path[nearer], number, face[nearer]
    return found


def agreeing(scene: tl.Scene, one: Found, other: Found) -> Mask:
    """(n,): whether both find the same face, or one that shares an edge with it, or the same path but for rounding."""
    alike = (one.object == other.object) & (one.face == other.face)
    different = np.flatnonzero(~alike & (one.object >= 0) & (other.object >= 0))
    radius = np.array([0.5 * np.linalg.norm(np.ptp(body.bounds, axis=0)) for body in scene.objects])
    reach = np.maximum(radius[one.object[different]], radius[other.object[different]])
    apart = np.abs(one.path[different] - other.path[different])
    alike[different] = apart <= ROUNDING * (reach + 0.02 * scene.diagonal)
    for ray in different[~alike[different]]:
        if one.object[ray] == other.object[ray]:
            faces = scene.objects[one.object[ray]].mesh.faces
            alike[ray] = len(np.intersect1d(faces[one.face[ray]], faces[other.face[ray]])) >= 2
    return alike


def inside_points(mesh: tl.Mesh, count: int, rng: np.random.Generator) -> Array:
    """(count, 3): points in a closed mesh, as float32 has them from its center: more or less below its faces."""
    points: list[Array] = []
    while len(points) < count:
        face = rng.integers(len(mesh.faces))
        depth = mesh.diagonal * 10.0 ** rng.uniform(-5, -1)
        below = mesh.vertices[mesh.faces[face]].mean(axis=0) - depth * mesh.face_normals[face] - mesh.center
        point = mesh.center + below.astype(np.float32)
        if mesh.winding_number(point) > 0.5:
            points.append(point)
    return np.array(points)


def sah_cost(hierarchy: Hierarchy) -> float:
    """Expected box and triangle tests of a long ray that meets the root, by the surface area heuristic."""
    size = np.asarray(hierarchy.high, np.float64) - hierarchy.low
    area: Array = size[:, 0] * size[:, 1] + (size[:, 0] + size[:, 1]) * size[:, 2]
    tests = BOX_COST * area[parents(hierarchy)[1:]].sum() + (area * hierarchy.count).sum()
    return float(tests / area[0])


def parents(hierarchy: Hierarchy) -> Integers:
    """(n,): the node above each; the root has itself."""
    place, count = hierarchy.orders[0].astype(np.int64), len(hierarchy.size)
    steps = np.bincount(place + 1, minlength=count + 2) - np.bincount(place + hierarchy.size, minlength=count + 2)
    depth = np.cumsum(steps)[place]
    key = depth * count + place
    order = np.argsort(key)
    above = order[np.maximum(np.searchsorted(key[order], key - count) - 1, 0)]
    return np.where(depth > 0, above, 0)
