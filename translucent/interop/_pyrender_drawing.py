"""Drawing of opaque objects by pyrender: in the context of a renderer, or in one of its own. Import it by the shim
only.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenGL.platform
import pyrender
from OpenGL import GL
from OpenGL.error import Error as OpenGLError

from translucent.errors import RenderError
from translucent.gpu.context import GpuContext
from translucent.gpu.job import TextureBackdrop
from translucent.interop._pyrender_scenes import GAMMA, Clipping, PyrenderPicture, ambient_of

Flags = pyrender.RenderFlags

#: Flags that change which fragments there are.
_SHAPE_FLAGS = Flags.SKIP_CULL_FACES | Flags.ALL_WIREFRAME | Flags.FLIP_WIREFRAME | Flags.ALL_SOLID
#: All flags that make a picture, without shadows of point lights, which pyrender lacks.
PICTURE_FLAGS = _SHAPE_FLAGS | Flags.SHADOWS_DIRECTIONAL | Flags.SHADOWS_SPOT


class OpaqueRenderer(pyrender.Renderer):  # type: ignore[misc]
    """Renderer of pyrender, with depth at the pixel centers.

    Colors are the mean of four samples, as ever. Of these, pyrender's own depth map has the depth of the first, which
    lies up to half a pixel off the ray that media are shaded along.

    Parameters
    ----------
    size : (width, height)
    target : int, optional
        Name of the framebuffer to draw into, with RGBA8 colors and 24 bits of depth. Default: one of its own.
    """

    def __init__(self, size: tuple[int, int], target: int | None = None) -> None:
        super().__init__(*size)
        self.dpscale = 1  # no two pixels for one on macOS
        self.viewport_width, self.viewport_height = size
        self._target = target
        self._at_centers = False

    def render(self, scene: Any, flags: int, seg_node_map: Any = None) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Draw; the encoded colors and depth, row 0 at the top, of the framebuffer of its own, else nothing."""
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)  # rows of pyrender's textures have no padding
        # Colors come from the second pass; those of the first are the quickest to have.
        self._at_centers = True
        super().render(scene, (flags & _SHAPE_FLAGS) | Flags.FLAT | Flags.OFFSCREEN)
        self._at_centers = False
        super().render(scene, flags | Flags.OFFSCREEN)
        return self._read() if self._target is None else (np.empty(0), np.empty(0))

    def delete(self) -> None:
        """Free all OpenGL objects, in their context."""
        super().delete()
        self._shadow_fb = None  # or it is freed again with the renderer, when the name may be that of somebody else

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        if self._at_centers:
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._framebuffer)

    def _read_main_framebuffer(self, scene: Any, flags: int) -> None:
        if not self._at_centers:
            corners = (0, 0, self.viewport_width, self.viewport_height)
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._framebuffer)
            GL.glBlitFramebuffer(*corners, *corners, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)

    @property
    def _framebuffer(self) -> int:
        return self._main_fb if self._target is None else self._target

    def _read(self) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        shape = self.viewport_height, self.viewport_width
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._framebuffer)
        area = (0, 0, self.viewport_width, self.viewport_height)
        depth = np.frombuffer(GL.glReadPixels(*area, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT), np.float32)
        colors = np.frombuffer(GL.glReadPixels(*area, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE), np.uint8)
        return colors.reshape(*shape, 4)[::-1], depth.reshape(shape)[::-1]


def why_not_in(context: GpuContext) -> str | None:
    """Reason why pyrender cannot draw in this OpenGL context; None if it can."""
    with context.current() as gl:
        _forget_errors(gl)
        # PyOpenGL sees only contexts of the window system that it is bound to.
        if OpenGL.platform.GetCurrentContext() and GL.glGenVertexArrays:
            return None
    bound = type(OpenGL.platform.PLATFORM).__name__
    return f"PyOpenGL is bound to {bound} since it was imported, and the renderer's context is {context.backend!r}"


