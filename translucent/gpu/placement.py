"""Placement of bodies in a frame: float64 on the CPU, rounded to float32 only relative to each body's center."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

#: Distance to a surface, as a share of the diagonal, within which the eye is on it; anything nearer ahead is clipped.
NEAR_SURFACE = 1e-6


@dataclass(frozen=True)
class Placement:
    """Placement of one object before a camera.

    Attributes
    ----------
    cut : bool
        The eye, or an orthographic image plane, is within the body's bounds: distances count from there.
    anchor : (3,) float64
        World-space vector from the eye to the center of the mesh.
    expected_count : (float, float)
        Least and greatest signed count that a ray may have: exits minus entries ahead of its origin. It is the winding
        number of the body at the origin.
    """

    body: Object
    cut: bool
    anchor: Array
    expected_count: tuple[float, float]

    @classmethod
    def of(cls, body: Object, camera: Camera) -> Placement:
        """Place `body` before `camera`."""
        anchor = body.matrix[:3, :3] @ body.mesh.center + (body.matrix[:3, 3] - camera.eye)
        low, high = body.bounds - camera.eye
        if camera.fov_y is None:
            # The corner of the bounds that is farthest behind decides.
            forward = camera.forward
            cut = bool(np.where(forward > 0, low, high) @ forward < 0)
        else:
            margin = NEAR_SURFACE * float(np.linalg.norm(high - low))
            cut = bool((low <= margin).all() and (high >= -margin).all())
        expected = _expected_count(body, camera) if cut and body.medium is not None else (0.0, 0.0)
        return cls(body, cut, anchor, expected)

    @property
    def on_surface(self) -> bool:
        """Whether the eye is on the surface: rays inwards leave once more than rays outwards."""
        return self.expected_count[0] != self.expected_count[1]

    def camera_from_offset(self, camera: Camera) -> Array:
        """(3, 4): from offsets to metres right of, above and ahead of the eye."""
        rows = np.stack([camera.right, camera.up, camera.forward])
        return np.column_stack([rows @ self.body.matrix[:3, :3], rows @ self.anchor])


@dataclass(frozen=True)
class AxialRange:
    """Nearest and farthest distance along the camera's forward axis, in metres from the eye."""

    near: float
    far: float

    @classmethod
    def of(cls, objects: Sequence[Object], camera: Camera) -> AxialRange:
        """Range of the scene ahead of the eye, or of an orthographic picture."""
        depths = np.concatenate([_corners(body.bounds - camera.eye) @ camera.forward for body in objects])
        near = max(float(depths.min()), 0.0)
        # A flat scene has one depth; any length will do.
        return cls(near, near + (max(float(depths.max()), 0.0) - near or float(np.abs(depths).max()) or 1.0))

    @property
    def length(self) -> float:
        """Length in metres, above 0."""
        return self.far - self.near


@dataclass(frozen=True, eq=False)
class PlacedScene:
    """Scene placed before its camera.

    Attributes
    ----------
    scene : Scene
    placements : tuple of Placement
        Of its objects.
    media : AxialRange
        Of all its media.
    opaque : AxialRange, optional
        Of what is opaque, if anything is.
    """

    scene: Scene
    placements: tuple[Placement, ...]
    media: AxialRange
    opaque: AxialRange | None

    @classmethod
    def of(cls, scene: Scene) -> PlacedScene:
        """Place the objects of a scene before its camera."""
        placements = tuple(Placement.of(body, scene.camera) for body in scene.objects)
        opaque = AxialRange.of(scene.opaque, scene.camera) if scene.opaque else None
        return cls(scene, placements, AxialRange.of(scene.bodies, scene.camera), opaque)

    @property
    def starts_inside(self) -> bool:
        """Whether rays may start inside a body."""
        return any(placement.expected_count[1] > 0 for placement in self.placements)


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


def depth_range(objects: Sequence[Object], camera: Camera, diagonal: float) -> tuple[float, float]:
    """Nearest and farthest distance along the view axis that a depth buffer must hold, in metres."""
    depths = np.concatenate([_corners(body.bounds - camera.eye) @ camera.forward for body in objects])
    near, far = float(depths.min()), float(depths.max())
    margin = 1e-3 * diagonal
    if camera.fov_y is None:
        return near - margin, far + margin
    return max(near - margin, 1e-4 * diagonal), max(far + margin, diagonal)


def _corners(bounds: Array) -> Array:
    """(8, 3): the corners of a box."""
    return np.array([[bounds[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])


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
