"""Where bodies are in a frame: float64 on the CPU, rounded to float32 only relative to each body's center."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.camera import Camera
from translucent.gpu.layout import BODY, VIEW
from translucent.gpu.shaders import CONSTANTS
from translucent.scene import Object, Scene

Array = npt.NDArray[np.float64]

#: A medium denser than this over the scene's diagonal is opaque anyway; the limit keeps float32 products finite.
MAX_SCENE_OPTICAL_DEPTH = 1e30

#: An eye nearer to a surface than this share of the diagonal is on it; what is nearer than that ahead is clipped.
_NEAR_SURFACE = 1e-6


@dataclass(frozen=True)
class Placement:
    """One object as seen by a camera.

    Attributes
    ----------
    cut : bool
        The eye, or an orthographic image plane, is within the body's bounds: distances count from there.
    anchor : (3,) float64
        World-space vector from the eye to the center of the mesh.
    expected_count : (float, float)
        Least and greatest signed count that a ray may have: exits minus entries ahead of its origin.
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
            margin = _NEAR_SURFACE * float(np.linalg.norm(high - low))
            cut = bool((low <= margin).all() and (high >= -margin).all())
        return cls(body, cut, anchor, _expected_count(body, camera) if cut else (0.0, 0.0))

    @property
    def on_surface(self) -> bool:
        """Whether the eye is on the surface: rays inwards leave once more than rays outwards."""
        return self.expected_count[0] != self.expected_count[1]

    def uniforms(
        self,
        camera: Camera,
        size: tuple[int, int],
        shift: tuple[float, float],
        *,
        anchored: bool,
        sheet_thickness: float,
        count_weight: float,
        max_extinction: float,
        depth_range: tuple[float, float] | None = None,
    ) -> bytes:
        """Contents of the Body block.

        Parameters
        ----------
        camera, size
        shift : (right, down)
            Of the sample points from the pixel centers, in pixels.
        anchored : bool
            Count distances from the body's center, not from the camera.
        sheet_thickness : float
            In metres, for passes that draw the body as a sheet.
        count_weight : float
            What one face adds to the count.
        max_extinction : float
            In 1/m.
        depth_range : (near, far), optional
            Write depth between these; else all depths are alike, so that nothing is clipped but what is behind.
        """
        linear = self.body.matrix[:3, :3]
        rows = np.stack([camera.right, camera.up, camera.forward])
        seen = np.column_stack([rows @ linear, rows @ self.anchor])  # camera space, from offsets
        half_width, half_height = camera.half_extent(size)
        clip = np.zeros((4, 4))
        clip[0], clip[1] = seen[0] / half_width, seen[1] / half_height
        if camera.fov_y is None:
            clip[3, 3] = 1.0
        else:
            clip[3] = seen[2]
        clip[0] -= 2.0 * shift[0] / size[0] * clip[3]
        clip[1] += 2.0 * shift[1] / size[1] * clip[3]
        clip[2] = self._depth_row(camera, clip[3], seen[2], depth_range)
        medium = self.body.medium
        extinction = np.zeros(3) if medium is None else np.minimum(medium.extinction, max_extinction)
        from_normal = np.eye(4)
        # The inverse transpose keeps outwards outwards under a mirror; only an inverted mesh has its normals inside.
        from_normal[:3, :3] = np.linalg.inv(linear).T * (-1.0 if self.body.mesh.diagnosis.inverted else 1.0)
        # The scale of a normal is lost when it is normalised; unit scale keeps it within float32.
        from_normal[:3, :3] /= np.abs(from_normal[:3, :3]).max()
        axis = seen[2].copy()
        if anchored and not self.cut:
            axis[3] = 0.0
        return BODY.pack(
            clip_from_offset=clip,
            world_from_normal=from_normal,
            axis=axis,
            extinction=[*extinction, 0.0],
            sheet_thickness=sheet_thickness,
            sheet_ior=1.0 if medium is None else medium.ior,
            axial_start=0.0 if camera.fov_y is None and self.cut else -float(CONSTANTS["NOTHING"]),
            count_weight=count_weight,
        )

    def _depth_row(
        self, camera: Camera, w_row: Array, axial_row: Array, depth_range: tuple[float, float] | None
    ) -> Array:
        if depth_range is not None:
            near, far = depth_range
            if camera.fov_y is None:
                return np.asarray((2.0 * axial_row - (near + far) * w_row) / (far - near))
            return np.asarray(w_row * (far + near) / (far - near) - np.eye(4)[3] * 2.0 * far * near / (far - near))
        if self.on_surface:
            # Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it.
            return np.array([0.0, 0.0, 0.0, -_NEAR_SURFACE * self.body.mesh.diagonal])
        return np.zeros(4)


def _expected_count(body: Object, camera: Camera) -> tuple[float, float]:
    """Signed counts that are right for a body whose bounds the eye, or the image plane, is in."""
    if body.sheet_thickness is not None or camera.fov_y is None:
        # An orthographic ray is a whole line: it leaves a body as often as it enters, some of it behind the picture.
        return 0.0, 0.0
    number = round(body.winding_number(camera.eye), 6)
    local = np.linalg.solve(body.matrix[:3, :3], camera.eye - body.matrix[:3, 3])
    if body.mesh.diagnosis.solid and body.mesh.is_near(local, _NEAR_SURFACE * body.mesh.diagonal):
        # On the surface, and where float32 cannot tell, a ray may start on either side of it.
        return max(float(np.ceil(number)) - 1.0, 0.0), float(np.floor(number)) + 1.0
    return float(round(number)), float(round(number))


def view_uniforms(camera: Camera, size: tuple[int, int], shift: tuple[float, float]) -> bytes:
    """Contents of the View block."""
    half_width, half_height = camera.half_extent(size)
    perspective = camera.fov_y is not None
    return VIEW.pack(
        frame_size=[*size, *shift],
        ray_right=[*(camera.right * half_width * perspective), 0.0],
        ray_up=[*(camera.up * half_height * perspective), 0.0],
        ray_forward=[*camera.forward, 0.0],
    )


def depth_range(scene: Scene) -> tuple[float, float]:
    """Nearest and farthest distance along the view axis that a depth buffer must hold, in metres."""
    camera = scene.camera
    low, high = scene.bounds - camera.eye
    corners = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
    axial = corners @ camera.forward
    far = float(axial.max())
    near = float(axial.min())
    margin = 1e-3 * scene.diagonal
    if camera.fov_y is None:
        return near - margin, far + margin
    return max(near - margin, 1e-4 * scene.diagonal), max(far + margin, scene.diagonal)
