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


def extents(boxes: Array, radii: Array, camera: Camera, size: tuple[int, int]) -> Array:
    """(n, 4): left, bottom, right and top edge of what objects may cover, in pixels, at most 2 pixels off the picture;
    right of left nowhere for objects out of view.

    An object lies within its bounds (n, 2, 3) and within a ball of radius (n,) around their center. They enclose the
    images of all faces, since they come from the corners of bounds, and from the ball. Bounds that reach behind the
    eye, and may yet be in view, give all of the picture.
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
    least_of_ball, most_of_ball = _sides_of_balls(seen.mean(axis=1), radii + slack[:, 0], flat=flat)
    low, high = np.maximum(low.min(axis=1), least_of_ball), np.minimum(high.max(axis=1), most_of_ball)
    limits = np.stack([low, high], axis=1) / half
    pixels = np.clip((limits - center + 1.0) * 0.5 * size, -2.0, np.array(size) + 2.0)
    pixels[whole] = [[-2.0, -2.0], [size[0] + 2.0, size[1] + 2.0]]
    pixels[hidden] = 0.0
    return np.asarray(pixels.reshape(count, 4))


def _sides_of_balls(centers: Array, radii: Array, *, flat: bool) -> tuple[Array, Array]:
    """(n, 2) each: least and most that balls reach to the right and up at distance 1, or in metres where rays are
    parallel; infinite for a ball that is not all ahead of the eye. Centers (n, 3): right, up and ahead of the eye.
    """
    across, ahead = centers[:, :2], centers[:, 2:]
    reach = radii[:, None]
    if flat:
        return across - reach, across + reach
    # Seen along an axis of the picture, a ball is a disc between two tangents through the eye.
    distance = np.hypot(across, ahead)
    front = ahead > reach
    way, aside = np.arctan2(across, ahead), np.arcsin(np.where(front, reach / np.where(front, distance, 1.0), 0.0))
    return np.where(front, np.tan(way - aside), -np.inf), np.where(front, np.tan(way + aside), np.inf)


def part_of(edges: Array, shift: tuple[float, float], size: tuple[int, int]) -> Part:
    """Smallest part that holds all of these extents at sample points `shift` (right, down) pixels off the centers."""
    if not len(edges := edges[edges[:, 2] > edges[:, 0]]):
        return Part(0, 0, 0, 0)
    low, high = edges[:, :2].min(axis=0), edges[:, 2:].max(axis=0)
    moved = np.array([-shift[0], shift[1]])
    first = np.clip(np.floor(low + moved - _MARGIN), 0, size).astype(int).tolist()
    last = np.clip(np.ceil(high + moved + _MARGIN), 0, size).astype(int).tolist()
    return Part(first[0], first[1], last[0], last[1])
