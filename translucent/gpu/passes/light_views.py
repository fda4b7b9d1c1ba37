"""Views from the lights: the optical depth from each light to each point in the media."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.errors import RenderError
from translucent.gpu.constants import CONSTANTS, STORAGE_BINDINGS
from translucent.gpu.features import FrameFeatures
from translucent.gpu.job import CameraView, FrameJob
from translucent.gpu.layout import MEDIA
from translucent.gpu.light_cameras import light_cameras, light_key, media_sphere, objects_key
from translucent.gpu.passes.opaque import OpaquePass
from translucent.gpu.passes.variants import Variants, walk_switches
from translucent.gpu.placement import PlacedScene, SampleView
from translucent.gpu.shaders import set_uniform
from translucent.gpu.targets import Targets
from translucent.gpu.uniforms import LightLookup, media_uniforms
from translucent.planning.passes import PassSpec
from translucent.scene.camera import Camera
from translucent.scene.scene import Light


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
        frame = np.column_stack([axes, axes @ (center - camera.eye)])
        half_width, half_height = camera.half_extent(self.targets.size)
        one = np.array([0.0, 0.0, 0.0, 1.0])
        axial_depth = (frame[2] - media.near * one) / media.length
        return np.stack(
            [frame[0] / half_width, frame[1] / half_height, one if camera.fov_y is None else frame[2], axial_depth]
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


#: Bytes of a node, and of the record at each.
_NODE, _MEDIUM = 16, 16

#: Texels along a side of a light's view, and twice those of each of the six of a cube: the first that fit are taken.
_SIDES = (1024, 512, 256, 128)

#: Buffers that shaders read once they are filled.
_READ = ("light_heads", "light_nodes", "light_media", "light_ends")

#: Nodes in the first buffers, for each texel: enough for most bodies. Frames that need more get larger ones, and keep
#: them.
_FIRST_SHARE = 1.25

#: Factor of spare room in a buffer that grows, so that the next frame does not have to grow it again.
_SLACK = 1.25


class LightViewsPass:
    """Views from each light: lists of crossings with optical depths; see ``shaders/volume/light_views.glsl``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._lists = Variants(
            gl, "geometry/body.vert", "intervals/fragment_lists.frag", "opaque_axial_depth", version=430
        )
        self._sorting = Variants(
            gl, "geometry/fullscreen.vert", "volume/light_lists.frag", "opaque_axial_depth", version=430
        )
        self._opaque = OpaquePass(gl)
        self._targets: dict[int, Targets] = {}
        self._held: tuple[object, LightLookup] | None = None

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Build the lists of all views, and write the uniforms of the lights."""
        # Lights see the same from frame to frame, wherever the camera is.
        key = _views_key(job)
        if self._held is None or self._held[0] != key:
            self._held = None
            self._held = key, self._look(job, spec)
        job.light(self._held[1])
        job.uniforms.bind()
        for name in _READ:
            if name != "light_ends" or job.scene.opaque:
                job.resources.light_lists.get(name, 1).bind_to_storage_buffer(STORAGE_BINDINGS[name])

    def _look(self, job: FrameJob, spec: PassSpec) -> LightLookup:
        """Build the views of all lights, in the largest size that fits."""
        for side in _SIDES:
            if (found := self._look_closely(job, spec, side)) is not None:
                return found
        megabytes = job.resources.light_lists.largest / 1e6
        raise RenderError(
            f"{len(job.scene.lights)} lights on scattering media",
            f"the sorted lists for these lights exceed the {megabytes:.0f} MB that a shader of this OpenGL can read",
            "use fewer lights, or meshes with fewer triangles",
        )

    def _look_closely(self, job: FrameJob, spec: PassSpec, side: int) -> LightLookup | None:
        """Build the views of all lights in a given size; None if no buffer holds them."""
        groups = [self._views(job, light, side) for light in job.scene.lights]
        views = [view for group in groups for view in group]
        try:
            return light_lookup(groups) if self._fill(job, spec, views) else None
        finally:
            for view in views:
                view.uniforms.release()

    def _views(self, job: FrameJob, light: Light, side: int) -> list[LightView]:
        cameras = light_cameras(light, job.scene)
        side = side if len(cameras) == 1 else side // 2
        if side not in self._targets:
            self._targets[side] = Targets(self._gl, (side, side))
        return [LightView(job, camera, self._targets[side]) for camera in cameras]

    def _fill(self, job: FrameJob, spec: PassSpec, views: list[LightView]) -> bool:
        """Build the lists of surfaces of all views, again with larger buffers if they did not fit; False if none do."""
        lists = job.resources.light_lists
        cells = sum(view.texels for view in views)
        # Where a light is inside, each of its lists begins with a crossing of its own.
        spare = sum(view.texels for view in views if view.placed.starts_inside)
        most = lists.largest // max(_NODE, _MEDIUM)
        if 4 * cells > lists.largest or spare > most:
            return False
        heads, count = lists.get("light_heads", 4 * cells), lists.get("light_count", 4)
        if job.scene.opaque:
            lists.get("light_ends", 4 * cells).bind_to_storage_buffer(STORAGE_BINDINGS["light_ends"])
        needed = min(int(_FIRST_SHARE * cells) + 1, most)
        while True:
            nodes, media = lists.get("light_nodes", _NODE * needed), lists.get("light_media", _MEDIUM * needed)
            count.write(np.zeros(1, np.uint32))
            heads.clear()
            for name, buffer in (("count", count), ("heads", heads), ("nodes", nodes), ("light_media", media)):
                buffer.bind_to_storage_buffer(STORAGE_BINDINGS[name])
            for view, offset in zip(views, first_texels(views), strict=True):
                self._draw(view, spec, offset)
            found = int(np.frombuffer(count.read(), np.uint32)[0]) + spare
            if found <= min(nodes.size // _NODE, media.size // _MEDIUM):
                break
            if found > most:
                return False
            needed = min(int(found * _SLACK), most)
        for view, offset in zip(views, first_texels(views), strict=True):
            self._sort(view, job.features, offset)
        return True

    def _draw(self, view: LightView, spec: PassSpec, offset: int) -> None:
        """Put the crossings of one view into its lists."""
        gl = self._gl
        view.uniforms.bind()
        if view.scene.opaque:
            self._draw_opaque(view)
        view.targets.nothing().use()
        gl.enable_only(moderngl.NOTHING)
        if view.scene.opaque:
            view.targets.opaque_ends().color_attachments[0].use(0)
        program = self._lists.program(WITH_NORMAL=0, WITH_POSITION=0, OPAQUE=bool(view.scene.opaque), GRADIENT=1)
        set_uniform(program, "cell_offset", offset)
        view.draw(program, spec.objects)
        gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)

    def _draw_opaque(self, view: LightView) -> None:
        opaque = tuple(i for i, item in enumerate(view.scene.objects) if item.medium is None)
        ends = view.targets.opaque_ends()
        ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
        self._opaque.draw_depth(view, opaque, ends)

    def _sort(self, view: LightView, features: FrameFeatures, offset: int) -> None:
        """Sort the lists of one view, and add up the optical depth along them."""
        view.uniforms.bind()
        if view.scene.opaque:
            self._draw_opaque(view)
            view.targets.opaque_ends().color_attachments[0].use(0)
        view.targets.nothing().use()
        self._gl.enable_only(moderngl.NOTHING)
        switches = {
            **walk_switches(features),
            "EMISSION": False,
            "SCATTER": False,
            "MARCH": False,
            "OPAQUE": bool(view.scene.opaque),
            "GRADIENT": 1,
        }
        program = self._sorting.program(**switches)
        set_uniform(program, "cell_offset", offset)
        self._sorting.draw_fullscreen(program)
        self._gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)


def _views_key(job: FrameJob) -> object:
    """Key of the views, equal for frames in which lights see the same; keeps nothing alive."""
    scene = job.scene
    media = tuple(item.medium for item in scene.objects)
    # What lists hold depends on whether media vary.
    return objects_key(scene), media, tuple(light_key(light) for light in scene.lights), job.features.varies
