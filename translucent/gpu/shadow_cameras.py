"""Cameras that look from lights at what throws shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from translucent.arrays import Array, Mask
from translucent.gpu.light_cameras import cameras_towards
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Object, Scene

#: Faces times vertices up to which an object is looked at, whether it shadows itself.
_MOST_PAIRS = 1 << 22

#: Distance behind a face, as a share of the scene, that is rounding.
_BEHIND = 1e-6


def holds_eye(item: Object, scene: Scene) -> bool:
    """Whether the eye is in the bounds of an object, so that its inner side may be seen."""
    low, high = item.bounds
    return bool((low <= scene.camera.eye).all() and (scene.camera.eye <= high).all())


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
    in_the_way : tuple of int
        Opaque objects that may be between the light and another object, or themselves: all but grounds before which
        everything is.
    """

    def __init__(self, light: Light, scene: Scene, corners: Sequence[Array]) -> None:
        self._light, self._scene, self._corners = light, scene, corners
        grounds: list[int] = []
        # Large ones first: leaving those out makes the texels of maps smaller.
        for i in sorted(range(len(corners)), key=lambda i: -float(np.ptp(corners[i], axis=0).max())):
            if (
                scene.objects[i].medium is None
                and self._lights(i, (*grounds, i))
                and all(self._lights(j, (i,)) for j in grounds)
            ):
                grounds.append(i)
        self.grounds = tuple(grounds)
        everything = range(len(corners))
        opaque = (i for i, item in enumerate(scene.objects) if item.medium is None)
        self.in_the_way = tuple(i for i in opaque if i not in grounds or not self._lights(i, everything))

    def cameras(self) -> list[Camera]:
        """Cameras of the light that see all but the grounds; what they do not see is lit."""
        throwing = [points for i, points in enumerate(self._corners) if i not in self.grounds]
        if not throwing:
            return []
        points = np.concatenate(throwing)
        low, high = (
            np.min([part.T.min(axis=1) for part in throwing], axis=0),
            np.max([part.T.max(axis=1) for part in throwing], axis=0),
        )
        radius = 0.5 * float(np.linalg.norm(high - low)) or self._scene.diagonal or 1.0
        cameras = cameras_towards(points, self._light, 0.5 * (low + high), radius)
        if not isinstance(self._light, DirectionalLight):
            return cameras
        # Grounds may be nearer to the light: they end its rays there.
        (camera,) = cameras
        nearer = max(float(((camera.eye - corners) @ camera.forward).max()) for corners in self._corners)
        pose = camera.pose.copy()
        pose[:3, 3] -= max(nearer, 0.0) * camera.forward
        return [replace(camera, pose=pose)]

    def _lights(self, ground: int, others: Sequence[int]) -> bool:
        """Whether an object shadows none of the others: each is before the lit sides of all its faces, or, of a convex
        one that the eye is not in, of some face.
        """
        item = self._scene.objects[ground]
        if len(item.mesh.faces) * sum(len(self._corners[i]) for i in others) > _MOST_PAIRS:
            return False
        first, normal, cosine = self._faces(item)
        turned = normal * np.sign(cosine)[:, None]
        convex = item.mesh.diagnosis.convex and not holds_eye(item, self._scene)
        outwards = (-normal if item.faces_inwards else normal)[(cosine < 0) == item.faces_inwards]
        lit = first[(cosine < 0) == item.faces_inwards]
        for i in others:
            if convex and i == ground:
                continue  # of a convex body what faces the light is lit
            before = self._ahead(self._corners[i], first, turned).all()
            if not before and not (convex and self._ahead(self._corners[i], lit, outwards).all(axis=0).any()):
                return False
        return True

    def _ahead(self, points: Array, first: Array, normals: Array) -> Mask:
        """(n, faces): whether points (n, 3) are before the planes of faces, but for rounding."""
        ahead = points @ normals.T - (first * normals).sum(axis=1)
        return np.asarray(ahead >= -_BEHIND * self._scene.diagonal)

    def _faces(self, item: Object) -> tuple[Array, Array, Array]:
        """First corners (m, 3) of the faces of an object, unit normals (m, 3), and what these are times the way to the
        light, (m,).
        """
        vertices = item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3]
        first, second, third = (vertices[item.mesh.faces[:, corner]] for corner in range(3))
        normal = np.cross(second - first, third - first)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        if isinstance(self._light, DirectionalLight):
            towards = np.broadcast_to(-np.asarray(self._light.direction), normal.shape)
        else:
            towards = np.asarray(self._light.position) - first
        return first, normal, (normal * towards).sum(axis=1)
