"""Progressive rendering for a window: at first coarse, then sharp, then smooth, without reading pixels back.

A step draws a frame whose pixels have their centers on one of `stride` x `stride` pixels of the picture, so that no
step takes long on a slow machine, and that after `stride`^2 of them each pixel is what a frame of the full size shows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.errors import RenderError
from translucent.formulas.sampling import sample_shifts
from translucent.formulas.tone import TONES
from translucent.frames.aovs import EMPTY, SEEN, WRONG, false_colors
from translucent.frames.frame import Frame
from translucent.gpu.job import FrameJob
from translucent.gpu.renderer import GpuRenderer
from translucent.gpu.shaders import before_drawing, before_making, build_program, set_uniform
from translucent.gpu.stand_in import StandIn
from translucent.planning.render_plan import RenderPlan
from translucent.scene.camera import Lens
from translucent.scene.scene import Scene

#: Strides of steps; the sides of pictures are multiples of the largest.
STRIDES = (1, 2, 4, 8, 16)


@lru_cache(maxsize=4)
def shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts of the samples of a pixel after the first one, in drawing order."""
    return sample_shifts(samples)


@lru_cache(maxsize=len(STRIDES))
def phases(stride: int) -> list[tuple[tuple[int, int], int]]:
    """Phases: pixels within stride x stride pixels, in drawing order, and the side of the square that each fills."""
    order: list[tuple[tuple[int, int], int]] = [((0, 0), stride)]
    block = stride // 2
    while block:
        # Diagonals first: half of the new pixels already make the picture look sharper in both directions.
        known = {phase for phase, _ in order}
        fresh = [(x, y) for y in range(0, stride, block) for x in range(0, stride, block) if (x, y) not in known]
        fresh.sort(key=lambda phase: (phase[0] % (2 * block) == 0) + (phase[1] % (2 * block) == 0))
        order += [(phase, block) for phase in fresh]
        block //= 2
    return order


Size = tuple[int, int]


class Side:
    """Accumulated samples of one side of the comparison: radiance, optical depth and thickness, flags."""

    def __init__(self, gl: moderngl.Context, size: Size) -> None:
        self.size = size
        try:
            self.textures = [gl.texture(size, count, dtype="f4") for count in (4, 4, 1)]
            for texture in self.textures:
                texture.filter = moderngl.NEAREST, moderngl.NEAREST
            self.all = gl.framebuffer(self.textures)
            self.light = gl.framebuffer(self.textures[:1])
        except moderngl.Error as error:
            found = f"OpenGL does not have enough memory ({error})"
            raise RenderError(f"viewport of {size[0]}x{size[1]}", found, "make the window smaller") from error
        self.step, self.stride = 0, 1

    def known(self) -> list[tuple[int, ...]]:
        """Number of a drawn pixel to show in place of each of the stride x stride pixels; four numbers in a tuple."""
        order = phases(self.stride)
        found = [0] * STRIDES[-1] ** 2
        for (x, y), block in order[: max(self.step, 1)]:
            for i in range(x, x + block):
                for j in range(y, y + block):
                    found[i + self.stride * j] = x + self.stride * y
        # Whole registers: of small ones, OpenGL 3.3 need not have room for those of two frames.
        return [tuple(found[i : i + 4]) for i in range(0, len(found), 4)]

    def kept(self, x: int, y: int) -> Size:
        """Storage position of pixel (x, y) in the finished picture."""
        part = self.size[0] // self.stride, self.size[1] // self.stride
        return x % self.stride * part[0] + x // self.stride, y % self.stride * part[1] + y // self.stride

    def release(self) -> None:
        """Free the textures."""
        for resource in (self.all, self.light, *self.textures):
            resource.release()


#: Samples of a pixel after which its edges are smooth.
SAMPLES = 16

MODES = ("picture", "thickness", "transmittance", "validity")
RIGHT_SIDES = ("same", "second", "difference")


