"""Textures and buffers that passes draw into and write to, made when a plan first needs them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np
import numpy.typing as npt

from translucent.errors import RenderError
from translucent.gpu.shaders import before_making


@dataclass(frozen=True)
class Format:
    """Format of the attachments of a framebuffer.

    Attributes
    ----------
    components : tuple of int
        Of each texture of float32, or of bytes where negative.
    with_depth : bool
        There is a depth buffer.
    windings : int
        Textures of RGBA32UI behind these.
    """

    components: tuple[int, ...]
    with_depth: bool = False
    windings: int = 0

    def bytes_of(self, *attachments: int) -> int:
        """Bytes of a pixel in some of the color attachments, or in all of them where none is named."""
        sizes = (*(4 * count if count > 0 else -count for count in self.components), *(16,) * self.windings)
        return sum(sizes[i] for i in attachments) if attachments else sum(sizes)


FORMATS = {
    "accumulated": Format((2,)),
    "accumulated-spectral": Format((4, 1)),
    # RGBA32F: nearest front face, farthest back face, nothing, number of faces.
    "nearest_and_farthest": Format((4,)),
    # R32F depth and RGBA32F radiance of the nearest opaque surface, with a depth buffer.
    "opaque": Format((1, 4), with_depth=True),
    # RGBA32F fraction of light that the nearest opaque surface reflects diffusely, and its normal; depth buffer.
    "base": Format((4, 4), with_depth=True),
    # RGBA32F irradiance of photons on the nearest opaque surface, and how many there are.
    "photons": Format((4,)),
    # RG32F: how far the photons of a pixel are spread, and the fraction that each pixel within gets.
    "photon_spread": Format((2,)),
    # RGBA32F interface where a ray first enters a body: normal, axial depth, parameters, color; with a depth buffer.
    "entered": Format((4, 4, 4), with_depth=True),
    # RGBA32F interface where a ray first leaves one beyond it: normal, axial depth, parameters; with a depth buffer.
    "left": Format((4, 4), with_depth=True),
    # RGBA32F radiance with what interfaces do to it, and transmittance, with a depth buffer.
    "surfaced": Format((4, 4), with_depth=True),
    # RGBA32F optical depth and soundness, emitted radiance and thickness, and counts of layers.
    "ordered": Format((4, 4, 4)),
    "peeled": Format((4,), with_depth=True),
    "peel_state": Format((4, 4, 4, 4, 4), windings=2),
    "nothing": Format((-1,)),
    # R32F: how far the rasterizer may misplace the steepest face of a pixel, in axial depth.
    "steepest": Format((1,)),
    # Arrays of a frame: radiance, transmittance, optical depth (RGBA32F), thickness (R32F) and flags (R8).
    "result": Format((4, 4, 4, 1, -1)),
    "compact": Format((4, 1)),
    "compact-spectral": Format((4, 1, 4)),
    # RGBA32F radiance and transmittance, summed over the samples of a pixel, with a depth buffer.
    "average": Format((4, 4), with_depth=True),
    # RGBA32F light of traced samples of a pixel and their number; squared luminance and trust; depth buffer.
    "bent": Format((4, 4), with_depth=True),
    # The same of the light that bodies add to what a ground mirrors, in samples that hit no interface.
    "mirrored": Format((4, 4), with_depth=True),
    # R32F: pixels that need more samples, with the standard deviation of a sample.
    "unsettled": Format((1,)),
    "mirror_unsettled": Format((1,)),
    # RGBA32F radiance of opaque surfaces, the mean of all samples, and the fraction of the pixel that they fill.
    "opaque_mean": Format((4,)),
    # RGBA32F means of random paths and how many were lost, and sums of squared differences from the means.
    "paths": Format((4, 4)),
    # RGBA32F layers in front of all bodies, and those behind the first one on a ray.
    "layers": Format((4, 4)),
    # R32F depth at which a ray first hits a body, with a depth buffer.
    "fronts": Format((1,), with_depth=True),
}


def accumulator_format(spectral: bool) -> Format:
    """Format of `Targets.path_and_count`."""
    return FORMATS["accumulated-spectral" if spectral else "accumulated"]


def compact_format(spectral: bool) -> Format:
    """Format of `Targets.compact`."""
    return FORMATS["compact-spectral" if spectral else "compact"]


#: First OpenGL version in which shaders write to buffers.
SHADER_STORAGE = 430


class Storage:
    """Named buffers, made on first use, that only grow.

    Parameters
    ----------
    gl : moderngl.Context
    owner : str
        What the buffers are for, in the words of errors.
    """

    def __init__(self, gl: moderngl.Context, owner: str) -> None:
        self._gl, self._owner = gl, owner
        self._buffers: dict[str, moderngl.Buffer] = {}

    def get(self, name: str, size: int) -> moderngl.Buffer:
        """Buffer of at least `size` bytes; its contents are lost when it grows.

        Raises
        ------
        RenderError
            If a shader of this OpenGL cannot reach that many bytes, or there is no room for them.
        """
        buffer = self._buffers.get(name)
        if buffer is not None and buffer.size >= size:
            return buffer
        before_making(self._gl)
        if buffer is not None:
            buffer.release()
            del self._buffers[name]
        try:
            if size > self.largest:
                raise moderngl.Error(f"a shader can read at most {self.largest / 1e6:.0f} MB")
            self._buffers[name] = self._gl.buffer(reserve=size)
        except moderngl.Error as error:
            raise RenderError(
                self._owner,
                f"OpenGL does not have enough memory for {size / 1e6:.0f} MB of surface lists ({error})",
                "use DepthPeeling, render the picture in parts, or choose a smaller picture",
            ) from error
        return self._buffers[name]

    @cached_property
    def largest(self) -> int:
        """Bytes of a buffer that a shader can write to."""
        return int(self._gl.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])

    @property
    def size(self) -> int:
        """Total size of the buffers in bytes."""
        return sum(buffer.size for buffer in self._buffers.values())

    def release(self) -> None:
        """Free all buffers."""
        for buffer in self._buffers.values():
            buffer.release()
        self._buffers.clear()


Size = tuple[int, int]


class Targets:
    """Framebuffers of one frame size by their contents, and buffers for the lists of its pixels."""

    def __init__(self, gl: moderngl.Context, size: Size) -> None:
        limit = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise RenderError(
                f"frame size {size[0]}x{size[1]}",
                f"this OpenGL allows at most {limit} pixels along a side",
                "render the picture in parts, or choose a smaller picture",
            )
        self._gl = gl
        self.size = size
        self._framebuffers: dict[str, moderngl.Framebuffer] = {}
        self._views: dict[tuple[str, int], moderngl.Framebuffer] = {}
        self.buffers = Storage(gl, f"frame size {size[0]}x{size[1]}")

    def __getitem__(self, name: str) -> moderngl.Framebuffer:
        """Framebuffer of this name in `FORMATS`."""
        return self._get(name)

    def path_and_count(self, spectral: bool, name: str = "accumulated") -> moderngl.Framebuffer:
        """Accumulator of thickness passes: RG32F (path, count), or RGBA32F (optical depth, count) and R32F (path)."""
        return self._get(f"{name}-{spectral}", accumulator_format(spectral))

    def opaque_ends(self) -> moderngl.Framebuffer:
        """Framebuffer `opaque` without radiance."""
        if ("opaque", 0) not in self._views:
            both = self["opaque"]
            self._views["opaque", 0] = self._gl.framebuffer(both.color_attachments[:1], both.depth_attachment)
        return self._views["opaque", 0]

    def peeled(self, number: int) -> moderngl.Framebuffer:
        """RGBA32F: what one pass of depth peeling finds, with one depth buffer for all of them."""
        return self._get(f"peeled-{number}", FORMATS["peeled"], depth_of="peeled-0" if number else None)

    def peel_state(self, number: int) -> moderngl.Framebuffer:
        """State of the two walks along each ray during peeling: five RGBA32F and two RGBA32UI."""
        return self._get(f"peel_state-{number}", FORMATS["peel_state"])

    def nothing(self) -> moderngl.Framebuffer:
        """Framebuffer for passes that write to buffers only.

        Its colors are masked. Else llvmpipe takes a face that fills a tile of 64 x 64 pixels for one that hides what
        has been drawn there, and leaves that out with all that it would have written to buffers.
        """
        framebuffer = self._get("nothing")
        framebuffer.color_mask = (False, False, False, False)
        return framebuffer

    def compact(self, *, with_depth: bool) -> moderngl.Framebuffer:
        """RGBA32F radiance; R32F thickness, with the sign bit where it cannot be trusted; and RGBA32F optical depth."""
        return self._get(f"compact-{with_depth}", compact_format(with_depth))

    def view(self, name: str, attachment: int) -> moderngl.Framebuffer:
        """Framebuffer with only one attachment of the framebuffer of this name."""
        if (name, attachment) not in self._views:
            texture = self._framebuffers[name].color_attachments[attachment]
            self._views[name, attachment] = self._gl.framebuffer([texture])
        return self._views[name, attachment]

    def depth_only(self) -> moderngl.Framebuffer:
        """Framebuffer with a depth buffer and nothing else."""
        if "depth_only" not in self._framebuffers:
            self._framebuffers["depth_only"] = self._gl.framebuffer(depth_attachment=self._gl.depth_texture(self.size))
        return self._framebuffers["depth_only"]

    def bytes_per_pixel(self) -> int:
        """Bytes that the color targets and buffers in use take for each pixel."""
        textures = [t for f in self._framebuffers.values() for t in f.color_attachments]
        per_pixel = sum(t.components * (1 if t.dtype == "f1" else 4) for t in textures)
        return int(per_pixel + self.buffers.size // (self.size[0] * self.size[1]))

    def _get(self, name: str, own: Format | None = None, *, depth_of: str | None = None) -> moderngl.Framebuffer:
        """The framebuffer of this name, with its own depth buffer or that of the framebuffer `depth_of`."""
        if name not in self._framebuffers:
            found = own or FORMATS[name]
            try:
                depth = self._framebuffers[depth_of].depth_attachment if depth_of is not None else None
                self._framebuffers[name] = self._make(found, depth)
            except moderngl.Error as error:
                megabytes = found.bytes_of() * self.size[0] * self.size[1] / 1e6
                raise RenderError(
                    f"frame size {self.size[0]}x{self.size[1]}",
                    f"OpenGL does not have enough memory for {megabytes:.0f} MB of pixels ({error})",
                    "render the picture in parts, or choose a smaller picture",
                ) from error
        return self._framebuffers[name]

    def _make(self, found: Format, depth: moderngl.Renderbuffer | moderngl.Texture | None) -> moderngl.Framebuffer:
        attachments = [
            self._gl.texture(self.size, abs(count), dtype="f4" if count > 0 else "f1") for count in found.components
        ]
        attachments += [self._gl.texture(self.size, 4, dtype="u4") for _ in range(found.windings)]
        for texture in attachments:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if found.with_depth and depth is None:
            depth = self._gl.depth_renderbuffer(self.size)
        return self._gl.framebuffer(attachments, depth)

    def release(self) -> None:
        """Free all textures and framebuffers."""
        for view in self._views.values():
            view.release()
        self._views.clear()
        for framebuffer in self._framebuffers.values():
            for attachment in framebuffer.color_attachments:
                attachment.release()
            if framebuffer.depth_attachment is not None:
                framebuffer.depth_attachment.release()
            framebuffer.release()
        self._framebuffers.clear()
        self.buffers.release()


def add_up(gl: moderngl.Context, also: int = 0) -> None:
    """Blend the next draws by addition to the target's values, with `also` these flags of moderngl."""
    gl.enable_only(moderngl.BLEND | also)
    gl.blend_equation = moderngl.FUNC_ADD
    gl.blend_func = moderngl.ONE, moderngl.ONE


def read_floats(framebuffer: moderngl.Framebuffer, attachment: int, components: int) -> npt.NDArray[np.float32]:
    """(h, w) or (h, w, components): what an attachment holds, in the order of its rows."""
    width, height = framebuffer.size
    shape = (height, width) if components == 1 else (height, width, components)
    array = np.empty(shape, dtype=np.float32)
    framebuffer.read_into(array, components=components, attachment=attachment, alignment=1, dtype="f4")
    return array
