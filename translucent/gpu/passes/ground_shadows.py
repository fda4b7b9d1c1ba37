"""Map of the environment's shadows on a ground: a point looks up each direction once, and not for each sample."""

from __future__ import annotations

from collections.abc import Hashable, Iterable

import moderngl
import numpy as np

from translucent.arrays import Array
from translucent.gpu.job import FrameJob
from translucent.gpu.passes.opaque import shadow_switches
from translucent.gpu.passes.variants import Variants
from translucent.gpu.placement import Part
from translucent.gpu.shaders import set_uniform, set_used
from translucent.gpu.shadow_atlas import GroundShadows
from translucent.gpu.targets import add_up
from translucent.gpu.uniforms import media_center
from translucent.scene.camera import Camera
from translucent.scene.grounds import Mirror
from translucent.scene.scene import Scene

#: Distance from its middle up to which a ground is not squeezed, in half diagonals of what stands on it.
REACH = 1.5

#: Largest side of a map, in texels. Half as wide as a light's map, its texels are as large as those of a direction's.
MOST_TEXELS = 2048

#: Texels along a map for each pixel along a picture, whose longer side counts as the next power of two: a thumbnail
#: takes a small map.
TEXELS_OF_PIXEL = 4


class GroundShadowsPass:
    """Fraction of the environment's light that bodies take from a ground; see ``shaders/shade/ground_shadows.frag``.

    The map stays until what it is made of changes.
    """

    def __init__(self, gl: moderngl.Context) -> None:
        self._gl = gl
        samplers = "shadow_sums", "shadow_ends"
        self._variants = Variants(gl, "geometry/fullscreen.vert", "shade/ground_shadows.frag", *samplers)
        self._target: moderngl.Framebuffer | None = None
        self._made_of: Hashable = None

    def run(
        self, job: FrameJob, ground: Mirror, irradiance: Array, directions: Iterable[int], made_of: Hashable
    ) -> GroundShadows:
        """The map of a ground, by some of the directions whose maps the job's atlas has.

        Parameters
        ----------
        job : FrameJob
            Its uniforms are bound.
        ground : Mirror
        irradiance : (k, 3) float64
            From each direction, on a surface that faces it.
        directions : iterable of int
            Those that represent all.
        made_of : hashable
            Equal for frames whose atlases are equal.
        """
        scene, views = job.scene, job.resources.shadows.views
        assert views is not None
        center, bounds = media_center(scene), _bounds(scene, ground)
        middle, axes = _frame(bounds, ground)
        ahead = {i: views.sky[i].camera.forward for i in directions}
        cosines = {i: -float(ground.normal @ forward) for i, forward in ahead.items()}
        lit = [i for i, cosine in cosines.items() if cosine > 0.0]
        finest = TEXELS_OF_PIXEL * 2 ** int(max(job.targets.size) - 1).bit_length()
        side = min(job.plan.shadows.size // 2, MOST_TEXELS, finest)
        target = self._sized(side)
        key = made_of, irradiance.tobytes(), tuple(lit), middle.tobytes(), axes.tobytes()
        if key != self._made_of:
            self._made_of = None
            job.resources.shadows.use(self._variants.units)
            program = self._variants.program(**shadow_switches(True, job.resources))
            values = {
                "ground_middle": middle - center,
                "ground_x": axes[0],
                "ground_y": axes[1],
                "ground_normal": ground.normal,
                "box_low": bounds[0] - center,
                "box_high": bounds[1] - center,
                "all_light": np.array([cosines[i] for i in lit]) @ irradiance[lit],
            }
            set_used(program, {name: tuple(value.tolist()) for name, value in values.items()})
            set_uniform(program, "ground_texels", side)
            target.clear()
            add_up(self._gl)
            radii = dict(zip(ahead, _cell_radii(np.array(list(ahead.values()))).tolist(), strict=True))
            for order, i in enumerate(lit):
                set_used(program, {"number": i, "order": order, "cell_radius": radii[i]})
                part = _footprint(views.sky[i].camera, radii[i], ground, bounds, axes, side)
                self._variants.draw_part(part, program, target)
            self._made_of = key
        rows = [(*row, float(row @ (center - middle))) for row in axes / np.square(axes).sum(axis=1, keepdims=True)]
        return GroundShadows(scene.objects.index(ground.ground), target.color_attachments[0], tuple(rows))

    def _sized(self, side: int) -> moderngl.Framebuffer:
        """Framebuffer of the map, so many texels wide."""
        if self._target is None or self._target.width != side:
            if self._target is not None:
                self._target.color_attachments[0].release()
                self._target.release()
            texture = self._gl.texture((side, side), 4, dtype="f4")
            texture.filter = moderngl.LINEAR, moderngl.LINEAR
            texture.repeat_x = texture.repeat_y = False
            self._target, self._made_of = self._gl.framebuffer([texture]), None
        return self._target


def _bounds(scene: Scene, ground: Mirror) -> Array:
    """(2, 3): bounds of all objects but the ground."""
    boxes = np.stack([item.bounds for item in scene.objects if item is not ground.ground])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _cell_radii(directions: Array) -> Array:
    """(n,): radii of discs as large as the cells of unit vectors (n, 3), in radians, as of a hexagonal grid."""
    cosines = directions @ directions.T
    np.fill_diagonal(cosines, -1.0)
    apart = np.arccos(np.clip(cosines.max(axis=1), -1.0, 1.0))
    return np.asarray(np.minimum(np.sqrt(np.sqrt(0.75) / np.pi) * apart, 0.5))


def _frame(bounds: Array, ground: Mirror) -> tuple[Array, Array]:
    """Middle (3,) of the map on the ground, and two vectors (2, 3) along it, as long as where squeezing begins."""
    low, high = bounds
    middle, size = 0.5 * (low + high), REACH * 0.5 * float(np.linalg.norm(high - low)) or 1.0
    first = np.cross(ground.normal, np.eye(3)[int(np.abs(ground.normal).argmin())])
    first /= np.linalg.norm(first)
    axes = size * np.stack([first, np.cross(ground.normal, first)])
    return middle + (ground.height - middle @ ground.normal) * ground.normal, axes


def _footprint(camera: Camera, radius: float, ground: Mirror, bounds: Array, axes: Array, side: int) -> Part:
    """Texels of a map on which what a direction's camera sees has its shadow, with cells of that radius."""
    middle, _ = _frame(bounds, ground)
    half_width, half_height = camera.half_extent((1, 1))
    ends = np.stack([half_width * camera.right, half_height * camera.up])
    for _ in range(2):  # the second time with what shadows are blurred by where they are longest
        points = camera.eye + np.array([(x, y) for x in (-1, 1) for y in (-1, 1)]) @ ends
        ahead = (ground.height - points @ ground.normal) / (camera.forward @ ground.normal)
        points = points + ahead[:, None] * camera.forward
        longest = float(((points - bounds.mean(axis=0)) @ camera.forward).max())
        blur = radius * max(longest, 0.0)
        ends = np.stack([(half_width + blur) * camera.right, (half_height + blur) * camera.up])
    at = (points - middle) @ axes.T / np.square(axes).sum(axis=1)
    size = np.abs(at)
    place = np.where(size > 1.0, np.sign(at) * (1.0 - 0.5 / np.maximum(size, 1.0)), 0.5 * at)
    low, high = (0.5 + 0.5 * place.min(axis=0)) * side - 1.0, (0.5 + 0.5 * place.max(axis=0)) * side + 1.0
    left, bottom = np.clip(np.floor(low), 0, side).astype(int).tolist()
    right, top = np.clip(np.ceil(high), 0, side).astype(int).tolist()
    return Part(left, bottom, right, top)
