"""Conversion of pyrender's pictures to the toolkit's quantities. Import it by the shim only."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyrender

from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment

#: pyrender encodes the radiance that it finds as a power, and cuts it off at 1 (its shaders/mesh.frag).
GAMMA = 2.2


@dataclass(frozen=True)
class Clipping:
    """Depth range of a pyrender camera: from `near` to `far` metres along its forward axis."""

    near: float
    far: float
    orthographic: bool

    @classmethod
    def of(cls, scene: Any) -> Clipping:
        """Depth range of the scene's camera."""
        camera = scene.main_camera_node.camera
        far = math.inf if camera.zfar is None else camera.zfar
        return cls(camera.znear, far, isinstance(camera, pyrender.OrthographicCamera))

    def metres(self, depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Metres ahead of what the depth test compared, 0 to 1; ``inf`` at 1. The twin of ``shade/backdrop.frag``."""
        share = depth.astype(np.float64)
        nothing = share >= 1.0
        share[nothing] = 0.0
        if self.orthographic:
            metres = self.near * (1.0 - share) + self.far * share
        elif math.isinf(self.far):
            metres = self.near / (1.0 - share)
        else:
            metres = self.near * self.far / (self.far * (1.0 - share) + self.near * share)
        metres[nothing] = math.inf
        return np.asarray(metres)


def ambient_of(scene: Any) -> tuple[float, float, float]:
    """Radiance of the light from all around with which pyrender draws a scene."""
    red, green, blue = map(float, scene.ambient_light[:3])
    return red, green, blue


@dataclass(frozen=True, eq=False)
class Picture:
    """Picture drawn by pyrender, row 0 at the top: `colors` (h, w, 4) uint8, encoded, and `depth` (h, w) in metres; and
    the light from all around that it was drawn with.
    """

    colors: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float64]
    ambient: tuple[float, float, float]

    def backdrop(self) -> Backdrop:
        """The picture with its background."""
        return Backdrop((self.colors[..., :3] / 255.0) ** GAMMA, self.depth, ambient=self.ambient)

    def before(self, environment: Environment, camera: Camera) -> Backdrop:
        """The picture before an environment, where it was drawn on a background without opacity."""
        height, width = self.depth.shape
        opacity = self.colors[..., 3:] / 255.0
        # At an edge the mean of the samples has the background in it, which is black.
        encoded = self.colors[..., :3] / 255.0 / np.where(opacity > 0.0, opacity, 1.0)
        positions = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1) / height
        behind = environment.radiance(camera.rays((width, height))[1], positions)
        radiance = opacity * encoded**GAMMA + (1.0 - opacity) * behind
        return Backdrop(radiance, self.depth, coverage=opacity[..., 0] > 0.0, ambient=self.ambient)
