"""One frame under way: the scene, its plan, and what the passes share."""

from __future__ import annotations

import time

import moderngl
import numpy as np

from translucent.gpu.backdrop import TextureBackdrop
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.densities import density_uniforms, scene_grids
from translucent.gpu.layout import BODY, DENSITY, ENVIRONMENT, LIGHTS, MEDIA, SCATTER, SHADE, SURFACES, VIEW
from translucent.gpu.light_cameras import media_sphere
from translucent.gpu.placement import AxialRange, Placement, depth_range
from translucent.gpu.resources import Resources
from translucent.gpu.targets import Targets
from translucent.gpu.uniforms import (
    BodyRole,
    LightViews,
    View,
    body_uniforms,
    environment_uniforms,
    light_uniforms,
    media_uniforms,
    scatter_uniforms,
    shade_uniforms,
    surface_uniforms,
    view_uniforms,
)
from translucent.planning.methods import FragmentLists, KBuffer, RayMarched, SignedDepth, ThinLayer
from translucent.planning.plan import FALLBACK_SHEET
from translucent.planning.render_plan import RenderPlan
from translucent.planning.slots import medium_slots
from translucent.scene.backdrop import Backdrop
from translucent.scene.scene import Object, Scene

_UNEXPECTED = float(CONSTANTS["UNEXPECTED"])

#: Offsets of uniform buffer ranges must be multiples of this on every driver in use.
_ALIGNMENT = 256

#: A path of less than this share of the diagonal is the rounding of a sum that should be 0.
_COVERAGE_FLOOR = 2e-7

#: Counts of open bodies must not cancel: the first gets 16 times the weight of closed ones, the next 16 times that, and
#: so on, as far as float32 counts exactly. Beyond, they share the last weight.
_OPEN_WEIGHTS = tuple(16.0**k for k in range(1, 6))

#: Share of the diagonal that a path may be below 0 by rounding; it then counts as 0. Steep faces have the largest
#: errors, of some 1e-5.
_ROUNDING = 1e-5


