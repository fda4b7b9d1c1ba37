"""Rays of a picture, relative to the eye, so that they stay accurate far from the origin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers
from translucent.scene.camera import Camera


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays by index; all arrays are flat.

    Attributes
    ----------
    origins : (n, 3) float64
        In metres from the eye, along the axes of the world; zero for a perspective camera.
    directions : (n, 3) float64
        Unit vectors.
    backdrop : (n, 2) float64
        Position in the picture, right and down from the top left corner, in heights of the picture.
    """

    origins: Array
    directions: Array
    backdrop: Array

    def __len__(self) -> int:
        return len(self.directions)

    def where(self, chosen: Integers | slice) -> Rays:
        """Selection of rays by indices or a slice, renumbered."""
        return Rays(self.origins[chosen], self.directions[chosen], self.backdrop[chosen])


def pixel_rays(camera: Camera, size: tuple[int, int], offset: tuple[float, float] = (0.0, 0.0)) -> Rays:
    """Rays of all pixels; the index of a ray is row * width + column.

    Parameters
    ----------
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift from the pixel centers, in pixels.
    """
    at_origin = camera.pose.copy()
    at_origin[:3, 3] = 0.0
    origins, directions = replace(camera, pose=at_origin).rays(size, offset)
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    left, top, _, more_rows = camera.beyond(size)
    backdrop = (np.stack([column + left, row + top], axis=-1) + 0.5 + offset) / (size[1] + more_rows)
    return Rays(origins.reshape(-1, 3), directions.reshape(-1, 3), backdrop)
