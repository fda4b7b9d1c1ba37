"""Light that other bodies take on its straight way to a body in which it diffuses."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from translucent.arrays import Array, Mask
from translucent.diffusion.keys import may_dim
from translucent.formulas import optics
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster
from translucent.scene.scene import Object, Scene

#: Faces of one body on a line that are looked for.
MOST_FACES = 64

_CASTERS: WeakKeyDictionary[Mesh, RayCaster] = WeakKeyDictionary()


def ray_caster(mesh: Mesh) -> RayCaster:
    """Ray caster of a mesh, kept as long as the mesh is."""
    return _CASTERS.get(mesh) or _CASTERS.setdefault(mesh, RayCaster(mesh))


def dimming_bodies(scene: Scene, body: int) -> list[Object]:
    """Other bodies that take of the light on its way to one: those that may, and are closed."""
    return [item for i, item in enumerate(scene.objects) if i != body and may_dim(item) and item.mesh.diagnosis.solid]


def light_passed(bodies: Sequence[Object], points: Array, directions: Array, distance: Array) -> Array:
    """Transmittance (k, 3) from points (k, 3) in unit directions (k, 3) over distances (k,) in metres, or inf.

    As in shadows, interfaces neither bend the way nor take of its light, and where bodies overlap their optical depths
    add up.
    """
    depth = np.zeros((len(points), 3))
    for body in bodies:
        assert body.medium is not None
        depth += path_inside(body, points, directions, distance)[:, None] * np.asarray(body.medium.extinction)
    return optics.transmittance(depth)


def sky_paths(body: Object, points: Array, directions: Array, seen: Mask) -> sparse.csr_array:
    """(s, k): metres in another body from points (s, 3) in unit directions (k, 3) that are `seen`."""
    center, radius = _bounding_ball(body)
    towards = center - points
    along = towards @ directions.T
    near = (towards**2).sum(axis=1)[:, None] - along**2 <= radius**2
    within = (towards**2).sum(axis=1) <= radius**2
    sample, direction = np.nonzero(seen & near & ((along > 0.0) | within[:, None]))
    metres = path_inside(body, points[sample], directions[direction], np.full(len(sample), np.inf))
    crossed = metres > 0.0
    return sparse.csr_array((metres[crossed], (sample[crossed], direction[crossed])), seen.shape)


def _bounding_ball(body: Object) -> tuple[Array, float]:
    """Center and radius of a ball around a body."""
    corners = body.mesh.vertices @ body.matrix[:3, :3].T + body.matrix[:3, 3]
    center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return center, float(np.sqrt(((corners - center) ** 2).sum(axis=1).max()))


def path_inside(body: Object, points: Array, directions: Array, distance: Array) -> Array:
    """(k,): metres inside a body on ways, from where faces are crossed: exits are ahead of every start inside."""
    mesh = body.mesh
    caster = ray_caster(mesh)
    into = np.linalg.inv(body.matrix[:3, :3])
    origins, ways = (points - body.matrix[:3, 3]) @ into.T, directions @ into.T
    unit = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    line, face = caster.candidates(
        (origins - caster.center) / caster.radius,
        unit,
        np.full(len(points), MOST_FACES),
        np.ones(len(mesh.faces), dtype=bool),
    )
    first, second, third = (mesh.vertices[mesh.faces[face, corner]] for corner in range(3))
    normal = np.cross(second - first, third - first)
    slope = (ways[line] * normal).sum(axis=1)
    reached = ((first - origins[line]) * normal).sum(axis=1) / np.where(slope == 0.0, np.inf, slope)
    ahead = reached > 0.0
    # Inside a body as often as faces ahead are exits, less entries; each that is passed changes that.
    sign = np.sign(slope)[ahead] * (-1.0 if mesh.diagnosis.inverted else 1.0)
    line, end = line[ahead], np.minimum(reached[ahead], distance[line[ahead]])
    return np.asarray(np.maximum(np.bincount(line, sign * end, len(points)), 0.0))
