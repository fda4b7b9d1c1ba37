"""Textures to draw into, made when a plan first needs them and kept while the frame size stays."""

from __future__ import annotations

import moderngl

from translucent.errors import RenderError

Size = tuple[int, int]


class Targets:
    """Framebuffers of one frame size, by what they hold."""

    def __init__(self, gl: moderngl.Context, size: Size) -> None:
        limit = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise RenderError(
                f"frame size {size[0]}x{size[1]}", f"this OpenGL ends at {limit}", "render in parts, or smaller"
            )
        self._gl = gl
        self.size = size
        self._framebuffers: dict[str, moderngl.Framebuffer] = {}

    def path_and_count(self, spectral: bool, name: str = "accumulated") -> moderngl.Framebuffer:
        """Where thickness passes add up: RG32F (path, count), or RGBA32F (optical depth, count) and R32F (path)."""
        return self._get(f"{name}-{spectral}", (4, 1) if spectral else (2,))

    def nearest_and_farthest(self) -> moderngl.Framebuffer:
        """RGBA32F: nearest front face, farthest back face, nothing, number of faces."""
        return self._get("nearest_and_farthest", (4,))

    def result(self) -> moderngl.Framebuffer:
        """What a frame holds: radiance, transmittance, optical depth (RGBA32F), thickness (R32F) and flags (R8)."""
        return self._get("result", (4, 4, 4, 1, -1))

    def average(self) -> moderngl.Framebuffer:
        """RGBA32F radiance and transmittance, summed over the samples of a pixel."""
        return self._get("average", (4, 4))

    def depth_only(self) -> moderngl.Framebuffer:
        """A depth buffer and nothing else."""
        if "depth_only" not in self._framebuffers:
            self._framebuffers["depth_only"] = self._gl.framebuffer(depth_attachment=self._gl.depth_texture(self.size))
        return self._framebuffers["depth_only"]

    def bytes_per_pixel(self) -> int:
        """Bytes that the color targets in use take for each pixel."""
        textures = [t for f in self._framebuffers.values() for t in f.color_attachments]
        return sum(t.components * (1 if t.dtype == "f1" else 4) for t in textures)

    def _get(self, name: str, components: tuple[int, ...]) -> moderngl.Framebuffer:
        if name not in self._framebuffers:
            try:
                self._framebuffers[name] = self._make(components)
            except moderngl.Error as error:
                megabytes = sum(4 * abs(count) for count in components) * self.size[0] * self.size[1] / 1e6
                raise RenderError(
                    f"frame size {self.size[0]}x{self.size[1]}",
                    f"OpenGL has no room for {megabytes:.0f} MB of it ({error})",
                    "render in parts, or smaller",
                ) from error
        return self._framebuffers[name]

    def _make(self, components: tuple[int, ...]) -> moderngl.Framebuffer:
        attachments = [
            self._gl.texture(self.size, abs(count), dtype="f4" if count > 0 else "f1") for count in components
        ]
        for texture in attachments:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return self._gl.framebuffer(attachments)

    def release(self) -> None:
        """Free all textures and framebuffers."""
        for framebuffer in self._framebuffers.values():
            for attachment in framebuffer.color_attachments:
                attachment.release()
            if framebuffer.depth_attachment is not None:
                framebuffer.depth_attachment.release()
            framebuffer.release()
        self._framebuffers.clear()