@dataclass(frozen=True)
class Shown:
    """Display settings of a picture.

    Attributes
    ----------
    mode : {"picture", "thickness", "transmittance", "validity"}
    right_side : {"same", "second", "difference"}
    split : float
        Where the right side begins, 0 to 1.
    thickest, worst : float
        Thickness of the last false color, and the largest difference of thickness, in metres.
    exposure : float
    tone : str
    """

    mode: str = "picture"
    right_side: str = "same"
    split: float = 1.0
    thickest: float = 1.0
    worst: float = 1.0
    exposure: float = 0.0
    tone: str = "none"


@dataclass(frozen=True)
class PixelProbe:
    """Values of one pixel.

    Attributes
    ----------
    thickness : float
        In metres.
    optical_depth : tuple of 3 floats
    covered, valid : bool
    """

    thickness: float
    optical_depth: tuple[float, float, float]
    covered: bool
    valid: bool


class Viewport:
    """Progressive picture of a window, in a texture, with a second frame beside it to compare.

    Parameters
    ----------
    engine : GpuRenderer
        Draws with the context of the window.

    Attributes
    ----------
    size : (width, height)
    """

    def __init__(self, engine: GpuRenderer) -> None:
        self.engine = engine
        gl = self._gl = engine.context.gl
        units = {"radiance": 0, "optical_depth": 1, "thickness": 2, "flags": 3}
        self._gather = build_program(gl, "geometry/fullscreen.vert", "present/gather.frag", **units)
        self._gathering = gl.vertex_array(self._gather, [])
        self._added: set[bool] = set()  # first samples of pixels, others
        self._draw_part = build_program(gl, "present/window.vert", "present/window.frag", picture=0)
        self._drawing_part = gl.vertex_array(self._draw_part, [])
        self._variants: dict[tuple[int, ...], tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._colors = gl.texture((256, 1), 3, false_colors().tobytes(), alignment=1)
        # moderngl goes back to the framebuffer in use whenever it makes another one, and fails if that is gone. So
        # before any is released, ours or the engine's, this one is put to use.
        self._rest = gl.framebuffer([gl.texture((1, 1), 1)])
        self._sides: list[Side | None] = [None, None]
        self._screen: moderngl.Framebuffer | None = None
        self._coarse: moderngl.Framebuffer | None = None
        self._at_once = False
        self._stand_in, self._standing = StandIn(gl, engine.meshes), False
        self._instead: moderngl.Framebuffer | None = None
        self.size: Size = (0, 0)

    @property
    def texture(self) -> moderngl.Texture:
        """The picture, sRGB-encoded; its first row is the bottom one, as OpenGL has it."""
        return self.framebuffer.color_attachments[0]

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """Framebuffer of `texture`."""
        if self._standing and self._instead is not None:
            return self._instead
        chosen = self._coarse if self._at_once and self._coarse is not None else self._screen
        assert chosen is not None
        return chosen

    @contextmanager
    def at_once(self, factor: float) -> Iterator[moderngl.Framebuffer]:
        """Draw a whole picture, smaller by a factor, that replaces it until `present`.

        The picture before stays if that fails.
        """
        size = max(round(self.size[0] / factor), 1), max(round(self.size[1] / factor), 1)
        known = self._coarse
        made = known if known is not None and known.size == size else self._make_coarse(size, factor)
        try:
            yield made
        except BaseException:
            if made is not known:
                self._release(made)
            raise
        if known is not None and known is not made:
            self._release(known)
        self._coarse, self._at_once, self._standing = made, True, False

    def prepare_stand_in(self, scene: Scene, tones: Iterable[str]) -> None:
        """Compile the programs of `stand_in` in advance."""
        standing = self._standing
        for tone in tones:
            self.stand_in(scene, (0.0, tone), whole=False)
        self._standing = standing

    def stand_in(self, scene: Scene, look: tuple[float, str], *, whole: bool) -> None:
        """Show a quick preview picture of a scene, without slow programs.

        Parameters
        ----------
        scene : Scene
        look : (float, str)
            Exposure in stops, and the name of the tone curve.
        whole : bool
            The picture on show has another camera: what is around the bodies is drawn, too.
        """
        if self._instead is None:
            self._rest.use()
            picture, depth = self._gl.texture(self.size, 4), self._gl.depth_renderbuffer(self.size)
            self._instead = self._gl.framebuffer([picture], depth)
        self._standing, into = False, self._instead
        under = None if whole else partial(self.draw_into, into, (0, 0, *self.size))
        self._stand_in.draw(into, scene, look, under)
        self._standing = True

    def draw_into(self, window: moderngl.Framebuffer, part: tuple[int, int, int, int]) -> None:
        """Draw the picture into a part of a window: its left and bottom, width and height in pixels."""
        window.use()
        whole = window.viewport
        window.viewport = part
        self._gl.enable_only(moderngl.NOTHING)
        self.texture.use(0)
        self._drawing_part.render(moderngl.TRIANGLES, vertices=3)
        window.viewport = whole

    def resize(self, size: Size) -> None:
        """Make room for pictures of a size; rounded down to a multiple of the largest stride.

        Raises
        ------
        RenderError
            If OpenGL has no room for them.
        """
        unit = STRIDES[-1]
        size = max(size[0] // unit, 1) * unit, max(size[1] // unit, 1) * unit
        if size == self.size:
            return
        limit = int(self.engine.context.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise RenderError(
                f"viewport of {size[0]}x{size[1]}",
                f"this OpenGL allows at most {limit} pixels along a side",
                "make the window smaller",
            )
        try:
            texture = self._gl.texture(size, 4)
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
            screen = self._gl.framebuffer([texture])
        except moderngl.Error as error:
            found = f"OpenGL does not have enough memory ({error})"
            raise RenderError(f"viewport of {size[0]}x{size[1]}", found, "make the window smaller") from error
        screen.clear()
        if self._screen is not None:
            self.draw_into(screen, (0, 0, *size))  # until there is another picture
        self._release_pictures()
        self._screen, self.size = screen, size

    def restart(self, *numbers: int) -> None:
        """Begin anew, with another scene or other settings: both sides, or that of a number."""
        for number in numbers or (0, 1):
            if (side := self._sides[number]) is not None:
                side.step = 0

    def swap(self) -> None:
        """Swap the two sides of the viewport."""
        self._sides.reverse()

    def mean_radiance(self) -> float:
        """Mean radiance of the picture on the left, once all of its pixels are drawn; blocks until then."""
        side = self._side(0, self.size)
        values = np.frombuffer(side.light.read(components=4, dtype="f4"), np.float32).reshape(-1, 4)
        with np.errstate(under="ignore"):
            return float((values[:, :3].mean(axis=1, dtype=np.float64) / np.maximum(values[:, 3], 1.0)).mean())

    def step(
        self,
        side: int,
        plan: RenderPlan,
        stride: int,
        samples: int = SAMPLES,
        photons: moderngl.Texture | None = None,
        lens: Lens | None = None,
    ) -> None:
        """Draw the next sample of a side, of `samples` a pixel besides its center; a picture has one stride.

        Light of `photons`, as a picture of the viewport's size has it, takes the place of those of a plan. All samples
        but the first are through points of a lens, if there is one; each of those has photons of its own.
        """
        chosen = self._side(side, self.size)
        chosen.stride = stride
        round_, number = divmod(chosen.step, stride * stride)
        phase, _ = phases(stride)[number]
        right, down = shifts(samples)[(round_ - 1) % samples] if round_ else (0.0, 0.0)
        self._rest.use()
        engine, size = self.engine, (self.size[0] // stride, self.size[1] // stride)
        if lens is not None and round_:
            camera = lens.camera(plan.scene.camera, size, (round_ - 1) % samples, samples)
            plan = replace(plan, scene=replace(plan.scene, camera=camera))
            if plan.caustics is not None:
                plan, photons = replace(plan, caustics=replace(plan.caustics, seed=round_)), None
        job = engine.prepare(plan, size)
        if photons is not None:
            job.photon_light = photons, stride, phase
        try:
            middle = (phase[0] + 0.5) / stride - 0.5, (phase[1] + 0.5) / stride - 0.5
            job.pixel_middle = middle
            job.place((middle[0] + right / stride, middle[1] + down / stride))
            self._make_ready(job, chosen, first=round_ == 0)
            engine.run(job)
            self._add(job, chosen, (phase[0] * size[0], phase[1] * size[1]), first=round_ == 0)
        finally:
            job.release()
            engine.context.drain()
        chosen.step += 1

    def take(self, side: int, job: FrameJob) -> None:
        """Show the picture of a job of the viewport's size in place of a side's samples."""
        chosen = self._side(side, self.size)
        self._add(job, chosen, (0, 0), first=True)
        chosen.stride = 1

    def radiance(self, side: int) -> npt.NDArray[np.float32]:
        """(h, w, 3): mean radiance of the samples of a side whose pixels were all drawn at once; reads them back."""
        chosen = self._side(side, self.size)
        values = np.frombuffer(chosen.light.read(components=4, dtype="f4"), np.float32)
        values = values.reshape(self.size[1], self.size[0], 4)
        return np.asarray(values[..., :3] / np.maximum(values[..., 3:], 1.0))

    def put_radiance(self, side: int, radiance: npt.NDArray[np.float32]) -> None:
        """Show a radiance (h, w, 3) in place of a side's samples."""
        light = np.ones((*radiance.shape[:2], 4), dtype=np.float32)
        light[..., :3] = radiance
        chosen = self._side(side, self.size)
        chosen.textures[0].write(light)
        chosen.stride = 1

    def steps(self, side: int) -> int:
        """Number of samples that a side has."""
        found = self._sides[side]
        return 0 if found is None else found.step

    def put(self, frame: Frame) -> None:
        """Show a frame, such as the reference, as the second side."""
        side = self._side(1, frame.size)
        height, width = frame.thickness.shape
        light = np.ones((height, width, 4), dtype=np.float32)
        with np.errstate(under="ignore", over="ignore"):
            light[..., :3] = frame.radiance
            depths = np.concatenate([frame.optical_depth, frame.thickness[..., None]], axis=2).astype(np.float32)
        trust = frame.coverage.astype(np.float32) + 2.0 * frame.valid.astype(np.float32)
        for texture, content in zip(side.textures, (light, depths, trust), strict=True):
            texture.write(np.ascontiguousarray(content, dtype=np.float32))
        side.step = side.stride = 1

    def present(self, shown: Shown) -> None:
        """Tone-map the samples so far into the texture."""
        first, second = self._side(0, self.size), self._sides[1]
        other = first if second is None or not second.step else second
        for unit, texture in enumerate([*first.textures, *other.textures, self._colors]):
            texture.use(unit)
        program, fullscreen = self._variant(self._variant_of(shown))
        values: dict[str, object] = {
            "shift_a": STRIDES.index(first.stride),
            "known_a": first.known(),
            "shift_b": STRIDES.index(other.stride),
            "known_b": other.known(),
            "split": shown.split * self.size[0],
            "thickest": shown.thickest,
            "worst": shown.worst,
            "stops": shown.exposure,
        }
        for name, value in values.items():
            if name in program:  # each variant uses some of them
                set_uniform(program, name, value)
        self._at_once = self._standing = False
        self.framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        fullscreen.render(moderngl.TRIANGLES, vertices=3)

    def presents_at_once(self, shown: Shown) -> bool:
        """True if nothing is to be compiled to show the samples so."""
        return self._variant_of(shown) in self._variants

    def _variant_of(self, shown: Shown) -> tuple[int, int, int]:
        mode, second = MODES.index(shown.mode), self._sides[1]
        right = RIGHT_SIDES.index(shown.right_side) if second is not None and second.step else 0
        return mode, right, TONES.index(shown.tone) if mode in (0, 3) else 0

    def _variant(self, key: tuple[int, int, int]) -> tuple[moderngl.Program, moderngl.VertexArray]:
        if key not in self._variants:
            names = ("light_a", "depths_a", "trust_a", "light_b", "depths_b", "trust_b", "false_colors")
            units = {name: i for i, name in enumerate(names)}
            defines = dict(zip(("MODE", "RIGHT", "TONE"), key, strict=True))
            program = build_program(self._gl, "geometry/fullscreen.vert", "present/compare.frag", defines, 330, **units)
            for name, color in (("empty_color", EMPTY), ("valid_color", SEEN), ("wrong_color", WRONG)):
                if name in program:
                    set_uniform(program, name, tuple(v / 255.0 for v in color))
            self._variants[key] = program, self._gl.vertex_array(program, [])
        return self._variants[key]

    def probe(self, x: int, y: int, side: int = 0) -> PixelProbe | None:
        """Values of a pixel, counted from the top left; None if it is outside, or nothing is drawn yet."""
        found = self._sides[side]
        if found is None or not found.step or not (0 <= x < self.size[0] and 0 <= y < self.size[1]):
            return None
        x, y = x * found.size[0] // self.size[0], y * found.size[1] // self.size[1]
        where = (*found.kept(x, y), 1, 1)
        depths = np.frombuffer(found.all.read(where, 4, attachment=1, dtype="f4"), np.float32).astype(np.float64)
        flags = int(np.frombuffer(found.all.read(where, 1, attachment=2, dtype="f4"), np.float32)[0])
        red, green, blue, thickness = depths.tolist()
        return PixelProbe(thickness, (red, green, blue), bool(flags & 1), bool(flags & 2))

    def pixels(self) -> npt.NDArray[np.uint8]:
        """(h, w, 3): the texture, read back."""
        framebuffer = self.framebuffer
        data = framebuffer.read(components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(framebuffer.height, framebuffer.width, 3)[::-1].copy()

    def release(self) -> None:
        """Free all OpenGL objects except the engine, which belongs to the caller."""
        self._release_pictures()
        for resource in (
            self._gathering,
            self._gather,
            self._colors,
            *(one for v in self._variants.values() for one in v),
        ):
            resource.release()
        self._variants.clear()
        self._stand_in.release()
        self._gl.detect_framebuffer(0).use()
        self._rest.color_attachments[0].release()
        self._rest.release()

    def _release_pictures(self) -> None:
        self._rest.use()
        for side in self._sides:
            if side is not None:
                side.release()
        self._sides = [None, None]
        for picture in (self._coarse, self._screen, self._instead):
            if picture is not None:
                self._release(picture)
        self._coarse = self._screen = self._instead = None
        self._at_once = self._standing = False
        self.size = (0, 0)

    def _make_coarse(self, size: Size, factor: float) -> moderngl.Framebuffer:
        self._rest.use()
        texture = self._gl.texture(size, 4)
        if factor == 1.0:
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return self._gl.framebuffer([texture])

    def _release(self, picture: moderngl.Framebuffer) -> None:
        self._rest.use()
        picture.color_attachments[0].release()
        if picture.depth_attachment is not None:
            picture.depth_attachment.release()
        picture.release()

    def _side(self, number: int, size: Size) -> Side:
        side = self._sides[number]
        if side is None or side.size != size:
            self._rest.use()
            before_making(self._gl)
            if side is not None:
                side.release()
                self._sides[number] = None
            side = self._sides[number] = Side(self._gl, size)
            before_drawing(self._gl)  # drivers clear large pictures, which takes as long as a step
        return side

    def _make_ready(self, job: FrameJob, side: Side, *, first: bool) -> None:
        """Compile in advance the programs that add samples."""
        if first not in self._added:
            before_making(self._gl)
            into = side.all if first else side.light
            into.scissor = 0, 0, 0, 0
            self._gather_into(into, job, blends=not first)
            into.scissor = None
            self._added.add(first)
            before_drawing(self._gl)

    def _add(self, job: FrameJob, side: Side, origin: Size, *, first: bool) -> None:
        """Store the frame of a job: in place of the last one, or added to its radiance."""
        set_uniform(self._gather, "origin", origin)
        into = side.all if first else side.light
        into.viewport = (*origin, *job.targets.size)
        self._gather_into(into, job, blends=not first)

    def _gather_into(self, into: moderngl.Framebuffer, job: FrameJob, *, blends: bool) -> None:
        for unit, one in enumerate([job.picture.color_attachments[0], *job.targets["result"].color_attachments[2:5]]):
            one.use(unit)
        into.use()
        self._gl.enable_only(moderngl.BLEND if blends else moderngl.NOTHING)
        if blends:
            self._gl.blend_equation, self._gl.blend_func = moderngl.FUNC_ADD, (moderngl.ONE, moderngl.ONE)
        self._gathering.render(moderngl.TRIANGLES, vertices=3)
