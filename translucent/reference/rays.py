"""Rays of a picture, relative to the eye, so that they stay accurate far from the origin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

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

    @staticmethod
    def joined(parts: Sequence[Rays]) -> Rays:
        """All rays of one part after another."""
        return Rays(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Rays)))


def pixel_rays(
    camera: Camera, size: tuple[int, int], offset: tuple[float, float] | tuple[Array, Array] = (0.0, 0.0)
) -> Rays:
    """Rays of all pixels; the index of a ray is row * width + column.

    Parameters
    ----------
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift from the pixel centers, in pixels: of all the same, or (h, w) each.
    """
    at_origin = camera.pose.copy()
    at_origin[:3, 3] = 0.0
    origins, directions = replace(camera, pose=at_origin).rays(size, offset)
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    left, top, _, more_rows = camera.beyond(size)
    shift = np.stack([np.ravel(part) for part in offset], axis=-1)
    backdrop = (np.stack([column + left, row + top], axis=-1) + 0.5 + shift) / (size[1] + more_rows)
    return Rays(origins.reshape(-1, 3), directions.reshape(-1, 3), backdrop)