@contextmanager
def drawn_in(context: GpuContext, scene: Any, size: tuple[int, int], flags: int) -> Iterator[TextureBackdrop]:
    """Draw in the context of a renderer, for as long as the textures are needed there."""
    with context.current() as gl:
        _forget_errors(gl)
        _require_room(size)
        color, depth = gl.texture(size, 4), gl.depth_texture(size)
        depth.compare_func = ""  # is read, not compared with
        framebuffer = gl.framebuffer([color], depth)
        try:
            framebuffer.use()  # with all of its masks and without a scissor
            _forget_errors(gl)
            with _as_render_error():
                _draw(OpaqueRenderer(size, framebuffer.glo), scene, flags)
            clipping = Clipping.of(scene)
            yield TextureBackdrop(
                color, depth, clipping.near, clipping.far, clipping.orthographic, GAMMA, ambient_of(scene)
            )
        finally:
            for resource in (framebuffer, color, depth):
                resource.release()


def _forget_errors(gl: Any) -> None:
    """Clear errors of OpenGL that others, such as moderngl when it builds programs, left behind."""
    while gl.error != "GL_NO_ERROR":
        pass


def _draw(renderer: OpaqueRenderer, scene: Any, flags: int) -> None:
    try:
        renderer.render(scene, flags)
    finally:
        renderer.delete()
        GL.glBindVertexArray(0)
        GL.glUseProgram(0)
        GL.glPolygonMode(GL.GL_FRONT_AND_BACK, GL.GL_FILL)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 4)
        for state in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE, GL.GL_BLEND, GL.GL_PROGRAM_POINT_SIZE):
            GL.glDisable(state)


def drawn_apart(scene: Any, size: tuple[int, int], flags: int) -> PyrenderPicture:
    """Draw in a context that pyrender makes for itself, and read the picture back."""
    with _current_kept():
        offscreen = _offscreen(size)
        with _as_render_error():
            try:
                _require_room(size)
                offscreen._renderer = OpaqueRenderer(size)
                colors, depth = offscreen.render(scene, flags)
            finally:
                offscreen.delete()
    return PyrenderPicture(colors, Clipping.of(scene).metres(depth), ambient_of(scene))


def _offscreen(size: tuple[int, int]) -> Any:
    try:
        return pyrender.OffscreenRenderer(*size)
    except Exception as error:  # each of the window systems raises its own kinds
        raise RenderError(
            "drawing with pyrender in a context of its own",
            f"there is none ({type(error).__name__}: {error})",
            "without a window, set PYOPENGL_PLATFORM=egl before anything imports pyrender",
        ) from error


def _require_room(size: tuple[int, int]) -> None:
    limit = int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE))
    if max(size) > limit:
        raise RenderError(
            f"frame size {size[0]}x{size[1]}", f"this OpenGL ends at {limit}", "render in parts, or smaller"
        )


@contextmanager
def _as_render_error() -> Iterator[None]:
    try:
        yield
    except RenderError:
        raise
    except (OpenGLError, RuntimeError) as error:  # of shaders that do not compile or fit, the second
        raise RenderError(
            "drawing with pyrender",
            f"OpenGL refused ({' '.join(str(error).split())})",
            "leave out flags for shadows, which fail with textures on some drivers",
        ) from error


@contextmanager
def _current_kept() -> Iterator[None]:
    """Context manager that restores the current EGL context: pyrender leaves its own, or none."""
    if os.environ.get("PYOPENGL_PLATFORM") != "egl":
        yield  # pyrender leaves windows as it should
        return
    from OpenGL import EGL

    display, context = EGL.eglGetCurrentDisplay(), EGL.eglGetCurrentContext()
    surfaces = [EGL.eglGetCurrentSurface(which) for which in (EGL.EGL_DRAW, EGL.EGL_READ)]
    try:
        yield
    finally:
        if context:
            EGL.eglMakeCurrent(display, *surfaces, context)
