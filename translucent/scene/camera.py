"""Cameras: right-handed, looking along -Z of their own frame, +Y up. Row 0 of every image is the top row.

A thin lens takes the place of a pinhole: the mean of pictures from all over its aperture is in focus in one plane.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arguments import brief, checked
from translucent.arrays import Array, Frozen
from translucent.errors import InputError
from translucent.geometry.grouping import extent

#: Factor by which a picture is larger than the objects that it frames, unless stated otherwise.
FRAMING_MARGIN = 1.12

#: Direction in which a camera that frames something looks, if none is given.
FRAMED_FROM = (-0.45, -0.35, -1.0)

#: Points that are framed at a time.
FRAMED_AT_ONCE = 1 << 16

#: Largest coordinate of an eye or target in metres, as for meshes.
MAX_COORDINATE = 1e18

#: Angle in radians between one point and the next of a spiral that fills a disc evenly (Vogel 1979).
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True)
class Window:
    """Place of a picture in a larger one of the same camera, in pixels.

    Attributes
    ----------
    left, top : float
        Of its first pixel, from that of the whole picture; fractions shift it by less than a pixel.
    whole : (int, int)
        Width and height of the whole picture.
    """

    left: float
    top: float
    whole: tuple[int, int]


@checked
@dataclass(frozen=True, eq=False)
class Camera(Frozen):
    """Camera with a perspective or orthographic view.

    Parameters
    ----------
    pose : (4, 4) float64
        Camera to world, rigid: the columns are right, up, backward and the eye.
    fov_y : float, optional
        Full vertical angle of view in degrees, between 0 and 180: a perspective camera.
    height : float, optional
        Height of the view in metres: an orthographic camera.
    window : Window, optional
        What is rendered is this part of a larger picture, to which `fov_y` and `height` belong.
    """

    pose: Array
    fov_y: float | None = 45.0
    height: float | None = None
    window: Window | None = None

    def __post_init__(self) -> None:
        pose = np.array(self.pose, dtype=np.float64)
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise InputError("camera pose", "the pose must be a finite 4x4 matrix", "use Camera.look_at")
        rotation = pose[:3, :3]
        if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise InputError(
                "camera pose",
                "the pose scales, shears or mirrors",
                "use Camera.look_at, or remove the scale from the matrix",
            )
        if (self.fov_y is None) == (self.height is None):
            raise InputError(
                "camera",
                "a camera needs either fov_y or height",
                "set fov_y for a perspective camera, or height for an orthographic camera",
            )
        if self.fov_y is not None and not 0 < self.fov_y < 180:
            raise InputError(
                f"camera fov_y {self.fov_y}", "the angle must lie between 0 and 180 degrees", "use a value such as 45"
            )
        if self.height is not None and not (0 < self.height < np.inf):
            raise InputError(
                f"camera height {self.height}",
                "the height must be positive and finite",
                "give the height of the view in metres",
            )
        pose.setflags(write=False)
        object.__setattr__(self, "pose", pose)

    @classmethod
    @checked
    def look_at(
        cls, eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0), fov_y: float = 45.0
    ) -> Camera:
        """Perspective camera at `eye` that looks at `target`, with `up` upwards in the picture.

        Raises
        ------
        InputError
            If the eye is at the target, `up` is along the view, or a number is not finite.
        """
        return cls(_look_at(eye, target, up), fov_y=fov_y)

    @classmethod
    @checked
    def orthographic(
        cls, eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike = (0.0, 1.0, 0.0), height: float = 1.0
    ) -> Camera:
        """Orthographic camera that shows `height` metres from bottom to top."""
        return cls(_look_at(eye, target, up), fov_y=None, height=height)

    @classmethod
    @checked
    def framing(
        cls,
        points: npt.ArrayLike,
        size: tuple[int, int] = (1, 1),
        direction: npt.ArrayLike = FRAMED_FROM,
        fov_y: float = 30.0,
        up: npt.ArrayLike = (0.0, 1.0, 0.0),
        fit: float | None = None,
    ) -> Camera:
        """Perspective camera that frames all points, looking along `direction`.

        Parameters
        ----------
        points : array_like (n, 3)
            In metres: the vertices of what is to be seen, or the corners of its box.
        size : (width, height)
            Size of the picture in pixels: a narrow one needs more distance.
        direction : array_like (3,)
            In which the camera looks.
        fov_y : float
            Full vertical angle of view in degrees.
        up : array_like (3,)
            Upwards in the picture.
        fit : float, optional
            Fraction of the picture's width or height that the points take, whichever is more. Default: a small margin.
        """
        if fit is not None and not 0.0 < fit <= 1.0:
            raise InputError(
                f"camera framing fit {fit}", "the value must be above 0 and at most 1", "use a value such as 0.8"
            )
        framed = np.asarray(points, dtype=np.float64)
        if framed.ndim != 2 or framed.shape[1] != 3 or not len(framed):
            raise InputError(
                f"camera framing points of shape {framed.shape}",
                "the array contains no points",
                "give an array of shape (n, 3)",
            )
        size = check_size(size)
        low, high = extent(framed)
        reach = float(np.linalg.norm(high - low)) or 1.0
        pose, half, axes = _framing_axes(size, direction, fov_y, up, fit)
        middle, farthest = 0.5 * (low + high), np.full(5, -np.inf)
        for begin in range(0, len(framed), FRAMED_AT_ONCE):  # millions of points would take room
            part = (framed[begin : begin + FRAMED_AT_ONCE] - middle) @ axes
            farthest = np.maximum(farthest, extent(part)[1])
        upper, lower = farthest[:2], farthest[2:4]
        center, distance = (upper - lower) / 2, float(((upper + lower) / (2 * half)).max())
        distance = max(distance, float(farthest[4]) + 1e-3 * reach)
        target = middle + pose[:3, :2] @ center
        return cls.look_at(target + pose[:3, 2] * distance, target, up, fov_y)

    @property
    def eye(self) -> Array:
        """(3,): position in metres."""
        return self.pose[:3, 3]

    @property
    def right(self) -> Array:
        """(3,): unit vector to the right of the picture."""
        return self.pose[:3, 0]

    @property
    def up(self) -> Array:
        """(3,): unit vector upwards in the picture."""
        return self.pose[:3, 1]

    @property
    def forward(self) -> Array:
        """(3,): unit vector of the view."""
        return -self.pose[:3, 2]

    @checked
    def half_extent(self, size: tuple[int, int]) -> tuple[float, float]:
        """Half width and half height of the view: at distance 1 for a perspective camera, in metres for the other."""
        half_height = np.tan(np.radians(self.fov_y) / 2) if self.fov_y is not None else (self.height or 0.0) / 2
        if self.window is not None:
            half_height *= size[1] / self.window.whole[1]
        return float(half_height * size[0] / size[1]), float(half_height)

    def center(self, size: tuple[int, int]) -> tuple[float, float]:
        """Center of the view, right and up from the camera's axis, in half widths and half heights of it.

        It is 0 but for a part of a larger picture.
        """
        if (window := self.window) is None:
            return 0.0, 0.0
        width, height = window.whole
        return (2 * window.left + size[0] - width) / size[0], (height - 2 * window.top - size[1]) / size[1]

    def beyond(self, size: tuple[int, int]) -> tuple[float, float, int, int]:
        """Pixels of the whole picture left of and above the view, and the remaining pixels across and down."""
        if (window := self.window) is None:
            return 0, 0, 0, 0
        return window.left, window.top, window.whole[0] - size[0], window.whole[1] - size[1]

    @checked
    def rays(
        self, size: tuple[int, int], offset: tuple[float, float] | tuple[Array, Array] = (0.0, 0.0)
    ) -> tuple[Array, Array]:
        """Rays through the pixel centers.

        Parameters
        ----------
        size : (width, height)
            In pixels.
        offset : (right, down)
            Shift from the pixel centers, in pixels: of all the same, or (h, w) each.

        Returns
        -------
        origins, directions : (h, w, 3) float64
            Directions have unit length; all origins of a perspective camera are the eye.
        """
        if any(np.shape(one) not in ((), tuple(size)[::-1]) for one in offset):
            raise InputError(
                "offset of camera rays",
                "the offset must be two numbers or two arrays of shape (h, w)",
                "give the offset as (right, down)",
            )
        half_width, half_height = self.half_extent(size)
        aside, above = self.center(size)
        x = ((np.arange(size[0]) + 0.5 + offset[0]) / size[0] * 2 - 1 + aside) * half_width
        y = (1 - (np.arange(size[1])[:, None] + 0.5 + offset[1]) / size[1] * 2 + above) * half_height
        across = x[..., None] * self.right + y[..., None] * self.up
        if self.fov_y is None:
            return self.eye + across, np.broadcast_to(self.forward, across.shape).copy()
        directions = across + self.forward
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return np.broadcast_to(self.eye, across.shape).copy(), directions


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """`size` as two ints; raises `InputError` if it is not a positive (width, height)."""
    try:
        width, height = (int(v) for v in size)
        exact = (width, height) == tuple(size)
    except Exception:  # noqa: BLE001 - whatever may be given as a size
        raise InputError(
            f"frame size {brief(size)}",
            "the size must be (width, height)",
            "give two whole numbers, such as (1280, 720)",
        ) from None
    if not exact or width < 1 or height < 1:
        raise InputError(
            f"frame size {brief(size)}", "the size must be two whole numbers above 0", "use a value such as (1280, 720)"
        )
    return width, height


def _framing_axes(
    size: tuple[int, int], direction: npt.ArrayLike, fov_y: float, up: npt.ArrayLike, fit: float | None
) -> tuple[Array, Array, Array]:
    """Pose at the origin, half the picture's width and height at distance 1, and axes (3, 5) along which the farthest
    points decide where a camera has to be.
    """
    axis = np.asarray(direction, dtype=np.float64)
    pose = Camera(_look_at(-axis, np.zeros(3), up), fov_y=fov_y).pose
    aside, back = pose[:3, :2], pose[:3, 2:3]
    half = np.tan(np.radians(fov_y) / 2) * np.array([size[0] / size[1], 1.0])
    half = half / (FRAMING_MARGIN if fit is None else 1.0 / fit)
    # Each point asks for |x - cx| <= half (distance - z): the two sides of the picture meet where both are tight.
    return pose, half, np.concatenate([half * back + aside, half * back - aside, back], axis=1)


def direction_from(yaw: float, pitch: float) -> Array:
    """(3,): unit vector towards a place around the origin: yaw about +Y from +Z, and pitch upwards, in degrees."""
    yaw, pitch = math.radians(yaw), math.radians(pitch)
    return np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])


def framing_directions(
    size: tuple[int, int],
    direction: npt.ArrayLike = FRAMED_FROM,
    fov_y: float = 30.0,
    up: npt.ArrayLike = (0.0, 1.0, 0.0),
    fit: float | None = None,
) -> Array:
    """Directions (11, 3) for which `Camera.framing` needs the farthest points alone."""
    return np.concatenate([np.eye(3), -np.eye(3), _framing_axes(size, direction, fov_y, up, fit)[2].T])


def _look_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike) -> Array:
    e, t, u = (np.asarray(v, dtype=np.float64) for v in (eye, target, up))
    if any(v.shape != (3,) or not np.isfinite(v).all() for v in (e, t, u)):
        raise InputError(
            "camera eye, target or up", "each of them must be three finite numbers", "give (x, y, z) for each of them"
        )
    if max(np.abs(v).max() for v in (e, t, u)) > MAX_COORDINATE:
        raise InputError(
            "camera eye, target or up",
            f"a coordinate is beyond {MAX_COORDINATE:g}",
            "move the camera closer to the origin",
        )
    backward = e - t
    if not (distance := float(np.linalg.norm(backward))) > 0:
        raise InputError("camera", f"eye and target are at the same point {tuple(e.tolist())}", "move one of them")
    backward /= distance
    right = _cross(u, backward)
    if not (length := float(np.linalg.norm(right))) > 1e-9 * float(np.linalg.norm(u)) or length == 0:
        raise InputError(
            "camera",
            f"the up direction {tuple(u.tolist())} is parallel to the view direction",
            "choose another up direction",
        )
    right /= length
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, _cross(backward, right), backward, e
    return pose


def _cross(a: Array, b: Array) -> Array:
    """`np.cross` of two vectors (3,), which takes longer for these: hundreds of cameras look at shadows."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def view_ray(
    pixel: npt.ArrayLike, size: npt.ArrayLike, right: npt.ArrayLike, up: npt.ArrayLike, forward: npt.ArrayLike
) -> Array:
    """Ray through points of a picture, not normalized: it advances 1 m along `forward`.

    Parameters
    ----------
    pixel : array_like (..., 2)
        Right and down from the top left corner, in pixels.
    size : array_like (..., 2)
        Width and height in pixels.
    right, up : array_like (..., 3)
        The camera's axes times half the extent of the view at distance 1; zero for an orthographic camera.
    forward : array_like (..., 3)
        Unit vector of the view.
    """
    ndc = 2.0 * np.asarray(pixel, np.float64) / np.asarray(size, np.float64) - 1.0
    across = ndc[..., :1] * np.asarray(right, np.float64) - ndc[..., 1:] * np.asarray(up, np.float64)
    return np.asarray(np.asarray(forward, np.float64) + across)


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
                raise InputError(
                    f"lens {name} {value!r}", "the value must be finite and above 0", "give the value in metres"
                )

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
