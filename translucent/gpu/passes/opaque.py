"""Opaque objects, drawn or the picture of another renderer: the ends of rays through media, and radiance there.

Partly transparent layers, and the emission of interfaces, are drawn with the same surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary

import moderngl
import numpy as np

from translucent.gpu.constants import CONSTANTS
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import CameraView, FrameJob, TextureBackdrop
from translucent.gpu.passes.variants import Variants, coat_switches, look_switches
from translucent.gpu.resources import Resources
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.textures import AnyTexture
from translucent.gpu.uniforms import media_center, surface_fields
from translucent.media.colors import ColorLike
from translucent.planning.passes import PassSpec
from translucent.planning.shadow_maps import UNITS_WITH_SHADOWS
from translucent.scene.backdrop import Backdrop
from translucent.scene.grounds import ground_from_above, ground_of
from translucent.scene.scene import Object
from translucent.scene.surface import LEAST_COVER, TEXTURE_FIELDS, Surface
from translucent.scene.texture import Falloff

_MAPS = (
    "light_irradiance",
    "light_map",
    "light_levels",
    "reflectance_table",
    "shadow_sums",
    "shadow_ends",
    "ground_shadows",
)
#: Samplers of ``shaders/shade/opaque_surface.glsl``.
SURFACE_SAMPLERS = *_MAPS, *TEXTURE_FIELDS

#: Further samplers of layers, and of the pass that puts them over the picture.
_OF_LAYERS = ("opaque_axial_depth", "entered", "fronts")
_PUT_OVER = ("layers_in_front", "layers_behind", "straight_transmittance", "shaded_radiance", "shaded_transmittance")

#: Values of the uniforms of ``shaders/shade/opaque_surface.glsl``, of each surface that has been drawn.
_UNIFORMS: WeakKeyDictionary[Surface, dict[str, Any]] = WeakKeyDictionary()

#: Depth of infinitely far pixels: behind everything, and yet visible.
_BEHIND_ALL = 0.1 * float(CONSTANTS["NOTHING"])

#: Samplers of ``shaders/shade/backdrop_shadows.frag``.
_SHADOW_SAMPLERS = ("opaque_axial_depth", "light_irradiance", "shadow_sums", "shadow_ends")


class OpaquePass:
    """Nearest opaque surface of each pixel; see ``shaders/shade/opaque.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        samplers = *SURFACE_SAMPLERS, "diffused_light"
        self._plain = Variants(gl, "geometry/body.vert", "shade/opaque.frag", *samplers)
        self._surfaced = Variants(gl, "geometry/interface.vert", "shade/opaque.frag", *samplers)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the opaque objects with the depth test on."""
        if job.bending or job.averaged or job.holds_opaque:  # their picture is not read, or is there
            ends = job.targets.opaque_ends()
            ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
            self.draw_depth(job, spec.objects, ends)
            return
        framebuffer = job.targets["opaque"]
        if job.uneven is not None:
            ends = job.targets.opaque_ends()
            ends.clear(float(CONSTANTS["NOTHING"]), depth=1.0)
            self.draw_depth(job, spec.objects, ends)
            if not job.uneven:
                return
            framebuffer.scissor = job.uneven.scissor
        framebuffer.use()
        _clear(framebuffer)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        # Surfaces at the very end of the range count, too; and of surfaces at one depth, those of the first object.
        job.gl.depth_func = "<="
        environment = job.scene.environment
        light_map = environment.kind == "image"
        if job.features.has_shadow_maps:
            job.resources.shadows.use(self._plain.units)
        common = {"LIGHT_MAP": light_map, "DEPTH_ONLY": False, "PROJECTED_DEPTH": False}
        common |= shadow_switches(job.features.has_shadow_maps, job.resources)
        if (light := job.diffused_light) is not None:
            light.texture.use(self._plain.units["diffused_light"])
        common["DIFFUSED"] = light is not None
        if light_map:
            job.resources.environments.light(environment).irradiance.use(self._plain.units["light_irradiance"])
        ground = job.resources.shadows.ground if job.features.has_shadow_maps else None
        for i in spec.objects[::-1]:
            mapped = ground is not None and ground.number == i
            switches = {**common, "GROUND_SHADOWS": (2 if job.any_eye else 1) if mapped else 0}  # 1: from above alone
            if (surface := job.scene.objects[i].surface) is None:
                program = self._plain.program(
                    WITH_NORMAL=1,
                    WITH_POSITION=1,
                    SURFACE=0,
                    VERTEX_COLORS=0,
                    SURFACE_TEXTURES=0,
                    OCCLUSION=0,
                    **switches,
                    **coat_switches(()),
                )
            else:
                if job.features.has_shadow_maps:
                    require_interfaces(job.gl.info)
                looks = look_switches(job.scene.objects[i]) | coat_switches([job.scene.objects[i]])
                program = self._surfaced.program(SURFACE=1, **switches, **looks)
                self._surfaced.bind(**job.resources.light_textures(environment))
                set_surface(job, program, surface, surface.alpha_cutoff)
                samples = job.opaque_samples
                set_used(program, {"texture_bias": -0.5 * math.log2(samples), "sample_area": 1.0 / samples})
            if ground is not None and mapped:
                ground.texture.use(self._plain.units["ground_shadows"])
                set_used(program, {"ground_rows": ground.rows, "mapped_ground": ground.plane})
            if light is not None:
                set_used(program, {"opaque_map": light.map_uniform(i, media_center(job.scene))})
            job.draw(program, (i,))
        job.gl.depth_func = "<"
        framebuffer.scissor = None

    def draw_depth(
        self, view: CameraView, objects: tuple[int, ...], framebuffer: moderngl.Framebuffer, *, projected: bool = False
    ) -> None:
        """Draw the depth of opaque objects into a cleared framebuffer (R32F) with a depth buffer.

        That is linear, or, where passes that follow test against it, has the depth of the projection.
        """
        framebuffer.use()
        view.gl.enable_only(moderngl.DEPTH_TEST)
        common = {"LIGHT_MAP": False, "DEPTH_ONLY": True, "PROJECTED_DEPTH": projected}
        common |= shadow_switches(False, view.resources) | coat_switches(()) | {"DIFFUSED": False}
        for i in objects:
            surface = view.scene.objects[i].surface
            if surface is None or not surface.alpha_cutoff:
                bare = dict.fromkeys(("SURFACE", "VERTEX_COLORS", "SURFACE_TEXTURES", "OCCLUSION"), 0)
                switches = {"WITH_NORMAL": 1, "WITH_POSITION": 1, **bare}
                program = self._plain.program(**switches, **common)
            else:
                program = self._surfaced.program(SURFACE=1, **common, **look_switches(view.scene.objects[i]))
                set_surface(view, program, surface, surface.alpha_cutoff)
            view.draw(program, (i,))


def is_smooth(job: FrameJob) -> bool:
    """True if all that is opaque is a ground whose color varies by light alone: few samples show it as well as many."""
    ground, scene = ground_of(job.scene), job.scene
    if ground is None or len(scene.opaque) > 1 or job.backdrop is not None:
        return False
    surface = ground.ground.surface
    textures = () if surface is None else surface.textures
    plain = surface is None or (not surface.alpha_cutoff and all(isinstance(one, Falloff | None) for one in textures))
    # Without a map of them, each sample has shadows of other directions of the environment.
    mapped = not scene.environment_shadows or ground_from_above(scene) is not None
    return plain and mapped and ground.ground.mesh.colors is None


def shadow_switches(used: bool, resources: Resources) -> dict[str, bool]:
    """Switches of ``shaders/shade/shadows.glsl``."""
    spectral = used and resources.shadows.spectral
    return {"SHADOW_MAPS": used, "SHADOW_SPECTRAL": spectral, "GROUND_SHADOWS": False}


def interface_shadow_switches(job: FrameJob) -> dict[str, bool]:
    """Shadow switches for shaders of interfaces and random paths, which read many other textures."""
    enough = job.resources.texture_units >= UNITS_WITH_SHADOWS
    return shadow_switches(job.features.has_shadow_maps and enough, job.resources)


def set_surface(view: CameraView, program: moderngl.Program, surface: Surface, hole_below: float) -> None:
    """Set the surface of an object for ``shaders/shade/opaque_surface.glsl``, with holes where alpha is below that."""
    view.resources.textures.bind(surface, program, len(_MAPS))
    set_uniform(program, "opaque_hole_below", hole_below)
    # Programs of objects that only emit light, and of depth alone, lack some of these.
    if (values := _UNIFORMS.get(surface)) is None:
        fields = {name: np.asarray(value, np.float64) for name, value in surface_fields(surface).items()}
        values = {f"opaque_{name}": one.item() if one.ndim == 0 else tuple(one) for name, one in fields.items()}
        _UNIFORMS[surface] = values
    set_used(program, values)


def _blurred_opaque(job: FrameJob) -> tuple[moderngl.Texture, moderngl.Texture]:
    """Axial depth and radiance of the opaque objects; the latter with its blurs, if a rough body may show them."""
    axial_depth, radiance = job.targets["opaque"].color_attachments
    if job.bending:
        (radiance,) = job.targets["opaque_mean"].color_attachments
    if any(body.surface is not None and body.surface.roughness > 0 for body in job.scene.bodies):
        if not job.has_blurs:
            radiance.build_mipmaps()
        job.has_blurs = job.bending  # the mean stays as it is
        radiance.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        radiance.repeat_x = radiance.repeat_y = False
    return axial_depth, radiance


def bind_light(job: FrameJob, variants: Variants, textures: Mapping[str, AnyTexture]) -> None:
    """Bind textures, and the light that interfaces show: of lights, the environment, opaque objects and diffusion."""
    environment, resources = job.scene.environment, job.resources
    found = {
        **textures,
        **resources.light_textures(environment),
        **resources.background_textures(environment),
    }
    if job.features.has_opaque:
        found["opaque_axial_depth"], found["opaque_radiance"] = _blurred_opaque(job)
    if job.diffused_light is not None:
        found["diffused_light"] = job.diffused_light.texture
    variants.bind(**found)
    resources.shadows.use(variants.units)


def _clear(framebuffer: moderngl.Framebuffer) -> None:
    """Clear the attachments to no surface and no radiance."""
    on, off = (True,) * 4, (False,) * 4
    framebuffer.color_mask = on, off
    framebuffer.clear(float(CONSTANTS["NOTHING"]), 0.0, 0.0, 0.0, depth=1.0)
    framebuffer.color_mask = off, on
    framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
    framebuffer.color_mask = on, on


class BackdropPass:
    """Copy of the job's backdrop into the target of opaque objects, with the shadows of bodies on it; see
    ``shaders/shade/backdrop.frag`` and ``shaders/shade/backdrop_shadows.frag``.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        samplers = "backdrop_color", "backdrop_depth"
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/backdrop.frag", *samplers)
        self._shadows = Variants(gl, "geometry/fullscreen.vert", "shade/backdrop_shadows.frag", *_SHADOW_SAMPLERS)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Fill the target; but for shadows of the environment, it is the same for all samples of a pixel."""
        if isinstance(job.backdrop, Backdrop):
            _upload(job, job.backdrop)
        elif job.backdrop is not None:
            self._draw(job, job.backdrop)
        if job.backdrop is not None and job.features.shadows_backdrop:
            self._shadow(job, job.backdrop.ambient)

    def _draw(self, job: FrameJob, backdrop: TextureBackdrop) -> None:
        job.targets["opaque"].use()
        job.gl.enable_only(moderngl.NOTHING)
        self._variants.bind(backdrop_color=backdrop.color, backdrop_depth=backdrop.depth)
        program = self._variants.program(ORTHOGRAPHIC=backdrop.orthographic, INFINITE=math.isinf(backdrop.far))
        media = job.placed.media
        set_uniform(program, "near", backdrop.near)
        if not math.isinf(backdrop.far):
            set_uniform(program, "far", backdrop.far)
        set_uniform(program, "media_near", media.near)
        set_uniform(program, "media_length", media.length)
        set_uniform(program, "gamma", backdrop.gamma)
        set_uniform(program, "behind_all", _BEHIND_ALL)
        self._variants.draw_fullscreen(program)

    def _shadow(self, job: FrameJob, ambient: ColorLike | None) -> None:
        """Multiply the radiance by the fraction of its light that reaches it."""
        axial_depth = job.targets["opaque"].color_attachments[0]
        job.targets.view("opaque", 1).use()  # what is read may not be attached
        job.gl.enable_only(moderngl.BLEND)
        job.gl.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
        environment = job.scene.environment
        light_map = ambient is None and environment.kind == "image"
        program = self._shadows.program(
            LIGHT_MAP=light_map, EVEN_LIGHT=ambient is not None, **shadow_switches(True, job.resources)
        )
        self._shadows.bind(opaque_axial_depth=axial_depth)
        job.resources.shadows.use(self._shadows.units)
        if light_map:
            self._shadows.bind(light_irradiance=job.resources.environments.light(environment).irradiance)
        set_uniform(program, "behind_all", _BEHIND_ALL)
        if ambient is not None:
            set_uniform(program, "even_light", ambient)
        self._shadows.draw_fullscreen(program)


def _upload(job: FrameJob, backdrop: Backdrop) -> None:
    """Upload the arrays; distances are converted to depths in float64, so that far scenes lose no digits."""
    with np.errstate(under="ignore"):
        axial_depth = np.minimum((backdrop.depth - job.placed.media.near) / job.placed.media.length, _BEHIND_ALL)
        axial_depth = axial_depth.astype(np.float32)
    if backdrop.coverage is not None:
        axial_depth = np.where(backdrop.coverage, axial_depth, np.float32(CONSTANTS["NOTHING"]))
    radiance = np.ones((*axial_depth.shape, 4), dtype=np.float32)
    radiance[..., :3] = backdrop.radiance
    for texture, rows in zip(job.targets["opaque"].color_attachments, (axial_depth, radiance), strict=True):
        texture.write(np.ascontiguousarray(rows[::-1]))


class LayersPass:
    """Layers, drawn far objects first and composited over the picture; see ``shaders/shade/layer.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._layers = Variants(gl, "geometry/interface.vert", "shade/layer.frag", *SURFACE_SAMPLERS, *_OF_LAYERS)
        self._fronts = Variants(gl, "geometry/body.vert", "shade/fronts.frag")
        self._over = Variants(gl, "geometry/fullscreen.vert", "shade/layers_over.frag", *_PUT_OVER)

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Draw the layers over the picture; for a job of several samples, add the sample's radiance
        and transmittance.
        """
        bodies = tuple(i for i, item in enumerate(job.scene.objects) if item.medium is not None and not item.covers)
        if bodies:
            self._find_fronts(job, bodies)
        self._draw(job, spec, bool(bodies))
        self._put_over(job, job.sums_after(spec.name))

    def _find_fronts(self, job: FrameJob, bodies: tuple[int, ...]) -> None:
        """Draw the depth at which each ray first hits a body: at once, if it starts inside one."""
        framebuffer = job.targets["fronts"]
        framebuffer.use()
        nothing = float(CONSTANTS["NOTHING"])
        framebuffer.clear(-nothing if job.placed.starts_inside else nothing, depth=1.0)
        job.gl.enable_only(moderngl.DEPTH_TEST)
        if not job.placed.starts_inside:
            job.draw(self._fronts.program(WITH_NORMAL=0, WITH_POSITION=0), bodies)

    def _draw(self, job: FrameJob, spec: PassSpec, bodies: bool) -> None:
        gl, framebuffer = job.gl, job.targets["layers"]
        framebuffer.use()
        framebuffer.clear()
        gl.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._layers.bind(**job.resources.light_textures(job.scene.environment))
        job.bind_opaque(self._layers.units["opaque_axial_depth"])
        if job.features.has_surfaces:
            job.targets["entered"].color_attachments[0].use(self._layers.units["entered"])
        if bodies:
            job.targets["fronts"].color_attachments[0].use(self._layers.units["fronts"])
        for i in sorted(spec.objects, key=lambda i: _distance(job, i), reverse=True):
            self._draw_layer(job, i, bodies)
        gl.cull_face = "back"

    def _draw_layer(self, job: FrameJob, number: int, bodies: bool) -> None:
        body = job.scene.objects[number]
        surface = body.surface
        assert surface is not None
        program = self._layers.program(
            EMITS=not body.covers,
            OPAQUE=job.features.has_opaque,
            BODIES=bodies,
            SHADOW_MAPS=0,
            SHADOW_SPECTRAL=0,
            GROUND_SHADOWS=0,
            DIFFUSED=0,
            **look_switches(body),
            **coat_switches([body]),
        )
        set_surface(job, program, surface, surface.alpha_cutoff or (LEAST_COVER if body.covers else 0.0))
        set_used(program, {"sample_area": 1.0 / job.samples})
        if body.covers:
            set_uniform(program, "layer_opacity", surface.opacity)
        # The far side first, as in viewers of glTF; a sheet that emits does so on both sides.
        back = surface.double_sided if body.covers else number in job.features.sheets
        for culled in ("front", "back") if back else ("back",):
            job.gl.cull_face = culled
            job.draw(program, (number,))

    def _put_over(self, job: FrameJob, sums: bool) -> None:
        gl, targets = job.gl, job.targets
        gl.enable_only(moderngl.BLEND)
        in_front, behind = targets["layers"].color_attachments
        transmittance = targets["result"].color_attachments[1]
        read = in_front, behind, transmittance, *job.picture.color_attachments[:2]
        self._over.bind(**dict(zip(_PUT_OVER, read, strict=True)))
        radiance = "surfaced" if job.features.has_surfaces else "result"
        steps = (
            ("RADIANCE", targets.view(radiance, 0), (moderngl.ONE, moderngl.SRC_ALPHA, moderngl.ZERO, moderngl.ONE)),
            ("SHARE", targets.view("result", 1), (moderngl.ZERO, moderngl.SRC_ALPHA, moderngl.ZERO, moderngl.ONE)),
            ("DEPTH", targets.view("result", 2), (moderngl.ONE, moderngl.ONE)),
            ("SUM", targets["average"] if sums else None, (moderngl.ONE, moderngl.ONE)),
        )
        for step, framebuffer, blending in steps:
            if framebuffer is not None:
                framebuffer.use()
                gl.blend_func = blending
                switches = {name: name == step for name, _, _ in steps}
                self._over.draw_fullscreen(self._over.program(**switches))


def _distance(job: FrameJob, number: int) -> float:
    body: Object = job.scene.objects[number]
    camera = job.scene.camera
    center = body.bounds.mean(axis=0) - camera.eye
    return float(center @ camera.forward if camera.fov_y is None else np.linalg.norm(center))
