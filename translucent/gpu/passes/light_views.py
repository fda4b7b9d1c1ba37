"""Views from the lights: how deep in the media each point is, seen from each light."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.errors import RenderError
from translucent.gpu.job import FrameJob
from translucent.gpu.light_cameras import light_cameras, media_sphere
from translucent.gpu.passes.opaque import OpaquePass
from translucent.gpu.passes.variants import Variants, walk_switches
from translucent.gpu.shaders import set_uniform
from translucent.gpu.targets import Targets
from translucent.gpu.uniforms import LightViews
from translucent.planning.passes import PassName
from translucent.planning.render_plan import PassSpec
from translucent.scene.lights import PointLight
from translucent.scene.scene import Light

#: Bytes of a node, and of what is recorded at each.
_NODE, _MEDIUM = 16, 16

Array = npt.NDArray[np.float64]

#: Texels along a side of a light's view, and twice those of each of the six of a cube: the first that fit are taken.
_SIDES = (1024, 512, 256, 128)

#: Binding points of the buffers while they are made, and while they are read.
_COUNT, _HEADS, _NODES, _MEDIA, _ENDS = 0, 1, 2, 5, 6
_READ = {"light_heads": 3, "light_nodes": 4, "light_media": _MEDIA, "light_ends": _ENDS}

#: Nodes in the first buffers, for each texel: enough for most bodies. Frames that need more get larger ones, and keep
#: them.
_FIRST_SHARE = 1.25

#: Room beyond what a frame needed, so that the next one does not have to grow again.
_SLACK = 1.25


class LightViewsPass:
    """Lists of crossings from each light, with optical depths; see ``shaders/volume/light_views.glsl``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._lists = Variants(gl, "geometry/body.vert", "intervals/fragment_lists.frag", 430, opaque_place=0)
        self._sorting = Variants(gl, "geometry/fullscreen.vert", "volume/light_lists.frag", 430, opaque_place=0)
        self._opaque = OpaquePass(gl)
        self._targets: dict[int, Targets] = {}
        self._held: tuple[object, LightViews] | None = None

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Make the lists of all views, and tell the shaders where the lights are."""
        # Lights see the same from frame to frame, wherever the camera is.
        seen = _seen(job)
        if self._held is None or self._held[0] != seen:
            self._held = None
            self._held = seen, self._look(job, spec)
        job.light_views = self._held[1]
        job.bind()
        for name, binding in _READ.items():
            if name != "light_ends" or job.scene.opaque:
                job.resources.light_lists.get(name, 1).bind_to_storage_buffer(binding)

    def _look(self, job: FrameJob, spec: PassSpec) -> LightViews:
        """What all lights see, in the largest views that fit."""
        for side in _SIDES:
            if (found := self._look_closely(job, spec, side)) is not None:
                return found
        megabytes = job.resources.light_lists.largest / 1e6
        raise RenderError(
            f"{len(job.scene.lights)} lights on media that scatter",
            f"what they see does not fit into the {megabytes:.0f} MB that a shader of this OpenGL reaches",
            "use fewer lights, or simpler bodies",
        )

    def _look_closely(self, job: FrameJob, spec: PassSpec, side: int) -> LightViews | None:
        """What all lights see, in views of some size; None if no buffer holds it."""
        groups = [self._light_jobs(job, light, side) for light in job.scene.lights]
        jobs = [light_job for group in groups for light_job in group]
        try:
            return light_views(groups) if self._fill(job, spec, jobs) else None
        finally:
            for light_job in jobs:
                light_job.release()

    def _light_jobs(self, job: FrameJob, light: Light, side: int) -> list[FrameJob]:
        cameras = light_cameras(light, job.scene)
        side = side if len(cameras) == 1 else side // 2
        if side not in self._targets:
            self._targets[side] = Targets(self._gl, (side, side))
        scenes = [replace(job.scene, camera=camera) for camera in cameras]
        return [FrameJob(job.gl, scene, job.plan, self._targets[side], job.resources) for scene in scenes]

    def _fill(self, job: FrameJob, spec: PassSpec, jobs: list[FrameJob]) -> bool:
        """Make all lists; once more, with larger buffers, if they did not fit. False if none are large enough."""
        lists = job.resources.light_lists
        cells = sum(_cells(light_job) for light_job in jobs)
        # Where a light is inside, each of its lists begins with a crossing of its own.
        spare = sum(_cells(light_job) for light_job in jobs if light_job.starts_inside)
        most = lists.largest // max(_NODE, _MEDIUM)
        if 4 * cells > lists.largest or spare > most:
            return False
        heads, count = lists.get("light_heads", 4 * cells), lists.get("light_count", 4)
        if job.scene.opaque:
            lists.get("light_ends", 4 * cells).bind_to_storage_buffer(_ENDS)
        needed = min(int(_FIRST_SHARE * cells) + 1, most)
        while True:
            nodes, media = lists.get("light_nodes", _NODE * needed), lists.get("light_media", _MEDIUM * needed)
            count.write(np.zeros(1, np.uint32))
            heads.clear()
            for binding, buffer in ((_COUNT, count), (_HEADS, heads), (_NODES, nodes), (_MEDIA, media)):
                buffer.bind_to_storage_buffer(binding)
            for light_job, offset in zip(jobs, _offsets(jobs), strict=True):
                self._draw(light_job, spec, offset)
            found = int(np.frombuffer(count.read(), np.uint32)[0]) + spare
            if found <= min(nodes.size // _NODE, media.size // _MEDIUM):
                break
            if found > most:
                return False
            needed = min(int(found * _SLACK), most)
        for light_job, offset in zip(jobs, _offsets(jobs), strict=True):
            self._sort(light_job, spec, offset)
        return True

    def _draw(self, job: FrameJob, spec: PassSpec, offset: int) -> None:
        """Put the crossings of one view into its lists."""
        gl = self._gl
        job.bind()
        if job.scene.opaque:
            self._draw_opaque(job)
        job.targets.nothing().use()
        gl.enable_only(moderngl.NOTHING)
        if job.scene.opaque:
            job.targets.opaque().color_attachments[0].use(0)
        program = self._lists.program(WITH_NORMAL=0, WITH_POSITION=0, OPAQUE=bool(job.scene.opaque), GRADIENT=1)
        set_uniform(program, "cell_offset", offset)
        job.draw(program, spec.objects)
        gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)

    def _draw_opaque(self, job: FrameJob) -> None:
        opaque = tuple(i for i, item in enumerate(job.scene.objects) if item.medium is None)
        self._opaque.run(job, PassSpec(PassName.OPAQUE, "shadows", opaque))

    def _sort(self, job: FrameJob, spec: PassSpec, offset: int) -> None:
        """Sort the lists of one view, and add up the optical depth along them."""
        job.bind()
        if job.scene.opaque:
            self._draw_opaque(job)
            job.targets.opaque().color_attachments[0].use(0)
        job.targets.nothing().use()
        self._gl.enable_only(moderngl.NOTHING)
        switches = {
            **walk_switches(job),
            "EMISSION": False,
            "SCATTER": False,
            "MARCH": False,
            "OPAQUE": bool(job.scene.opaque),
            "GRADIENT": 1,
        }
        program = self._sorting.program(**switches)
        set_uniform(program, "cell_offset", offset)
        self._sorting.draw_fullscreen(program)
        self._gl.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT | moderngl.BUFFER_UPDATE_BARRIER_BIT)


def _seen(job: FrameJob) -> object:
    """Equal for frames in which lights see the same; keeps nothing alive."""
    scene = job.scene
    objects = tuple(
        (
            weakref.ref(body.mesh),
            body.matrix.tobytes(),
            body.medium,
            body.priority,
            body.sheet_thickness,
            None if body.density is None else weakref.ref(body.density),
        )
        for body in scene.objects
    )
    return objects, tuple(_light_key(light) for light in scene.lights), scene.overlap


def _light_key(light: Light) -> tuple[object, ...]:
    where = light.position if isinstance(light, PointLight) else light.direction
    return type(light), np.asarray(where).tobytes()


def _cells(job: FrameJob) -> int:
    return job.targets.size[0] * job.targets.size[1]


def _offsets(jobs: Sequence[FrameJob]) -> list[int]:
    """Number of the first texel of each view."""
    return [sum(_cells(light_job) for light_job in jobs[:i]) for i in range(len(jobs))]


def light_views(groups: Sequence[Sequence[FrameJob]]) -> LightViews:
    """Where each light's views are, and how points get into them; a group holds the views of one light."""
    jobs = [light_job for group in groups for light_job in group]
    offsets = _offsets(jobs)
    spans, first = [], 0
    for group in groups:
        spans.append((first, len(group), group[0].targets.size[0], offsets[first]))
        first += len(group)
    center, _ = media_sphere(jobs[0].scene)
    rows = np.concatenate([_rows(light_job, center) for light_job in jobs])
    inside = tuple(group[0].starts_inside for group in groups)
    return LightViews(center, inside, np.array(spans, dtype=np.float64), rows)


def _rows(job: FrameJob, center: Array) -> Array:
    """(4, 4): x, y and w of the picture, and place, of a point given from the center of the media."""
    camera = job.scene.camera
    axes = np.stack([camera.right, camera.up, camera.forward])
    seen = np.column_stack([axes, axes @ (center - camera.eye)])
    half_width, half_height = camera.half_extent(job.targets.size)
    one = np.array([0.0, 0.0, 0.0, 1.0])
    media = job.media_range
    place = (seen[2] - media.near * one) / media.length
    return np.stack([seen[0] / half_width, seen[1] / half_height, one if camera.fov_y is None else seen[2], place])
