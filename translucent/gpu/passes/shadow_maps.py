"""Maps of shadows: signed depth from each light, and from directions of the environment, down to what is opaque."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.gpu.job import FrameJob
from translucent.gpu.layout import SHADOWS, SKY_SHADOWS
from translucent.gpu.passes.depth_peeling import DepthPeelingPass
from translucent.gpu.passes.fragment_lists import FragmentListsPass
from translucent.gpu.passes.opaque import OpaquePass
from translucent.gpu.passes.signed_depth import SignedDepthPass
from translucent.gpu.passes.thin_layer import ThinLayerPass
from translucent.gpu.passes.transmittance import TransmittancePass
from translucent.gpu.shadow_atlas import ShadowView, ShadowViews
from translucent.gpu.shadow_cameras import shadow_cameras
from translucent.gpu.targets import Targets
from translucent.gpu.uniforms import media_center
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.paths import straight_scene
from translucent.planning.plan import plan
from translucent.planning.render_plan import Capabilities, RenderPlan
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Scene
from translucent.scene.shadow_directions import shadow_directions

#: First OpenGL version in which shaders write to buffers.
_SHADER_STORAGE = 430

_BLACK = Environment.constant((0.0, 0.0, 0.0))


class ShadowMapsPass:
    """Transmittance to the first opaque surface on each ray of each light; see ``shaders/shade/shadows.glsl``.

    Each map is a frame of its own, which the light sees: its scene has no interfaces and only absorbs, and the passes of
    the plan for that scene find the paths through its media.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        self._opaque = OpaquePass(gl)
        self._resolve = TransmittancePass(gl)
        self._made: dict[PassName, Callable[[FrameJob, PassSpec], None]] = {}
        self._targets: dict[int, Targets] = {}
        self._bound: tuple[object, int, int] | None = None

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Render the maps, if objects or lights have changed, and write the uniforms."""
        atlas = job.resources.shadows
        if atlas.held != (seen := _seen(job)):
            atlas.views = self._render(job)
            atlas.held = seen
        assert atlas.views is not None
        center = media_center(job.scene)
        # Of several samples of a pixel, each looks into its share of the directions.
        turns = (job.sample % job.samples, job.samples)
        job.uniforms.add(SHADOWS, atlas.views.light_uniforms(center, turns))
        irradiance = shadow_directions(job.scene.environment, max(job.scene.environment_shadows, 1))[1]
        job.uniforms.add(SKY_SHADOWS, atlas.views.sky_uniforms(center, irradiance))
        job.uniforms.bind()

    def _render(self, job: FrameJob) -> ShadowViews:
        """Render all maps."""
        scene, size = job.scene, job.plan.shadows.size
        lights = [shadow_cameras(light, scene) for light in scene.lights]
        sky = [camera for light in _sky_lights(scene) for camera in shadow_cameras(light, scene)]
        limit = int(self._gl.info["GL_MAX_TEXTURE_SIZE"])
        views = ShadowViews.of(lights, sky, size, limit)
        seen = straight_scene(replace(scene, environment=_BLACK, environment_shadows=0))
        chosen = plan(seen, None, Capabilities(shader_storage=self._gl.version_code >= _SHADER_STORAGE))
        target = job.resources.shadows.target(views.extent)
        center = media_center(scene)
        for view in views:
            self._render_view(job, view, replace(seen, camera=view.camera), chosen, target, center)
        for size in self._targets.keys() - {view.size for view in views}:
            self._targets.pop(size).release()
        job.uniforms.bind()
        return views

    def _render_view(
        self,
        job: FrameJob,
        view: ShadowView,
        seen: Scene,
        chosen: RenderPlan,
        target: moderngl.Framebuffer,
        center: Array,
    ) -> None:
        if view.size not in self._targets:
            self._targets[view.size] = Targets(self._gl, (view.size, view.size))
        light = FrameJob(self._gl, seen, chosen, self._targets[view.size], job.resources)
        try:
            for step in chosen.passes:
                if step.name is PassName.OPAQUE:
                    self._opaque.run(light, step, depth_only=True)
                elif step.name is not PassName.TRANSMITTANCE:
                    self._step(step.name)(light, step)
            media = light.placed.media
            ahead = media.near + float(seen.camera.forward @ (seen.camera.eye - center))
            self._resolve.run_map(light, target, view.corner, (ahead, media.length))
        finally:
            light.release()

    def _step(self, name: PassName) -> Callable[[FrameJob, PassSpec], None]:
        if name not in self._made:
            self._made[name] = _STEPS[name](self._gl).run
        return self._made[name]


#: Passes that plans for scenes without interfaces and light have.
_STEPS: dict[PassName, type[SignedDepthPass | ThinLayerPass | FragmentListsPass | DepthPeelingPass]] = {
    PassName.SIGNED_DEPTH: SignedDepthPass,
    PassName.SIGNED_DEPTH_FALLBACK: SignedDepthPass,
    PassName.THIN_LAYER: ThinLayerPass,
    PassName.THIN_LAYER_FALLBACK: ThinLayerPass,
    PassName.FRAGMENT_LISTS: FragmentListsPass,
    PassName.DEPTH_PEELING: DepthPeelingPass,
}


def _sky_lights(scene: Scene) -> list[Light]:
    """Lights from the directions of the environment that throw shadows."""
    if not scene.environment_shadows:
        return []
    towards, _ = shadow_directions(scene.environment, scene.environment_shadows)
    return [DirectionalLight(-direction, 1.0) for direction in towards]


def _seen(job: FrameJob) -> object:
    """Key of the maps, equal for frames in which lights see the same; keeps nothing alive."""
    scene = job.scene
    objects = tuple(
        (
            weakref.ref(item.mesh),
            item.matrix.tobytes(),
            None if item.medium is None else np.asarray(item.medium.extinction).tobytes(),
            item.priority,
            item.sheet_thickness,
            item.medium is None and item.surface,
            None if item.density is None else weakref.ref(item.density),
        )
        for item in scene.objects
    )
    lights = tuple(tuple(c.pose.tobytes() for c in shadow_cameras(light, scene)) for light in scene.lights)
    sky = scene.environment_shadows and shadow_directions(scene.environment, scene.environment_shadows)[0].tobytes()
    return objects, lights, sky, scene.overlap, job.plan.shadows.size
