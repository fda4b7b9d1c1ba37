"""Contents of the Body block: placement and material of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.gpu.balance import FaceCount
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.features import FrameFeatures
from translucent.gpu.layout import BODY
from translucent.gpu.placement import NEAR_SURFACE, AxialRange, Placement, SampleView
from translucent.media.medium import Medium
from translucent.reference.sheets import SHEET_ON_OPAQUE

#: A medium denser than this over the scene's diagonal is opaque anyway; the limit keeps float32 products finite.
MAX_SCENE_OPTICAL_DEPTH = 1e30


@dataclass(frozen=True)
class BodyRole:
    """Role of a body in a frame, apart from its placement.

    Attributes
    ----------
    anchored : bool
        Distances count from the body's center, not from the camera.
    sheet_thickness : float
        In metres, for passes that draw the body as a sheet.
    count : FaceCount
        What its faces add to counts.
    slot : int
        Whose winding number its crossings change.
    number : int
        Its index among the objects of the scene.
    """

    anchored: bool
    sheet_thickness: float
    count: FaceCount
    slot: int
    number: int


def body_roles(features: FrameFeatures, counts: Sequence[FaceCount]) -> tuple[BodyRole, ...]:
    """Roles of all objects of a frame."""
    anchored = not features.plan.method.counts_from_camera
    slot_of = {i: number for number, slot in enumerate(features.slots) for i in slot.objects}
    return tuple(
        BodyRole(anchored, features.sheet_thickness(body), count, slot_of.get(i, 0), i)
        for i, (body, count) in enumerate(zip(features.scene.objects, counts, strict=True))
    )


def body_uniforms(
    placement: Placement, view: SampleView, role: BodyRole, media: AxialRange, diagonal: float, center: Array
) -> bytes:
    """Contents of the Body block.

    Parameters
    ----------
    placement, view, role
    media : AxialRange
        Of all media of the scene.
    diagonal : float
        Of the scene, in metres.
    center : (3,) float64
        Of the media.
    """
    body, camera = placement.body, view.camera
    seen = placement.camera_from_offset(camera)
    axis = seen[2].copy()
    if role.anchored and not placement.cut:
        axis[3] = 0.0
    anchor = seen[2, 3] - axis[3]
    eye_from_offset = np.eye(4)
    eye_from_offset[:3, :3], eye_from_offset[:3, 3] = body.matrix[:3, :3], placement.anchor
    return BODY.pack(
        clip_from_offset=_clip_rows(placement, view, seen),
        world_from_normal=_normal_matrix(placement),
        eye_from_offset=eye_from_offset,
        axis=axis,
        extinction=[*bounded_extinction(body.medium, diagonal), 0.0],
        color=[*body.base_color, 0.0],
        sheet_thickness=role.sheet_thickness,
        sheet_ior=1.0 if body.medium is None else body.medium.ior,
        sheet_tolerance=SHEET_ON_OPAQUE * diagonal,
        axial_start=0.0 if camera.fov_y is None and placement.cut else -float(CONSTANTS["NOTHING"]),
        count_weight=role.count.weight,
        count_offset=role.count.offset,
        subpixel=role.count.subpixel,
        snapping_share=role.count.snapping_share,
        axial_depth_scale=1.0 / media.length,
        axial_depth_start=(anchor - media.near) / media.length,
        slot=role.slot,
        starts_unknown=placement.on_surface,
        object=role.number,
        anchor_from_center=[*(placement.anchor + camera.eye - center), 0.0],
    )


def _clip_rows(placement: Placement, view: SampleView, seen: Array) -> Array:
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    clip = np.zeros((4, 4))
    clip[0], clip[1] = seen[0] / half_width, seen[1] / half_height
    if camera.fov_y is None:
        clip[3, 3] = 1.0
    else:
        clip[3] = seen[2]
    clip[0] -= 2.0 * view.shift[0] / view.size[0] * clip[3]
    clip[1] += 2.0 * view.shift[1] / view.size[1] * clip[3]
    if view.depth_range is not None:
        near, far = view.depth_range
        if camera.fov_y is None:
            clip[2] = (2.0 * seen[2] - (near + far) * clip[3]) / (far - near)
        else:
            clip[2] = clip[3] * (far + near) / (far - near) - np.eye(4)[3] * 2.0 * far * near / (far - near)
    elif placement.on_surface:
        # Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it.
        clip[2, 3] = -NEAR_SURFACE * placement.body.mesh.diagonal
    return clip


def _normal_matrix(placement: Placement) -> Array:
    body = placement.body
    matrix = np.eye(4)
    # The inverse transpose keeps outwards outwards under a mirror; only an inverted mesh has its normals inside.
    matrix[:3, :3] = np.linalg.inv(body.matrix[:3, :3]).T * (-1.0 if body.mesh.diagnosis.inverted else 1.0)
    # The scale of a normal is lost when it is normalized; unit scale keeps it within float32.
    matrix[:3, :3] /= np.abs(matrix[:3, :3]).max()
    return matrix


def bounded_extinction(medium: Medium | None, diagonal: float) -> Array:
    """(3,): extinction in 1/m that float32 can multiply with lengths of the scene; 0 without a medium."""
    limit = MAX_SCENE_OPTICAL_DEPTH / max(diagonal, float(np.finfo(np.float64).tiny))
    return np.zeros(3) if medium is None else np.minimum(medium.extinction, limit)