class FrameJob:
    """What a pass needs: bodies placed before the camera, uniform buffers, targets.

    Parameters
    ----------
    gl, scene, plan, targets, resources
    backdrop : Backdrop or TextureBackdrop, optional
        What a plan with the pass of that name needs.
    """

    def __init__(
        self,
        gl: moderngl.Context,
        scene: Scene,
        plan: RenderPlan,
        targets: Targets,
        resources: Resources,
        backdrop: Backdrop | TextureBackdrop | None = None,
    ) -> None:
        self.gl = gl
        self.scene = scene
        self.plan = plan
        self.targets = targets
        self.resources = resources
        self.backdrop = backdrop
        self.averaging = False
        self.light_views: LightViews | None = None
        self.started = time.perf_counter()
        self.slots = medium_slots(scene)
        self._placements = [Placement.of(body, scene.camera) for body in scene.objects]
        self.media_range = AxialRange.of(scene.bodies, scene.camera)
        self._opaque_range = AxialRange.of(scene.opaque, scene.camera) if scene.opaque else None
        self._roles = self._body_roles()
        self._stride = -(-BODY.dtype.itemsize // _ALIGNMENT) * _ALIGNMENT
        self._view = gl.buffer(reserve=VIEW.dtype.itemsize)
        self._bodies = gl.buffer(reserve=self._stride * len(scene.objects))
        self._constant = {
            SHADE: gl.buffer(
                shade_uniforms(scene, self._expected_counts(), self._rounding(), _COVERAGE_FLOOR * scene.diagonal)
            ),
            MEDIA: gl.buffer(media_uniforms(scene, self.slots, self._placements, self.media_range)),
            LIGHTS: gl.buffer(light_uniforms(scene, self.has_opaque or self.has_surfaces or self.has_layers)),
            ENVIRONMENT: gl.buffer(environment_uniforms(scene.environment)),
        }
        if self.has_surfaces:
            view = View(scene.camera, targets.size)
            self._constant[SURFACES] = gl.buffer(surface_uniforms(scene, self.media_range, view))
        if self.scene.varies:
            densities = density_uniforms(scene, self.slots, media_sphere(scene)[0])
            self._constant[DENSITY] = gl.buffer(densities)
        self._cleared: set[str] = set()
        self.place((0.0, 0.0))

    def place(self, shift: tuple[float, float], *, with_depth: bool = False) -> None:
        """Write the uniforms for samples that are `shift` (right, down) pixels off the pixel centers."""
        scene = self.scene
        depths = depth_range(scene.objects, scene.camera, scene.diagonal) if with_depth else None
        view = View(scene.camera, self.targets.size, shift, depths)
        for i, (placement, role) in enumerate(zip(self._placements, self._roles, strict=True)):
            record = body_uniforms(placement, view, role, self.media_range, scene.diagonal)
            self._bodies.write(record, offset=i * self._stride)
        self._view.write(view_uniforms(view, self.media_range, self._opaque_range))
        self._cleared.clear()
        self.bind()

    def bind(self) -> None:
        """Bind this frame's uniforms, where another's have been bound since it was placed."""
        if self.marches and not self.scatters and self.light_views is None:
            self.light_views = LightViews(media_sphere(self.scene)[0], (), np.zeros((0, 4)), np.zeros((0, 4)))
        if self.light_views is not None and SCATTER not in self._constant:
            view = View(self.scene.camera, self.targets.size)
            method = self.plan.method
            points = method.steps if isinstance(method, RayMarched) else getattr(method, "light_points", 1)
            content = scatter_uniforms(self.scene, self.media_range, view, self.light_views, points)
            self._constant[SCATTER] = self.gl.buffer(content)
        self._view.bind_to_uniform_block(VIEW.binding)
        for block, buffer in self._constant.items():
            buffer.bind_to_uniform_block(block.binding)

    @property
    def has_opaque(self) -> bool:
        """Whether rays may end on an opaque surface."""
        return any(step.name in ("opaque", "backdrop") for step in self.plan.passes)

    @property
    def has_surfaces(self) -> bool:
        """Whether light changes at the border of a body."""
        return any(step.name == "surfaces" for step in self.plan.passes)

    @property
    def has_layers(self) -> bool:
        """Whether layers are painted over the picture, or borders glow: a sample is summed up after that."""
        return any(step.name == "layers" for step in self.plan.passes)

    @property
    def one_border(self) -> bool:
        """Whether rays bend at the border where they enter a body, and not at the one where they leave it."""
        return self.plan.borders == "front"

    @property
    def finds_exits(self) -> bool:
        """Whether the intervals tell where each ray first leaves all bodies: borders need it where bodies touch."""
        return self.has_surfaces and isinstance(self.plan.method, FragmentLists | KBuffer | RayMarched)

    @property
    def scatters(self) -> bool:
        """Whether light from the lights is scattered into the rays."""
        return any(step.name == "light_views" for step in self.plan.passes)

    @property
    def marches(self) -> bool:
        """Whether the method steps through the intervals."""
        return isinstance(self.plan.method, RayMarched)

    @property
    def starts_inside(self) -> bool:
        """Whether rays may start inside a body."""
        return any(placement.expected_count[1] > 0 for placement in self._placements)

    @property
    def emits(self) -> bool:
        """Whether any medium emits light."""
        return any(body.medium is not None and body.medium.emits for body in self.scene.bodies)

    @property
    def picture(self) -> moderngl.Framebuffer:
        """Whose first attachment is the frame's radiance."""
        return self.targets.surfaced() if self.has_surfaces else self.targets.result()

    @property
    def sheets(self) -> dict[int, float]:
        """Thickness in metres of the objects that are drawn as sheets, without an inside, by their numbers."""
        thin = isinstance(self.plan.method, ThinLayer)
        return {
            i: self._sheet_thickness(body)
            for i, body in enumerate(self.scene.objects)
            if body.medium is not None and (thin or body.sheet_thickness is not None)
        }

    def accumulator(self, name: str = "accumulated") -> moderngl.Framebuffer:
        """Target in which thickness passes add up, cleared when a frame first asks for it."""
        framebuffer = self.targets.path_and_count(self.plan.spectral, name)
        if name not in self._cleared:
            framebuffer.clear()
            self._cleared.add(name)
        return framebuffer

    def begin_adding(self, target: str) -> None:
        """Set the state in which every face adds to an accumulator.

        No depth test and no culling: all faces count, and order cannot matter to a sum.
        """
        self.accumulator(target).use()
        self.gl.enable_only(moderngl.BLEND)
        self.gl.blend_equation = moderngl.FUNC_ADD
        self.gl.blend_func = moderngl.ONE, moderngl.ONE

    def bind_opaque(self, unit: int) -> None:
        """Give the places where rays end to the shader that reads texture `unit`, if there are any."""
        if self.has_opaque:
            self.targets.opaque().color_attachments[0].use(unit)

    def bind_grids(self, unit: int) -> None:
        """Give the density grids to the shader that reads texture `unit`, if a density varies."""
        if self.scene.varies:
            self.resources.grids.use(unit, scene_grids(self.scene, self.slots))

    def draw(self, program: moderngl.Program, objects: tuple[int, ...]) -> None:
        """Draw objects with the current state; front faces are those where a ray enters."""
        for i in objects:
            body = self.scene.objects[i]
            self._bodies.bind_to_uniform_block(BODY.binding, offset=i * self._stride, size=BODY.dtype.itemsize)
            self.gl.front_face = "cw" if body.faces_inwards else "ccw"
            self.resources.meshes[body.mesh].vertex_array(program, body.mesh).render()
        self.gl.front_face = "ccw"

    def release(self) -> None:
        """Free the uniform buffers."""
        for buffer in (self._view, self._bodies, *self._constant.values()):
            buffer.release()

    def _body_roles(self) -> list[BodyRole]:
        anchored = not (isinstance(self.plan.method, SignedDepth) and not self.plan.method.anchored)
        slot_of = {i: number for number, slot in enumerate(self.slots) for i in slot.objects}
        weights = _count_weights(self.scene)
        subpixel = 0.5 ** int(self.gl.info["GL_SUBPIXEL_BITS"])
        return [
            BodyRole(
                anchored,
                self._sheet_thickness(body),
                weights[i],
                _UNEXPECTED if body.medium is not None and body.mesh.diagnosis.inside_out else 0.0,
                # Where a body is broken, negative paths are more likely to be real than swapped at a silhouette.
                subpixel if body.mesh.diagnosis.sound else 0.0,
                max(weights) == 1.0,
                slot_of.get(i, 0),
                i,
            )
            for i, body in enumerate(self.scene.objects)
        ]

    def _sheet_thickness(self, body: Object) -> float:
        if body.sheet_thickness is not None:
            return body.sheet_thickness
        if isinstance(self.plan.method, ThinLayer):
            return self.plan.method.thickness
        return FALLBACK_SHEET * float(np.linalg.norm(body.bounds[1] - body.bounds[0]))

    def _expected_counts(self) -> tuple[float, float]:
        """Least and greatest sum of signed counts of a pixel that can be trusted."""
        if isinstance(self.plan.method, ThinLayer):
            return 0.0, 0.0
        pairs = [
            (role.count_weight * placement.expected_count[0], role.count_weight * placement.expected_count[1])
            for role, placement in zip(self._roles, self._placements, strict=True)
        ]
        low, high = zip(*pairs, strict=True)
        return sum(low), sum(high)

    def _rounding(self) -> float:
        """How far below 0 a path may be, in metres, by the rounding of float32 alone.

        Next to a silhouette a rasterizer may swap two faces, and a path is then below 0 by as much as it misplaces
        them; that differs from pixel to pixel, and goes along with what they hold (``thickness/snapping.glsl``).
        """
        reach = self.scene.diagonal
        if isinstance(self.plan.method, SignedDepth) and not self.plan.method.anchored:
            # Distances from the camera cancel with an error that grows with them.
            reach += max(float(np.linalg.norm(placement.anchor)) for placement in self._placements)
        return _ROUNDING * reach


def _count_weights(scene: Scene) -> list[float]:
    """What a face of each object adds to a pixel's count."""
    weights = []
    used = 0
    for body in scene.objects:
        is_open = body.medium is not None and not body.mesh.diagnosis.solid
        weights.append(_OPEN_WEIGHTS[min(used, len(_OPEN_WEIGHTS) - 1)] if is_open else 1.0)
        used += is_open
    return weights
