"""Shadow edges on view rays: kinks of the incoming light at the outlines of bodies as seen from the light.

The light of a spot has kinks of its own, at its cones.

There its path through a body begins to exist, or a shadow begins. Rules of quadrature take such a point for smooth
unless an interval ends there, and miss what is between two of them.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Integers
from translucent.geometry.grouping import shared_edges
from translucent.reference.rays import Rays
from translucent.reference.tracer import TracedObject
from translucent.scene.lights import DirectionalLight, SpotLight
from translucent.scene.scene import Light

#: Number of pairs of an edge and a ray that are tested together: the working arrays stay below 100 MB.
PAIRS = 1 << 18


def outline_edges(traced: TracedObject, light: Light) -> Array:
    """(e, 2, 3): silhouette edges of an object as seen from a light: one face is lit, and the other is not."""
    faces, corners = traced.body.mesh.faces, traced.corners
    with np.errstate(under="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if isinstance(light, DirectionalLight):
            towards = -np.broadcast_to(np.asarray(light.direction), normals.shape)
        else:
            towards = np.asarray(light.position) - corners[:, 0]
        lit = np.einsum("ki,ki->k", normals, towards) > 0
    edges = shared_edges(faces)
    # Each lit face counts as 1 and each other one as -1: an edge between two faces alike has 2.
    net = np.bincount(edges.of, np.where(np.repeat(lit, 3), 1.0, -1.0))
    chosen = edges.first[np.abs(net) != 2]
    return np.stack([corners.reshape(-1, 3)[chosen], np.roll(corners, -1, axis=1).reshape(-1, 3)[chosen]], axis=1)


def shadow_edges(rays: Rays, edges: Array, light: Light) -> tuple[Integers, Array]:
    """Indices of rays (k,), and distances (k,) at which light that grazes one of the edges (e, 2, 3) meets them."""
    found = [(np.empty(0, np.int64), np.empty(0))]
    each = max(PAIRS // max(len(edges), 1), 1)
    for begin in range(0, len(rays), each):
        ray, t = _shadow_edges(rays.where(slice(begin, begin + each)), edges, light)
        found.append((ray + begin, t))
    return np.concatenate([ray for ray, _ in found]), np.concatenate([t for _, t in found])


@np.errstate(all="ignore")
def cone_edges(rays: Rays, light: Light) -> tuple[Integers, Array]:
    """Indices of rays (k,), and distances (k,) at which they cross the inner or the outer cone of a spot."""
    if not isinstance(light, SpotLight):
        return np.empty(0, np.int64), np.empty(0)
    axis, from_light = np.asarray(light.direction), rays.origins - np.asarray(light.position)
    along = [way @ axis for way in (from_light, rays.directions)]
    across = [way - s[:, None] * axis for way, s in zip((from_light, rays.directions), along, strict=True)]
    found = []
    for angle in np.radians((light.inner_cone, light.outer_cone)):
        # On the cone, or on its mirror image behind: (sin * along)^2 = (cos * across)^2. For an angle of 0, where the
        # ray is nearest to the axis: smooth, but all light of narrow cones is about there.
        a, b, c = (
            (np.sin(angle) ** 2 * along[i] * along[j])
            - np.cos(angle) ** 2 * np.einsum("ki,ki->k", across[i], across[j])
            for i, j in ((1, 1), (0, 1), (0, 0))
        )
        root = np.sqrt(np.maximum(b * b - a * c, 0.0) if angle == 0.0 else b * b - a * c)
        for t in ((-b - root) / a, (-b + root) / a):
            front = np.flatnonzero(np.isfinite(t) & (along[0] + t * along[1] >= 0.0))
            found.append((front, t[front]))
    return np.concatenate([ray for ray, _ in found]), np.concatenate([t for _, t in found])


@np.errstate(all="ignore")
def _shadow_edges(rays: Rays, edges: Array, light: Light) -> tuple[Integers, Array]:
    """`shadow_edges` of few rays. Rays towards the light itself have no plane with it, and no edges."""
    if isinstance(light, DirectionalLight):
        way = np.broadcast_to(np.asarray(light.direction), rays.directions.shape)
    else:
        way = np.asarray(light.position) - rays.origins
    # Each edge has at most one point in the plane of a ray and the light.
    normal = np.cross(rays.directions, way)
    above, below = (normal @ (edges[:, i].T) - np.einsum("ki,ki->k", normal, rays.origins)[:, None] for i in (0, 1))
    ray, edge = np.nonzero((above > 0) != (below > 0))
    share = above[ray, edge] / (above[ray, edge] - below[ray, edge])
    point = edges[edge, 0] + share[:, None] * (edges[edge, 1] - edges[edge, 0]) - rays.origins[ray]
    if isinstance(light, DirectionalLight):
        source, direction = point, way[ray]
    else:
        source, direction = way[ray], point - way[ray]
    across = np.cross(rays.directions[ray], direction)
    t = np.einsum("ki,ki->k", np.cross(source, direction), across) / np.einsum("ki,ki->k", across, across)
    # The light passes the edge first.
    after = np.einsum("ki,ki->k", t[:, None] * rays.directions[ray] - point, direction) > 0
    keep = np.isfinite(t) & after
    return ray[keep], t[keep]
