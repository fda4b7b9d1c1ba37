"""Views from the lights of a scene at its media: bodies placed before each, and lookup data for shaders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from translucent.arrays import Array
from translucent.gpu.job import FrameJob
from translucent.gpu.layout import MEDIA
from translucent.gpu.light_cameras import media_sphere
from translucent.gpu.placement import PlacedScene, SampleView
from translucent.gpu.scene_view import CameraView
from translucent.gpu.targets import Targets
from translucent.gpu.uniforms import LightLookup, media_uniforms
from translucent.scene.camera import Camera


class LightView(CameraView):
    """View of the scene from a light in one direction.

    It has uniforms of its own for what depends on the camera only, and leaves bound what the frame has bound else.

    Parameters
    ----------
    job : FrameJob
    camera : Camera
        At the light.
    targets : Targets
        Of the size of the view.
    """

    def __init__(self, job: FrameJob, camera: Camera, targets: Targets) -> None:
        placed = PlacedScene.of(replace(job.scene, camera=camera))
        contents = {MEDIA: media_uniforms(placed, job.features.slots)}
        super().__init__(job.gl, placed, job.roles, contents, targets, job.resources)
        self.uniforms.place(SampleView(camera, targets.size))

    @property
    def texels(self) -> int:
        """Number of the rays of the view."""
        return self.targets.size[0] * self.targets.size[1]

    def rows(self, center: Array) -> Array:
        """(4, 4): from points, relative to the center of the media, to x, y and w of the picture, and depth."""
        camera, media = self.scene.camera, self.placed.media
        axes = np.stack([camera.right, camera.up, camera.forward])
        seen = np.column_stack([axes, axes @ (center - camera.eye)])
        half_width, half_height = camera.half_extent(self.targets.size)
        one = np.array([0.0, 0.0, 0.0, 1.0])
        axial_depth = (seen[2] - media.near * one) / media.length
        return np.stack(
            [seen[0] / half_width, seen[1] / half_height, one if camera.fov_y is None else seen[2], axial_depth]
        )


def first_texels(views: Sequence[LightView]) -> list[int]:
    """Number of the first texel of each view, where all are numbered through."""
    return [sum(view.texels for view in views[:i]) for i in range(len(views))]


def light_lookup(groups: Sequence[Sequence[LightView]]) -> LightLookup:
    """Lookup of each light's views, and of points in them; a group holds the views of one light."""
    views = [view for group in groups for view in group]
    offsets = first_texels(views)
    spans, first = [], 0
    for group in groups:
        spans.append((first, len(group), group[0].targets.size[0], offsets[first]))
        first += len(group)
    center, _ = media_sphere(views[0].scene)
    rows = np.concatenate([view.rows(center) for view in views])
    inside = tuple(group[0].placed.starts_inside for group in groups)
    return LightLookup(center, inside, np.array(spans, dtype=np.float64), rows)
