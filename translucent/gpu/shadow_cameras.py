"""Cameras that look from lights at what throws shadows."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Mask
from translucent.gpu.light_cameras import cameras_towards, world_vertices
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Object, Scene

#: Faces times vertices up to which an object is looked at, whether it shadows itself.
_MOST_PAIRS = 1 << 22

#: Distance behind a face, as a share of the scene, that is rounding.
_BEHIND = 1e-6


def shadow_cameras(light: Light, scene: Scene) -> list[Camera]:
    """Cameras of a light that see all that throws shadows onto opaque objects; what they do not see is lit.

    A ground that shadows neither itself nor another such object is left out, and large as it may be: what else there is
    has all of the map.
    """
    vertices = [world_vertices(item) for item in scene.objects]
    grounds: list[int] = []
    for i, item in enumerate(scene.objects):
        # Of two, each has to be in front of the other.
        others = [vertices[j] for j in (*grounds, i)]
        behind = [np.concatenate([vertices[j], vertices[i]]) for j in grounds]
        if item.medium is None and all(
            _all_lit(scene.objects[j], vertices[j], points, light, scene.diagonal)
            for j, points in ((i, np.concatenate(others)), *zip(grounds, behind, strict=True))
        ):
            grounds.append(i)
    throwing = [points for i, points in enumerate(vertices) if i not in grounds]
    if not throwing:
        return []
    points = np.concatenate(throwing)
    low, high = points.min(axis=0), points.max(axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low)) or scene.diagonal or 1.0
    return cameras_towards(points, light, 0.5 * (low + high), radius)


def _all_lit(item: Object, vertices: Array, points: Array, light: Light, diagonal: float) -> Mask | bool:
    """Whether an object shadows none of the points (n, 3): all are on the lit side of each of its faces."""
    faces = item.mesh.faces
    if len(faces) * len(points) > _MOST_PAIRS:
        return False
    first, second, third = (vertices[faces[:, corner]] for corner in range(3))
    normal = np.cross(second - first, third - first)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    if isinstance(light, DirectionalLight):
        towards = np.broadcast_to(-np.asarray(light.direction), normal.shape)
    else:
        towards = np.asarray(light.position) - first
    normal *= np.sign((normal * towards).sum(axis=1, keepdims=True))
    ahead = points @ normal.T - (first * normal).sum(axis=1)
    return bool((ahead >= -_BEHIND * diagonal).all())
