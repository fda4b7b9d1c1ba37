"""Placement of objects in a frame: float64 on the CPU, rounded to float32 only relative to each body's center."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Mask
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

#: Distance to a surface, as a share of the diagonal, within which the eye is on it; anything nearer ahead is clipped.
NEAR_SURFACE = 1e-6


@dataclass(frozen=True)
class AxialRange:
    """Nearest and farthest distance along the camera's forward axis, in metres from the eye."""

    near: float
    far: float

    @classmethod
    def of(cls, objects: Sequence[Object], camera: Camera) -> AxialRange:
        """Range of the scene ahead of the eye, or of an orthographic picture."""
        return cls.of_boxes(np.array([item.bounds for item in objects]), camera)

    @classmethod
    def of_boxes(cls, boxes: Array, camera: Camera) -> AxialRange:
        """The same of what has these bounds (n, 2, 3)."""
        depths = _corners(boxes - camera.eye) @ camera.forward
        near = max(float(depths.min()), 0.0)
        # A flat scene has one depth; any length will do.
        return cls(near, near + (max(float(depths.max()), 0.0) - near or float(np.abs(depths).max()) or 1.0))

    @property
    def length(self) -> float:
        """Length in metres, above 0."""
        return self.far - self.near


@dataclass(frozen=True, eq=False)
class PlacedScene:
    """Scene placed before its camera; arrays have a row for each of its objects.

    Attributes
    ----------
    scene : Scene
    matrices : (objects, 4, 4) float64
        From the object to the world.
    anchors : (objects, 3) float64
        World-space vector from the eye to the center of the mesh.
    open_from : (objects,) float64
        Metres ahead of the eye, along the camera's axis, from which on the surface of a body may be open.
    cut : (objects,) bool
        The eye, or an orthographic image plane, is within the object's bounds: distances count from there.
    expected_counts : (objects, 2) float64
        Least and greatest signed count that a ray may have: exits minus entries ahead of its origin. It is the winding
        number of the body at the origin.
    media : AxialRange
        Of all its media.
    opaque : AxialRange, optional
        Of what is opaque, if anything is.
    """

    scene: Scene
    matrices: Array
    anchors: Array
    open_from: Array
    cut: Mask
    expected_counts: Array
    media: AxialRange
    opaque: AxialRange | None

    @classmethod
    def of(cls, scene: Scene) -> PlacedScene:
        """Place the objects of a scene before its camera."""
        camera, objects = scene.camera, scene.objects
        matrices = np.array([item.transform for item in objects])
        centers = np.array([item.mesh.center for item in objects])
        anchors = (matrices[:, :3, :3] @ centers[..., None])[..., 0] + (matrices[:, :3, 3] - camera.eye)
        cut = _cut(scene.boxes - camera.eye, camera)
        expected = np.zeros((len(objects), 2))
        for i in np.flatnonzero(cut & scene.filled).tolist():
            expected[i] = _expected_count(objects[i], camera)
        open_from = np.array([item.open_from(camera) if item.medium is not None else np.inf for item in objects])
        opaque = AxialRange.of_boxes(scene.boxes[~scene.filled], camera) if scene.opaque else None
        media = AxialRange.of_boxes(scene.boxes[scene.filled], camera)
        return cls(scene, matrices, anchors, open_from, cut, expected, media, opaque)

    @property
    def on_surface(self) -> Mask:
        """(objects,): whether the eye is on the surface: rays inwards leave once more than rays outwards."""
        return np.asarray(self.expected_counts[:, 0] != self.expected_counts[:, 1])

    @property
    def starts_inside(self) -> bool:
        """True if rays may start inside a body."""
        return bool((self.expected_counts[:, 1] > 0).any())

    def camera_from_offset(self, camera: Camera) -> Array:
        """(objects, 3, 4): from offsets to metres right of, above and ahead of the eye."""
        rows = np.stack([camera.right, camera.up, camera.forward])
        return np.concatenate([rows @ self.matrices[:, :3, :3], rows @ self.anchors[..., None]], axis=2)


@dataclass(frozen=True)
class SampleView:
    """Camera with the sample points of a picture.

    Attributes
    ----------
    camera : Camera
    size : (int, int)
        Width and height in pixels.
    shift : (float, float)
        Of the sample points from the pixel centers, right and down, in pixels.
    depth_range : (float, float), optional
        Write depth between these metres; else all depths are alike, so that nothing is clipped but what is behind.
    corner : (int, int)
        Left and bottom of the picture in its target, in pixels.
    """

    camera: Camera
    size: tuple[int, int]
    shift: tuple[float, float] = (0.0, 0.0)
    depth_range: tuple[float, float] | None = None
    corner: tuple[int, int] = (0, 0)


def depth_range(boxes: Array, camera: Camera, diagonal: float) -> tuple[float, float]:
    """Nearest and farthest distance along the view axis that a depth buffer must hold, in metres, for these bounds."""
    depths = _corners(boxes - camera.eye) @ camera.forward
    near, far = float(depths.min()), float(depths.max())
    margin = 1e-3 * diagonal
    if camera.fov_y is None:
        return near - margin, far + margin
    return max(near - margin, 1e-4 * diagonal), max(far + margin, diagonal)


def _corners(boxes: Array) -> Array:
    """(n, 8, 3): the corners of boxes (n, 2, 3)."""
    choice = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)])
    return np.asarray(boxes[:, choice, np.arange(3)])


def _cut(boxes: Array, camera: Camera) -> Mask:
    """(n,): whether rays start within these bounds (n, 2, 3), which count from the eye."""
    low, high = boxes[:, 0], boxes[:, 1]
    if camera.fov_y is None:
        # The corner of the bounds that is farthest behind decides.
        forward = camera.forward
        return np.asarray(np.where(forward > 0, low, high) @ forward < 0)
    margin = NEAR_SURFACE * np.linalg.norm(high - low, axis=1)[:, None]
    return np.asarray((low <= margin).all(axis=1) & (high >= -margin).all(axis=1))


def _expected_count(body: Object, camera: Camera) -> tuple[float, float]:
    """Valid signed counts of a body whose bounds contain the eye or part of the image plane."""
    if body.sheet_thickness is not None or camera.fov_y is None:
        # An orthographic ray is a whole line: it leaves a body as often as it enters, some of it behind the picture.
        return 0.0, 0.0
    number = round(body.winding_number(camera.eye), 6)
    local = np.linalg.solve(body.matrix[:3, :3], camera.eye - body.matrix[:3, 3])
    if body.mesh.diagnosis.solid and body.mesh.is_near(local, NEAR_SURFACE * body.mesh.diagonal):
        # On the surface, and where float32 cannot tell, a ray may start on either side of it.
        return max(float(np.ceil(number)) - 1.0, 0.0), float(np.floor(number)) + 1.0
    return float(round(number)), float(round(number))
