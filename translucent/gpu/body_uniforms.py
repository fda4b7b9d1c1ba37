"""Contents of the Body blocks: placement and material of each object, all objects at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.gpu.balance import FaceCounts
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.features import FrameFeatures
from translucent.gpu.layout import BODY
from translucent.gpu.placement import NEAR_SURFACE, PlacedScene, SampleView
from translucent.media.medium import Medium
from translucent.planning.limits import SHEET_ON_OPAQUE

#: A medium denser than this over the scene's diagonal is opaque anyway; the limit keeps float32 products finite.
MAX_SCENE_OPTICAL_DEPTH = 1e30


@dataclass(frozen=True, eq=False)
class BodyRoles:
    """Roles of the objects of a frame, apart from their placement.

    Attributes
    ----------
    anchored : bool
        Distances count from the center of each body, not from the camera.
    sheet_thicknesses : (objects,) float64
        In metres, for passes that draw an object as a sheet.
    counts : FaceCounts
        What their faces add to counts.
    slots : (objects,) int
        Whose winding number their crossings change.
    """

    anchored: bool
    sheet_thicknesses: Array
    counts: FaceCounts
    slots: npt.NDArray[np.intp]

    @classmethod
    def of(cls, features: FrameFeatures, counts: FaceCounts) -> BodyRoles:
        """Roles of all objects of a frame."""
        slots = np.zeros(len(features.scene.objects), dtype=np.intp)
        for number, slot in enumerate(features.slots):
            slots[list(slot.objects)] = number
        return cls(not features.plan.method.counts_from_camera, features.sheet_thicknesses, counts, slots)


def body_records(placed: PlacedScene, roles: BodyRoles, center: Array) -> npt.NDArray[Any]:
    """(objects,): contents of the Body blocks, but for what the view changes: `clip_rows`.

    Parameters
    ----------
    placed, roles
    center : (3,) float64
        Of the media.
    """
    scene, media, counts = placed.scene, placed.media, roles.counts
    camera, diagonal, objects = scene.camera, scene.diagonal, scene.objects
    records = np.zeros(len(objects), BODY.dtype)
    seen = placed.camera_from_offset(camera)
    axes = seen[:, 2].copy()
    if roles.anchored:
        axes[~placed.cut, 3] = 0.0
    records["world_from_normal"] = _normal_matrices(placed)
    records["eye_from_offset"] = np.eye(4)
    records["eye_from_offset"][:, :3, :3], records["eye_from_offset"][:, :3, 3] = (
        placed.matrices[:, :3, :3],
        placed.anchors,
    )
    records["axis"] = axes
    nothing = np.zeros(3)
    extinctions = np.array([nothing if item.medium is None else item.medium.extinction for item in objects])
    records["extinction"][:, :3] = np.minimum(extinctions, _densest(diagonal))
    records["color"][:, :3] = [item.base_color for item in objects]
    records["sheet_thickness"] = roles.sheet_thicknesses
    records["sheet_ior"] = [1.0 if item.medium is None else item.medium.ior for item in objects]
    records["sheet_tolerance"] = SHEET_ON_OPAQUE * diagonal
    starts_cut = placed.cut & (camera.fov_y is None)
    records["axial_start"] = np.where(starts_cut, 0.0, -float(CONSTANTS["NOTHING"]))
    records["count_weight"], records["count_offset"] = counts.weights, counts.offsets
    records["subpixel"], records["snapping_share"] = counts.subpixel, counts.snapping_share
    records["axial_depth_scale"] = 1.0 / media.length
    records["axial_depth_start"] = (seen[:, 2, 3] - axes[:, 3] - media.near) / media.length
    records["slot"] = roles.slots
    records["starts_unknown"] = placed.on_surface
    records["object"] = np.arange(len(objects))
    records["anchor_from_center"][:, :3] = placed.anchors + camera.eye - center
    return records


def clip_rows(placed: PlacedScene, view: SampleView) -> Array:
    """(objects, 4, 4): from offsets to clip space."""
    camera = view.camera
    half_width, half_height = camera.half_extent(view.size)
    seen = placed.camera_from_offset(camera)
    clip = np.zeros((len(seen), 4, 4))
    clip[:, 0], clip[:, 1] = seen[:, 0] / half_width, seen[:, 1] / half_height
    if camera.fov_y is None:
        clip[:, 3, 3] = 1.0
    else:
        clip[:, 3] = seen[:, 2]
    aside, above = camera.center(view.size)
    clip[:, 0] -= (2.0 * view.shift[0] / view.size[0] + aside) * clip[:, 3]
    clip[:, 1] += (2.0 * view.shift[1] / view.size[1] - above) * clip[:, 3]
    if view.depth_range is not None:
        near, far = view.depth_range
        if camera.fov_y is None:
            clip[:, 2] = (2.0 * seen[:, 2] - (near + far) * clip[:, 3]) / (far - near)
        else:
            clip[:, 2] = clip[:, 3] * (far + near) / (far - near) - np.eye(4)[3] * 2.0 * far * near / (far - near)
    else:
        # Triangles through the eye itself have no image: they project to 0/0. Clip them just ahead of it.
        for i in np.flatnonzero(placed.on_surface).tolist():
            clip[i, 2, 3] = -NEAR_SURFACE * placed.scene.objects[i].mesh.diagonal
    return clip


def _normal_matrices(placed: PlacedScene) -> Array:
    """(objects, 4, 4): from normals of meshes to those of the world."""
    inverted = np.array([item.mesh.diagnosis.inverted for item in placed.scene.objects])
    matrices = np.tile(np.eye(4), (len(inverted), 1, 1))
    # The inverse transpose keeps outwards outwards under a mirror; only an inverted mesh has its normals inside.
    turned = np.linalg.inv(placed.matrices[:, :3, :3]).transpose(0, 2, 1) * np.where(inverted, -1.0, 1.0)[:, None, None]
    # The scale of a normal is lost when it is normalized; unit scale keeps it within float32.
    matrices[:, :3, :3] = turned / np.abs(turned).max(axis=(1, 2), keepdims=True)
    return matrices


def bounded_extinction(medium: Medium | None, diagonal: float) -> Array:
    """(3,): extinction in 1/m that float32 can multiply with lengths of the scene; 0 without a medium."""
    return np.zeros(3) if medium is None else np.minimum(medium.extinction, _densest(diagonal))


def _densest(diagonal: float) -> float:
    """Largest extinction in 1/m in a scene of this size."""
    return MAX_SCENE_OPTICAL_DEPTH / max(diagonal, float(np.finfo(np.float64).tiny))
