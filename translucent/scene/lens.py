"""Thin lens: pictures from all over an aperture, whose mean is in focus in one plane alone."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.scene.camera import Camera, Window

#: Angle in radians between one point and the next of a spiral that fills a disc evenly (Vogel 1979).
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True)
class Lens:
    """Thin lens in place of the pinhole of a perspective camera.

    A picture through a lens is the mean of those through the points of its aperture, each with the frustum in which the
    plane in focus stays where it is (Haeberli and Akeley 1990, *The Accumulation Buffer*).

    Parameters
    ----------
    diameter : float
        Of the aperture in metres, > 0.
    focus : float
        Distance of the plane in focus from the eye, along the view, in metres, > 0.

    Raises
    ------
    InputError
        If one of them is not above 0 and finite.
    """

    diameter: float
    focus: float

    def __post_init__(self) -> None:
        for name in ("diameter", "focus"):
            if not 0.0 < (value := getattr(self, name)) < math.inf:
                raise InputError(f"lens {name} {value!r}", "not above 0 and finite", "give metres")

    def camera(self, camera: Camera, size: tuple[int, int], number: int, count: int) -> Camera:
        """Camera at one of `count` points of the aperture, for a picture of a size in pixels.

        An orthographic camera stays as it is: all of its picture is in focus.
        """
        if camera.fov_y is None:
            return camera
        offset = 0.5 * self.diameter * aperture_point(number, count)
        half_width, half_height = camera.half_extent(size)
        # What is at the distance of the focus, right and up from the axis, is seen there from every point.
        right = -0.5 * size[0] * offset[0] / (self.focus * half_width)
        down = 0.5 * size[1] * offset[1] / (self.focus * half_height)
        window = camera.window or Window(0, 0, size)
        pose = camera.pose.copy()
        pose[:3, 3] += offset[0] * camera.right + offset[1] * camera.up
        moved = Window(window.left + right, window.top + down, window.whole)
        return dataclasses.replace(camera, pose=pose, window=moved)


def aperture_point(number: int, count: int) -> Array:
    """(2,): point of `count` that fill the unit disc evenly."""
    radius, angle = math.sqrt((number + 0.5) / count), GOLDEN_ANGLE * number
    return radius * np.array([math.cos(angle), math.sin(angle)])
