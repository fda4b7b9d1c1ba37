"""One frame under way: the scene, its plan, and what the passes share."""

from __future__ import annotations

import time

import moderngl
import numpy as np

from translucent.gpu.buffers import MeshCache
from translucent.gpu.layout import BODY, SHADE, VIEW
from translucent.gpu.placement import MAX_SCENE_OPTICAL_DEPTH, Placement, depth_range, view_uniforms
from translucent.gpu.shaders import CONSTANTS
from translucent.gpu.targets import Targets
from translucent.plan import FALLBACK_SHEET, RenderPlan
from translucent.scene import Object, Scene
from translucent.thickness import SignedDepth, ThinLayer

#: Offsets of uniform buffer ranges must be multiples of this on every driver in use.
_ALIGNMENT = 256

#: A path of less than this share of the diagonal is the rounding of a sum that should be 0.
_COVERAGE_FLOOR = 2e-7

#: Counts of open bodies must not cancel: the first gets 16 times the weight of closed ones, the next 16 times that, and
#: so on, as far as float32 counts exactly. Beyond, they share the last weight.
_OPEN_WEIGHTS = tuple(16.0**k for k in range(1, 6))

#: Share of the diagonal that a path may be below 0; it then counts as 0.
_NEGATIVE_TOLERANCE = 1e-2


class FrameJob:
    """What a pass needs: bodies placed before the camera, uniform buffers, targets.

    Parameters
    ----------
    gl, scene, plan, targets, meshes
    """

    def __init__(
        self, gl: moderngl.Context, scene: Scene, plan: RenderPlan, targets: Targets, meshes: MeshCache
    ) -> None:
        self.gl = gl
        self.scene = scene
        self.plan = plan
        self.targets = targets
        self.meshes = meshes
        self.samples = 1
        self.started = time.perf_counter()
        self._placements = [Placement.of(body, scene.camera) for body in scene.objects]
        self._count_weights = _count_weights(scene)
        self._stride = -(-BODY.dtype.itemsize // _ALIGNMENT) * _ALIGNMENT
        self._view = gl.buffer(reserve=VIEW.dtype.itemsize)
        self._bodies = gl.buffer(reserve=self._stride * len(scene.objects))
        self._shade = gl.buffer(self._shade_uniforms())
        self._cleared: set[str] = set()
        self.place((0.0, 0.0))

    def place(self, shift: tuple[float, float], *, with_depth: bool = False) -> None:
        """Write the uniforms for samples that are `shift` (right, down) pixels off the pixel centers."""
        camera, size = self.scene.camera, self.targets.size
        depths = depth_range(self.scene) if with_depth else None
        anchored = not (isinstance(self.plan.method, SignedDepth) and not self.plan.method.anchored)
        limit = MAX_SCENE_OPTICAL_DEPTH / max(self.scene.diagonal, np.finfo(np.float64).tiny)
        for i, placement in enumerate(self._placements):
            record = placement.uniforms(
                camera,
                size,
                shift,
                anchored=anchored,
                sheet_thickness=self._sheet_thickness(placement.body),
                count_weight=self._count_weights[i],
                max_extinction=limit,
                depth_range=depths,
            )
            self._bodies.write(record, offset=i * self._stride)
        self._view.write(view_uniforms(camera, size, shift))
        self._view.bind_to_uniform_block(VIEW.binding)
        self._shade.bind_to_uniform_block(SHADE.binding)
        self._cleared.clear()

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

    def draw(self, program: moderngl.Program, objects: tuple[int, ...]) -> None:
        """Draw objects with the current state; front faces are those where a ray enters."""
        for i in objects:
            body = self.scene.objects[i]
            self._bodies.bind_to_uniform_block(BODY.binding, offset=i * self._stride, size=BODY.dtype.itemsize)
            self.gl.front_face = "cw" if body.faces_inwards else "ccw"
            self.meshes[body.mesh].vertex_array(program, body.mesh).render()
        self.gl.front_face = "ccw"

    def release(self) -> None:
        """Free the uniform buffers."""
        for buffer in (self._view, self._bodies, self._shade):
            buffer.release()

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
            (weight * placement.expected_count[0], weight * placement.expected_count[1])
            for weight, placement in zip(self._count_weights, self._placements, strict=True)
        ]
        low, high = zip(*pairs, strict=True)
        return sum(low), sum(high)

    def _negative_tolerance(self) -> float:
        """How far below 0 a thickness may be, in metres, before it betrays faces that look the wrong way.

        A rasteriser decides coverage on a grid of 1/256 pixel, so at a silhouette a pixel center may lie that far off
        both of its faces. Extended to it, they cross: by a pixel's size where they are steeper than 256, and by up to
        a face's length where one is seen edge-on. Where a mesh has parts inside out, nothing is tolerated.
        """
        camera, size = self.scene.camera, self.targets.size
        distance = max(float(np.linalg.norm(placement.anchor)) for placement in self._placements) + self.scene.diagonal
        pixel = 2.0 * camera.half_extent(size)[1] / size[1] * (1.0 if camera.fov_y is None else distance)
        # Distances from the camera cancel with an error that grows with them: that is not a flipped face.
        rounding = distance if isinstance(self.plan.method, SignedDepth) and not self.plan.method.anchored else 0.0
        suspicious = any(body.mesh.diagnosis.inside_out_parts for body in self.scene.objects)
        share = _COVERAGE_FLOOR if suspicious else _NEGATIVE_TOLERANCE
        return share * (self.scene.diagonal + rounding) + (0.0 if suspicious else pixel)

    def _shade_uniforms(self) -> bytes:
        environment = self.scene.environment
        medium = next((body.medium for body in self.scene.bodies), None)
        limit = MAX_SCENE_OPTICAL_DEPTH / max(self.scene.diagonal, np.finfo(np.float64).tiny)
        return SHADE.pack(
            extinction=[*(np.zeros(3) if medium is None else np.minimum(medium.extinction, limit)), 0.0],
            emission=[*(np.zeros(3) if medium is None else np.asarray(medium.emission)), 0.0],
            environment_first=[*environment.first, 0.0],
            environment_second=[*environment.second, 0.0],
            expected_count=self._expected_counts(),
            negative_tolerance=self._negative_tolerance(),
            coverage_floor=_COVERAGE_FLOOR * self.scene.diagonal,
            environment_tiles=environment.tiles,
            environment_kind=int(CONSTANTS[f"ENVIRONMENT_{environment.kind.upper()}"]),
        )


def _count_weights(scene: Scene) -> list[float]:
    """What a face of each object adds to a pixel's count."""
    weights = []
    used = 0
    for body in scene.objects:
        is_open = not body.mesh.diagnosis.solid
        weights.append(_OPEN_WEIGHTS[min(used, len(_OPEN_WEIGHTS) - 1)] if is_open else 1.0)
        used += is_open
    return weights
