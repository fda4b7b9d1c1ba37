"""The rays of a picture, a band of rows at a time, so that a large one needs no more memory than a small one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers
from translucent.files.reading import require_memory
from translucent.reference.hits import PictureGrid
from translucent.reference.rays import Rays
from translucent.scene.camera import Camera, check_size

#: Bytes of memory that each pixel takes, at least: the arrays of a frame.
_PIXEL_BYTES = 100

#: Pixels of a band: enough to hide Python's own time, few enough that the working arrays stay below 50 MB.
BAND = 1 << 15

#: Rows of a band: of a narrow picture, too, an edge must not cross too many at a time.
BAND_ROWS = 256


@dataclass(frozen=True)
class Band:
    """Whole rows of a picture. Its pixels count from 0 at its first one: row * width + column, as those of its hits.

    Attributes
    ----------
    first_row, rows, width : int
    """

    first_row: int
    rows: int
    width: int

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.rows * self.width


@dataclass(frozen=True, eq=False)
class Picture:
    """Picture plane: positions of the rays of a camera.

    Attributes
    ----------
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift of the rays from the pixel centers, in pixels.
    grid : PictureGrid
        The points of the picture's plane through which they pass.
    """

    camera: Camera
    size: tuple[int, int]
    offset: tuple[float, float]
    grid: PictureGrid

    @classmethod
    def of(cls, camera: Camera, size: tuple[int, int], offset: tuple[float, float] = (0.0, 0.0)) -> Picture:
        """Picture of a camera; raises `InputError` if the size is invalid."""
        width, height = check_size(size)
        found = f"{width * height / 1e6:.0f} million pixels"
        require_memory(f"frame size {width}x{height}", found, _PIXEL_BYTES * width * height, "give a smaller size")
        centered = PictureGrid.of(camera, size)
        return cls(camera, size, offset, PictureGrid(centered.center - offset, centered.scale))

    @property
    def perspective(self) -> bool:
        """True if the rays meet in the eye."""
        return self.camera.fov_y is not None

    def bands(self) -> Iterator[Band]:
        """Bands of the picture from top to bottom."""
        width, height = self.size
        rows = min(max(BAND // width, 1), BAND_ROWS)
        for first in range(0, height, rows):
            yield Band(first, min(rows, height - first), width)

    def points(self, band: Band, pixel: Integers) -> Array:
        """(k, 2): positions of the rays of pixels (k,) in the picture's plane, right and up."""
        row, column = np.divmod(pixel, band.width)
        return self.grid.points(row + band.first_row, column)

    def rays(self, band: Band) -> Rays:
        """The rays of a band, as `pixel_rays` has them."""
        pixel = np.arange(band.pixels)
        points, camera = self.points(band, pixel), self.camera
        across = points[:, :1] * camera.right + points[:, 1:] * camera.up
        row, column = np.divmod(pixel, band.width)
        left, top, _, more_rows = camera.beyond(self.size)
        place = np.stack([column + left, row + band.first_row + top], axis=-1)
        backdrop = (place + 0.5 + self.offset) / (self.size[1] + more_rows)
        if not self.perspective:
            return Rays(across, np.broadcast_to(camera.forward, across.shape), backdrop)
        directions = across + camera.forward
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(np.zeros(across.shape), directions, backdrop)
