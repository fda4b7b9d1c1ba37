"""Cameras that look from lights at what throws shadows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from translucent.arrays import Array
from translucent.gpu.light_cameras import cameras_towards
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Scene

#: Faces times vertices up to which an object is looked at, whether it shadows itself.
_MOST_PAIRS = 1 << 22

#: Distance behind a face, as a share of the scene, that is rounding.
_BEHIND = 1e-6


class ShadowThrowers:
    """Objects that throw shadows in the light of one light, and those that only receive them.

    Parameters
    ----------
    light : Light
    scene : Scene
    corners : sequence of (n, 3) float64
        Of its objects, as `outermost` gives them.

    Attributes
    ----------
    grounds : tuple of int
        Opaque objects that shadow neither themselves nor one another, large as they may be.
    open_ways : bool
        No opaque object is between the light and any other object.
    """

    def __init__(self, light: Light, scene: Scene, corners: Sequence[Array]) -> None:
        self._light, self._scene, self._corners = light, scene, corners
        grounds: list[int] = []
        for i, item in enumerate(scene.objects):
            if item.medium is None and self._lights(i, (*grounds, i)) and all(self._lights(j, (i,)) for j in grounds):
                grounds.append(i)
        self.grounds = tuple(grounds)
        everything = range(len(corners))
        opaque = (i for i, item in enumerate(scene.objects) if item.medium is None)
        self.open_ways = all(i in grounds and self._lights(i, everything) for i in opaque)

    def cameras(self) -> list[Camera]:
        """Cameras of the light that see all but the grounds; what they do not see is lit."""
        throwing = [points for i, points in enumerate(self._corners) if i not in self.grounds]
        if not throwing:
            return []
        points = np.concatenate(throwing)
        low, high = points.min(axis=0), points.max(axis=0)
        radius = 0.5 * float(np.linalg.norm(high - low)) or self._scene.diagonal or 1.0
        return cameras_towards(points, self._light, 0.5 * (low + high), radius)

    def _lights(self, ground: int, others: Iterable[int]) -> bool:
        """Whether an object shadows none of the others: all that they have is on the lit side of each of its faces."""
        points = np.concatenate([self._corners[i] for i in others])
        item = self._scene.objects[ground]
        faces = item.mesh.faces
        if len(faces) * len(points) > _MOST_PAIRS:
            return False
        vertices = item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3]
        first, second, third = (vertices[faces[:, corner]] for corner in range(3))
        normal = np.cross(second - first, third - first)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        if isinstance(self._light, DirectionalLight):
            towards = np.broadcast_to(-np.asarray(self._light.direction), normal.shape)
        else:
            towards = np.asarray(self._light.position) - first
        normal *= np.sign((normal * towards).sum(axis=1, keepdims=True))
        ahead = points @ normal.T - (first * normal).sum(axis=1)
        return bool((ahead >= -_BEHIND * self._scene.diagonal).all())
