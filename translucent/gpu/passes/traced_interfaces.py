"""Rays traced through the meshes wherever interfaces bend them, over the whole picture."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.formulas.sampling import FOOTPRINT_STEP, MOST_POINTS, sobol_points
from translucent.gpu.constants import ENLARGED_ACROSS
from translucent.gpu.context import require_interfaces
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.interfaces import NoInterface
from translucent.gpu.passes.opaque import bind_light, interface_shadow_switches
from translucent.gpu.passes.ray_generations import Pixels, RayGenerations, all_words
from translucent.gpu.passes.variants import Variants, background_switches, coat_switches, look_switches
from translucent.gpu.placement import Part, extents, part_of
from translucent.gpu.shaders import set_used
from translucent.gpu.targets import SHADER_STORAGE
from translucent.gpu.uniforms import media_center
from translucent.planning.methods.base import SMALL_PICTURE
from translucent.planning.passes import PassSpec
from translucent.planning.rendered import Treatment, treatment_of
from translucent.scene.grounds import Mirror, ground_of
from translucent.scene.scene import Scene

_RAY_SAMPLERS = (
    "entered",
    "surface_parameters",
    "surface_color",
    "opaque_axial_depth",
    "opaque_radiance",
    "object_table",
    "hierarchy_nodes",
    "hierarchy_triangles",
    "reflectance_table",
    "light_map",
    "light_levels",
    "light_irradiance",
    "seen_map",
    "diffused_light",
    "shadow_sums",
    "shadow_ends",
    "ground_shadows",
)
_STRAIGHT = "emitted_radiance_sum", "straight_transmittance"
_SAMPLERS = *_RAY_SAMPLERS, *_STRAIGHT
_ENTERED = ("entered", "surface_parameters", "surface_color")

#: Samplers of ``shaders/transport/hierarchy.glsl``, and of the table of objects.
RAY_SAMPLERS = ("object_table", "hierarchy_nodes", "hierarchy_triangles")

#: Throughput of a ray, its three channels together, below which it is not followed, with two forks or fewer.
FAINTEST_THROUGHPUT = 1.2e-2

#: Room around the mirror images of bodies that rough coats blur, in heights of the picture.
MIRROR_ROOM = 0.06

#: Pixels whose light is summed up before it is drawn: OpenGL need not have larger buffers.
MOST_LIGHT = 1 << 20

#: Samples of a pixel from which on rays are traced where samples differ.
FEW_SAMPLES = 4

#: Standard deviation of one sample of rough interfaces without blur, divided by the error of blur alone: 1.1, 1.7 and
#: 4.7 in three scenes, two balls and a pebble in different light, against path-traced truth. The geometric mean.
NOISE_TO_BLUR = 2.0


class TracedInterfacesPass:
    """Tree of reflected and refracted rays; see ``shaders/transport/traced_interfaces.frag``."""

    def __init__(self, gl: moderngl.Context) -> None:
        files = "geometry/fullscreen.vert", "transport/traced_interfaces.frag"
        self._variants = Variants(gl, *files, *_SAMPLERS)
        self._with_sums = Variants(gl, *files, *_SAMPLERS, version=SHADER_STORAGE)
        self._generations = RayGenerations(gl, _RAY_SAMPLERS, _STRAIGHT)
        self._no_interface = NoInterface(gl)
        self._where_unsettled = Variants(
            gl, "geometry/fullscreen.vert", "transport/where_unsettled.frag", "entered", "unsettled"
        )

    def run(self, job: FrameJob, spec: PassSpec) -> None:
        """Shade the frame; for a job of several samples, add a sample's radiance and transmittance instead."""
        gl = job.gl
        require_interfaces(gl.info)
        sums = job.sums_after(spec.name)
        framebuffer = job.targets["average"] if sums else job.targets["surfaced"]
        if job.bending:
            framebuffer = job.targets["bent"]
        blending = moderngl.BLEND if sums else moderngl.NOTHING
        gl.blend_equation = moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        mirror, by_generations = job.mirror, job.plan.hits == "embree"
        # The program that adds the light of generations of rays shades pixels without an interface, too.
        # So does the one that traces rays, in pictures that take less time than to compile another program.
        shades_all = by_generations or job.targets.size[0] * job.targets.size[1] < SMALL_PICTURE
        shades_all = shades_all and bool(job.covered) and not (job.bending or job.bent_apart)
        by_depth = not (shades_all or any(interior_at_eye(job)))
        gl.enable_only(blending)
        if by_depth:
            if job.bending and not by_generations:
                self._mark_unsettled(job)
            elif not job.bending:
                self._no_interface.draw(job, framebuffer, blending)
            if not job.covered or (job.bent_apart and not job.bending):
                return
        stack = ExitStack()
        textures, scene_values = traced_scene(job, stack)
        self._bind(job, textures)
        switches = _switches(job, mirror=mirror is not None)
        depth, forks = job.plan.interfaces.tree if job.plan.interfaces else (0, 0)
        values = {
            "mirrored": 0,
            "adaptive": int(job.bending),
            "enlarges": int(job.enlarged is not None),
            "faintest_throughput": faintest_throughput(forks),
            "most_interfaces": depth,
            **({"microfacet_points": microfacet_points(job.sample)} if switches["MICROFACETS"] else {}),
            "blurred_fraction": 0.0 if job.plan.request.denoise else blurred_fraction(job.samples),
            "sample_width": job.samples**-0.5,
            "sample_area": 1.0 / job.samples,
            "picture_first": int(_shows_more(job)),
            **scene_values,
            **_ground(job.scene),
            **_ground_shadows(job, switches),
            **_footprint(job),
        }
        if job.enlarged is not None:
            values["enlarged_pixels"] = job.enlarged + [(0, 0)] * (ENLARGED_ACROSS**2 - len(job.enlarged))
        if mirror is not None and (by_depth or shades_all):
            # What is drawn next finds zeros. Software rasterizers compile a program again for every other state.
            if shades_all and not sums:
                framebuffer.clear()
            gl.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if by_depth else moderngl.NOTHING))
        self._draw(job, job.covered.flipped(job.targets.size[1]), framebuffer, "unsettled", switches, values)
        if shades_all:
            variants = self._with_sums if by_generations else self._variants
            program = variants.program(**switches, GENERATIONS=by_generations)
            variants.draw_rest(job, program, framebuffer, top_first=True)
        if mirror is not None and (part := mirrored_part(job, mirror)):
            values |= _mirroring(job.scene, mirror)
            if job.bending:
                framebuffer = job.targets["mirrored"]
            elif not shades_all:
                # The state of the first interfaces, and depths that let all pass.
                gl.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
                framebuffer.color_mask = ((False,) * 4,) * 2
                framebuffer.clear()
                framebuffer.color_mask = ((True,) * 4,) * 2
            self._draw(job, part, framebuffer, "mirror_unsettled", switches, values)
        gl.enable_only(blending)
        stack.close()

    def _draw(
        self,
        job: FrameJob,
        part: Part,
        framebuffer: moderngl.Framebuffer,
        mask: str,
        switches: dict[str, bool | int],
        values: dict[str, Any],
    ) -> None:
        """Draw the pixels of a part, whose row 0 is the top one, with the light of their rays.

        Of a job that is bending, only those in the target of the name `mask`.
        """
        by_generations = job.plan.hits == "embree"
        part = unsettled_part(job, part, mask)
        variants = self._with_sums if by_generations else self._variants
        rows = max(MOST_LIGHT // job.targets.size[0], 1) if by_generations else part.scissor[3]
        for row in range(part.bottom, part.top, max(rows, 1)):
            band, own = part.rows(row, row + rows), {**values, "summed_row": row}
            if by_generations:
                pixels = _pixels(job, band, mask)
                self._generations.trace(job, band, pixels, switches, own)
                if job.bending:
                    self._generations.add(job, framebuffer, pixels, switches, own)
                    continue
            program = variants.program(**switches, GENERATIONS=by_generations)
            set_used(program, own)
            variants.draw_part(band, program, framebuffer)

    def _mark_unsettled(self, job: FrameJob) -> None:
        """Write depths that let only pixels pass which need more samples."""
        marked = [("unsettled", "bent", job.covered.flipped(job.targets.size[1]))]
        if job.mirror is not None:
            marked.insert(0, ("mirror_unsettled", "mirrored", mirrored_part(job, job.mirror)))
        job.gl.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        job.gl.depth_func = "1"
        entered = job.targets["entered"].color_attachments[0]
        for mask, name, whole in marked:
            part = unsettled_part(job, whole, mask)
            self._where_unsettled.bind(entered=entered, unsettled=job.targets[mask].color_attachments[0])
            program = self._where_unsettled.program(MIRROR=name == "mirrored")
            self._where_unsettled.draw_part(part, program, job.targets[name])
        job.gl.depth_func = "<"

    def _bind(self, job: FrameJob, traced: dict[str, moderngl.Texture]) -> None:
        emitted, through, *_ = job.targets["result"].color_attachments
        entered = dict(zip(_ENTERED, job.targets["entered"].color_attachments, strict=True))
        textures = {"emitted_radiance_sum": emitted, "straight_transmittance": through, **entered, **traced}
        bind_light(job, self._variants, textures)
        if (ground := job.resources.shadows.ground) is not None:
            ground.texture.use(self._variants.units["ground_shadows"])


def _pixels(job: FrameJob, part: Part, mask: str) -> Pixels:
    """Pixels of a part whose rays are traced: of a job that is bending, those in the target of the name `mask`."""
    if not job.bending:
        return all_words(part)
    words = job.unsettled[mask]
    columns, rows = words & 0x7FFF, words >> 15
    within = (columns >= part.left) & (columns < part.right) & (rows >= part.bottom) & (rows < part.top)
    return words[within]


def unsettled_part(job: FrameJob, part: Part, mask: str) -> Part:
    """Bounds of the unsettled pixels of a mask within a part; the whole part if these pixels are not listed."""
    if not job.bending or mask not in job.unsettled:
        return part
    if not len(words := job.unsettled[mask]):
        return Part(0, 0, 0, 0)
    columns, rows = words & 0x7FFF, words >> 15
    left, bottom = max(part.left, int(columns.min())), max(part.bottom, int(rows.min()))
    return Part(left, bottom, min(part.right, int(columns.max()) + 1), min(part.top, int(rows.max()) + 1))


def _shows_more(job: FrameJob) -> bool:
    """True if the picture has photons or shadows on opaque objects that rays do not look up."""
    shadows = interface_shadow_switches(job)["SHADOW_MAPS"]
    return job.features.has_caustics or (job.features.has_shadow_maps and not shadows)


def _switches(job: FrameJob, *, mirror: bool) -> dict[str, bool | int]:
    """Switches of the shaders; `mirror`: the ground mirrors bodies."""
    scene, environment = job.scene, job.scene.environment
    surfaces = [body.surface for body in scene.bodies if body.surface is not None]
    rough = any(max(surface.roughness, surface.clearcoat_roughness) > 0 for surface in surfaces)
    shadows = interface_shadow_switches(job)
    light, has_ground = job.diffused_light, job.resources.shadows.ground is not None
    diffused = light is not None
    return {
        "FORKS": job.plan.interfaces.tree[1] if job.plan.interfaces else 0,
        "FROM_EYE": job.placed.starts_inside or any(not (body.has_interface or body.covers) for body in scene.bodies),
        **ray_switches(job),
        "TEXTURED": job.features.textured,
        "PAINTED": any(any(look_switches(body).values()) for body in scene.bodies),
        # 1: traced rays find what media emit; 2: straight rays have found that, and what media scatter.
        "EMISSION": 2 if job.features.straight_light else int(job.features.emits),
        "LAYERED": any(treatment_of(body) is Treatment.LAYER for body in scene.bodies),
        "DIFFUSED": diffused,
        "AHEAD": light is not None and any(own.ahead.any() for own in light.fields.surfaces.values()),
        "MICROFACETS": mirror or rough,
        "ROUGH": rough,
        "LIGHTS": bool(scene.lights),
        "MIRROR": mirror,
        "DISPERSION": any(surface.dispersion > 0 for surface in surfaces),
        "OPAQUE": job.features.has_opaque,
        **shadows,
        # Shadows on the ground that the picture does not show are looked up in the map of it. Browsers promise 16
        # textures, and with light that diffuses it would be the 17th.
        "GROUND_SHADOWS": 2 if shadows["SHADOW_MAPS"] and has_ground and not (job.any_eye and diffused) else 0,
        "DIMMED": job.features.dims_interfaces,
        "DIFFUSE_BASE": any(s.transmission < 1 or s.transmission_texture is not None for s in surfaces),
        **background_switches(environment),
        "SINGLE_SCATTERING": job.features.scatters,
        "FOOTPRINTS": environment.kind == "image",
        **coat_switches(scene.objects),
    }


def _mirroring(scene: Scene, mirror: Mirror) -> dict[str, Any]:
    """Loose uniforms of rays that the ground has mirrored."""
    surface = mirror.ground.surface
    assert surface is not None
    height = mirror.height - float(mirror.normal @ media_center(scene))
    return {
        "mirrored": 1,
        "mirror_plane": (*mirror.normal, height),
        "mirror_surface": (surface.roughness, surface.ior),
        "mirror_metal": (*mirror.ground.base_color, surface.metallic),
    }


def mirrored_part(job: FrameJob, mirror: Mirror) -> Part:
    """Pixels in which the ground may mirror bodies; row 0 is the top one."""
    twins = [
        replace(item, transform=mirror.matrix @ item.matrix) for item in job.scene.shown if item is not mirror.ground
    ]
    width, rows = job.targets.size
    boxes, radii = np.array([twin.bounds for twin in twins]), np.array([twin.radius for twin in twins])
    edges = extents(boxes, radii, job.scene.camera, (width, rows))
    visible = edges[:, 2] > edges[:, 0]
    edges[visible] += MIRROR_ROOM * rows * np.array([-1.0, -1.0, 1.0, 1.0])
    return part_of(edges, (0.0, 0.0), (width, rows)).flipped(rows)


def _footprint(job: FrameJob) -> dict[str, float]:
    """Width of a sample in pixels, for footprints of rays in a picture of all directions."""
    return {"pixel_step": FOOTPRINT_STEP * job.samples**-0.5} if job.scene.environment.kind == "image" else {}


def _ground(scene: Scene) -> dict[str, Any]:
    """Number and plane of the ground, which rays see that are not followed on; -1 for none."""
    if (ground := ground_of(scene)) is None:
        return {"ground_object": -1}
    height = ground.height - float(ground.normal @ media_center(scene))
    return {"ground_object": scene.objects.index(ground.ground), "ground_plane": (*ground.normal, height)}


def _ground_shadows(job: FrameJob, switches: Mapping[str, bool | int]) -> dict[str, Any]:
    """Uniforms that place the shadow map of the ground."""
    ground = job.resources.shadows.ground
    if not switches["GROUND_SHADOWS"] or ground is None:
        return {}
    return {"ground_rows": ground.rows, "mapped_ground": ground.plane}


def faintest_throughput(forks: int) -> float:
    """Throughput of a ray, its three channels together, below which it is not followed.

    With two forks the rays left out weigh as much as those of a third fork; more forks ask for more.
    """
    return FAINTEST_THROUGHPUT / 4.0 ** max(forks - 2, 0)


def blurred_fraction(samples: int) -> float:
    """Fraction of the microfacet variance that blurs reflections; 1 with few samples.

    The blur is smooth and somewhat wrong, the samples are right and noisy. With n samples and a fraction f, the blur
    has an error f b, and the noise is at most s / sqrt(n), where s is the standard deviation of a sample without blur.
    Both are equal where f is s / (b sqrt(n)), and then converge alike.
    """
    return min(1.0, NOISE_TO_BLUR * float(samples**-0.5))


def microfacet_points(sample: int) -> tuple[int, int, int, int]:
    """Two Sobol points for the microfacets of a sample, each coordinate as 16 binary digits, the first one lowest."""
    points = sobol_points(MOST_POINTS)[_microfacet_orders()[:, sample]]
    digits = np.unpackbits((65536 * points.ravel()).astype(">u2").view(np.uint8).reshape(4, 2), axis=1)
    first, second, third, fourth = (digits @ (1 << np.arange(16))).tolist()
    return first, second, third, fourth


@cache
def _microfacet_orders() -> npt.NDArray[np.int64]:
    """(2, MOST_POINTS): numbers of Sobol points in two random orders, in which 2^k points in a row stay well spread.

    Without them the points of two interfaces would depend on each other. Each binary digit of a number is flipped or
    not by chance, once for all numbers with the same higher digits (Burley 2020, "Practical hash-based Owen
    scrambling").
    """
    random = np.random.default_rng(0)
    numbers = np.arange(MOST_POINTS)
    orders = np.zeros((2, MOST_POINTS), np.int64)
    for digit in range(MOST_POINTS.bit_length() - 1):
        flips = random.integers(0, 2, (2, MOST_POINTS >> (digit + 1)))
        orders |= ((numbers >> digit & 1) ^ flips[:, numbers >> (digit + 1)]) << digit
    return orders


def traced_scene(job: FrameJob, stack: ExitStack) -> tuple[dict[str, moderngl.Texture], dict[str, Any]]:
    """Textures of the scene for ray tracing, and loose uniforms; released with the stack."""
    scene, center = job.scene, media_center(job.scene)
    hierarchies = job.resources.hierarchies.of(scene, textured=job.features.textured)
    placements, frame = hierarchies.place(scene, center)
    table = job.object_table(placements)
    stack.callback(table.release)
    boxes = scene.boxes[scene.filled]
    values = {
        # Rays can leave each solid only through its surface.
        "all_closed": all(body.mesh.diagnosis.sound for body in scene.bodies if body.sheet_thickness is None),
        "start_interior": interior_at_eye(job),
        "object_nodes": hierarchies.object_nodes,
        "objects_frame": frame,
        "surface_table": hierarchies.surface_table,
        **dict(zip(("contact_low", "contact_high"), map(tuple, hierarchies.contacts.tolist()), strict=True)),
        # Metres from the center of the media within which all bodies are.
        "bodies_radius": 0.5 * float(np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0))),
    }
    return dict(zip(RAY_SAMPLERS, (table, hierarchies.nodes, hierarchies.triangles), strict=True)), values


def ray_switches(job: FrameJob) -> dict[str, bool]:
    """Switches of the shaders that follow rays through a scene: how bodies overlap, and which objects there are."""
    scene = job.scene
    return {
        "ONE_OBJECT": len(scene.objects) == 1,
        "ONE_SURFACE": len(scene.objects) == 1,
        "PRIORITY": scene.overlap == "priority",
        "UNION": scene.overlap == "union",
        "THIN_WALLS": bool(job.features.sheets),
    }


def interior_at_eye(job: FrameJob) -> tuple[int, int, int, int]:
    """Interior list of rays at the eye: the bodies around it, packed in pairs of 16 bits."""
    entries = [
        number + 1
        for number in np.flatnonzero(job.placed.expected_counts[:, 1]).tolist()
        if number not in job.features.sheets
        for _ in range(round(job.placed.expected_counts[number, 1]))
    ][::-1][:8]
    entries += [0] * (8 - len(entries))
    words = [low | high << 16 for low, high in zip(entries[::2], entries[1::2], strict=True)]
    return words[0], words[1], words[2], words[3]
