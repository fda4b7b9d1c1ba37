"""Maps of shadows by themselves: what their texels hold, in float32 and in float16, and what they cost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from translucent import reference
from translucent.arrays import Array
from translucent.bench.drawing import Short, Studio
from translucent.bench.timing import Sample, Samples, interleaved
from translucent.errors import RenderError
from translucent.frames.metrics import interior
from translucent.gpu.job import FrameJob
from translucent.gpu.light_cameras import support_of
from translucent.gpu.passes.depth_only import DepthOnlyPass
from translucent.gpu.passes.shortcuts import HalfFloatPass
from translucent.gpu.shadow_cameras import ShadowThrowers
from translucent.gpu.targets import Targets
from translucent.planning.passes import PassName
from translucent.planning.shadow_maps import ShadowMaps
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.scene import Scene


def map_camera(scene: Scene) -> Camera:
    """Camera of the one map of a scene with one light; raises `RenderError` if there are more."""
    cameras = ShadowThrowers(scene.lights[0], scene, [support_of(item) for item in scene.objects]).cameras()
    if len(cameras) != 1:
        raise RenderError("a map of shadows", f"its light has {len(cameras)}", "move it away from what it lights")
    return cameras[0]


def texel_errors(renderer: Renderer, scene: Scene, size: int) -> Array:
    """Errors (n, 3) of transmittance in the rays of a map's texels that end on the ground, away from outlines."""
    renderer.render(scene, (8, 8), shadows=ShadowMaps(size))
    sums = np.flipud(_sums(renderer, size))
    camera, ground = map_camera(scene), scene.objects[-1]
    origins, ways = (np.broadcast_to(rays, (size, size, 3)) for rays in camera.rays((size, size)))
    advance = 1.0 / (ways @ camera.forward)
    depth = sums[..., :3] if sums.shape[-1] > 2 else sums @ _extinctions(scene)[: sums.shape[-1]]
    found = np.exp(-depth * advance[..., None])
    seen = replace(scene, objects=list(scene.bodies), camera=camera)
    counts = reference.hit_counts(seen, (size, size))
    inside = interior(counts) & (counts > 0)
    height = float(ground.bounds[0, 1])
    points = (origins + ((height - origins[..., 1]) / ways[..., 1])[..., None] * ways)[inside]
    return np.asarray(found[inside] - reference.light_transmittance(scene, 0, points))


def _extinctions(scene: Scene) -> Array:
    """(k, 3): those of the bodies that differ, in order."""
    found = {item.medium.extinction.tobytes(): item.medium.extinction for item in scene.bodies if item.medium}
    return np.array(list(found.values()))


def _sums(renderer: Renderer, size: int) -> Array:
    """(size, size, 1, 2 or 4): the one map that the renderer holds, the bottom row first."""
    with renderer.gpu.context.current():
        texture = renderer.gpu.shadows.sums.color_attachments[0]
        return np.frombuffer(texture.read(), np.float32).reshape(size, size, -1).astype(np.float64)


def halve(studio: Studio, scene: Scene, size: int) -> None:
    """Put into the map that the renderer holds of a scene what a target of float16 makes of it.

    Signed distances are those that we add up, from the center of the media; only their sums have 11 bits.
    """
    renderer, camera = studio.renderer, map_camera(scene)
    seen = replace(scene, objects=list(scene.bodies), camera=camera, lights=[])
    targets = Targets(studio.gl, (size, size))
    drawn = Short(studio, seen, targets, renderer.plan(seen), studio.own(HalfFloatPass))
    try:
        drawn.draw()
        frame = drawn.read()
    finally:
        drawn.release()
        targets.release()
    texture = renderer.gpu.shadows.sums.color_attachments[0]
    _, ways = camera.rays((size, size))
    forward = np.broadcast_to(ways @ camera.forward, (size, size))[..., None]
    values = np.array(_sums(renderer, size))
    if values.shape[-1] > 1:
        depth = np.flipud(np.asarray(frame.optical_depth, np.float64) * forward)
        if values.shape[-1] == 2:  # the paths in two media that have these optical depths
            values = depth @ np.linalg.pinv(_extinctions(scene))
        else:
            values[..., :3] = depth
    else:
        values[..., :1] = np.flipud(np.asarray(frame.thickness, np.float64)[..., None] * forward)
    texture.write(np.ascontiguousarray(values, dtype=np.float32).tobytes())


def map_times(studio: Studio, scene: Scene, size: int, seconds: float) -> Samples:
    """Times of making one map, with all that this takes, beside those of its depth-only floor."""
    failed: list[Exception] = []
    with _drawings(studio, scene, size) as (draw_map, draw_depth):
        found = interleaved(draw_depth, {"map": draw_map}, seconds, lambda _, error: failed.append(error))
    if failed:
        raise failed[0]
    return found["map"]


@contextmanager
def _drawings(studio: Studio, scene: Scene, size: int) -> Iterator[tuple[Callable[[], Sample], Callable[[], Sample]]]:
    """Making the map of a scene, and drawing what is in it into a depth buffer."""
    gl = studio.gl
    chosen = studio.renderer.plan(scene, shadows=ShadowMaps(size))
    spec = next(step for step in chosen.passes if step.name is PassName.SHADOW_MAPS)
    objects = tuple(range(len(scene.objects)))
    small, large = Targets(gl, (16, 16)), Targets(gl, (size, size))
    job = FrameJob(gl, scene, chosen, small, studio.resources)
    seen = FrameJob(gl, replace(scene, camera=map_camera(scene)), chosen, large, studio.resources)
    maps, floor = studio.step(spec.name), studio.own(DepthOnlyPass)
    job.place((0.0, 0.0))
    seen.place((0.0, 0.0), with_depth=True)

    def make() -> None:
        job.resources.shadows.held = None
        maps.run(job, spec)

    def draw() -> None:
        seen.uniforms.bind()
        floor.run(seen, objects)

    try:
        yield partial(studio.timed, make, _nothing), partial(studio.timed, draw, _nothing)
    finally:
        for one in (job, seen, small, large):
            one.release()
        studio.resources.shadows.release()


def _nothing() -> None:
    pass
