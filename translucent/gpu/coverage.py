"""Part of a picture that bodies can cover, from their bounds: what lies outside of it is known without drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.scene.camera import Camera

#: Rounding of float32 that vertices may suffer, as a share of their distance from the eye, with room to spare.
_ROUNDING = 1e-5

#: Pixels around the bounds: the rasterizer snaps vertices to a grid finer than that.
_MARGIN = 1.0


@dataclass(frozen=True)
class Part:
    """Rectangle of pixels, counted right and up from the bottom left corner as OpenGL counts them."""

    left: int
    bottom: int
    right: int
    top: int

    def __bool__(self) -> bool:
        """True if it has any pixels."""
        return self.right > self.left and self.top > self.bottom

    @property
    def scissor(self) -> tuple[int, int, int, int]:
        """Left, bottom, width and height."""
        return self.left, self.bottom, self.right - self.left, self.top - self.bottom

    def flipped(self, height: int) -> Part:
        """The same part of a picture of this height whose first row is the top one."""
        return Part(self.left, height - self.top, self.right, height - self.bottom)

    def rows(self, first: int, last: int) -> Part:
        """The part of its rows from `first` on that are before `last`."""
        return Part(self.left, max(self.bottom, first), self.right, min(self.top, last))

    def rest(self, size: tuple[int, int]) -> tuple[Part, ...]:
        """Parts that together are all other pixels of a picture, each once."""
        width, height = size
        if not self:
            return (Part(0, 0, width, height),)
        parts = (
            Part(0, 0, width, self.bottom),
            Part(0, self.bottom, self.left, self.top),
            Part(self.right, self.bottom, width, self.top),
            Part(0, self.top, width, height),
        )
        return tuple(part for part in parts if part)


def extents(boxes: Array, camera: Camera, size: tuple[int, int]) -> Array:
    """(n, 4): left, bottom, right and top edge of what objects with these bounds (n, 2, 3) may cover, in pixels, at
    most 2 pixels off the picture; right of left nowhere for objects out of view.

    They enclose the images of all faces, since they come from the corners of bounds. Bounds that reach behind the eye,
    and may yet be in view, give all of the picture.
    """
    count = len(boxes)
    bounds = boxes - camera.eye
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    corners = bounds[:, choice, np.arange(3)]
    frame = np.stack([camera.right, camera.up, camera.forward])
    seen = np.einsum("ncj,ij->nci", corners, frame)
    slack = _ROUNDING * np.abs(corners).max(axis=(1, 2))[:, None]
    half = np.array(camera.half_extent(size))
    across, ahead = seen[..., :2], seen[..., 2]
    flat = camera.fov_y is None
    # Sample points are shifted by less than a pixel: what is four beyond the edge is out of view for all of them.
    wide = half * (1.0 + 8.0 / np.array(size))
    center = np.array(camera.center(size))
    spread = np.ones_like(ahead)[..., None] if flat else np.maximum(ahead + slack, 0.0)[..., None]
    most, least = (center * half + wide) * spread, (center * half - wide) * spread
    beyond = (across - slack[..., None] > most).all(axis=1) | (across + slack[..., None] < least).all(axis=1)
    hidden = beyond.any(axis=1)
    if not flat:  # an orthographic ray is a whole line, whose faces count behind the picture, too
        hidden |= (ahead < -slack).all(axis=1)
    near = np.ones_like(ahead) if flat else ahead - slack
    whole = (near <= 0.0).any(axis=1)
    near = np.where(whole[:, None], 1.0, near)[..., None]
    far = np.ones_like(near) if flat else (np.abs(ahead) + slack)[..., None]
    # An edge is farthest out at the near end of the slack where it is on that side, and at the far end elsewhere.
    low, high = across - slack[..., None], across + slack[..., None]
    low, high = np.where(low < 0.0, low / near, low / far), np.where(high > 0.0, high / near, high / far)
    limits = np.stack([low.min(axis=1), high.max(axis=1)], axis=1) / half
    pixels = np.clip((limits - center + 1.0) * 0.5 * size, -2.0, np.array(size) + 2.0)
    pixels[whole] = [[-2.0, -2.0], [size[0] + 2.0, size[1] + 2.0]]
    pixels[hidden] = 0.0
    return np.asarray(pixels.reshape(count, 4))


def part_of(edges: Array, shift: tuple[float, float], size: tuple[int, int]) -> Part:
    """Smallest part that holds all of these extents at sample points `shift` (right, down) pixels off the centers."""
    if not len(edges := edges[edges[:, 2] > edges[:, 0]]):
        return Part(0, 0, 0, 0)
    low, high = edges[:, :2].min(axis=0), edges[:, 2:].max(axis=0)
    moved = np.array([-shift[0], shift[1]])
    first = np.clip(np.floor(low + moved - _MARGIN), 0, size).astype(int).tolist()
    last = np.clip(np.ceil(high + moved + _MARGIN), 0, size).astype(int).tolist()
    return Part(first[0], first[1], last[0], last[1])
