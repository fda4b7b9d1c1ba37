"""Use with pyrender, which draws opaque objects, with translucent ones shaded over them.

Without a window, set ``PYOPENGL_PLATFORM=egl`` in the environment before anything imports pyrender: PyOpenGL, which
pyrender draws with, binds itself to one window system when it is first imported, and that has to be the one of the
renderer's context. Where they differ, pyrender draws in a context of its own, and the picture is copied.

pyrender's pictures have 8 bits, which hold radiance to the power of 1 / 2.2, cut off at 1. Decoded, they are off by at
most 1.1 / 255 of white, and by less where it is darker: 0.5 / 255 * 2.2 * L^(6/11) at a radiance L. Edges are the mean
of four samples of these encoded values, as pyrender makes them.

Units are the same: a `PointLight` and a `SpotLight` of pyrender have W/sr, a `DirectionalLight` W/m^2 on a surface that
faces it, each its intensity times its color, and `ambient_light` is the radiance of a constant environment.

Stock pyrender 0.1.45 needs three fixes on today's NumPy and Python, which `load_pyrender` makes:

- NumPy 2 removed `infty`, which every bounding box of pyrender uses.
- From Python 3.12 on, ctypes references have another type name, which PyOpenGL 3.1.0 does not know: textures and
  depth-only pictures fail.
- `OffscreenRenderer.delete`, and its garbage collection, end the EGL display, which all contexts of the process share:
  other renderers die of it, some of them without an error.
"""

from __future__ import annotations

import ctypes
import dataclasses
import os
import sys
from collections.abc import Collection, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from translucent.errors import InputError, RenderError
from translucent.media.medium import Medium
from translucent.planning.methods import Method
from translucent.planning.scattering import Scattering
from translucent.scene.backdrop import Backdrop
from translucent.scene.camera import check_size
from translucent.scene.scene import Overlap, Scene

if TYPE_CHECKING:
    from translucent.frames.frame import Frame
    from translucent.renderer import Renderer


#: Private members of pyrender that are used, by class; another pyrender may lack them.
_PRIVATE = {
    "Renderer": ("_configure_forward_pass_viewport", "_read_main_framebuffer", "_configure_main_framebuffer"),
    "Primitive": ("_add_to_context", "_remove_from_context"),
    "Texture": ("_add_to_context", "_remove_from_context"),
}


def load_pyrender(backend: str | None = None) -> ModuleType:
    """Import pyrender and fix it.

    Parameters
    ----------
    backend : str, optional
        Of the renderer that it is to work with, which decides what PyOpenGL binds to, if nothing has decided before.

    Raises
    ------
    RenderError
        If pyrender or an OpenGL that it can load is missing, or it is a version of other private members.
    """
    if backend in ("egl", "osmesa") and "OpenGL" not in sys.modules:  # there is no window
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010 - type checkers know that NumPy 2 has none
    try:
        import pyrender
    except Exception as error:  # PyOpenGL raises its own kinds where a library is missing
        platform = os.environ.get("PYOPENGL_PLATFORM")
        bound = f"PYOPENGL_PLATFORM={platform}" if platform else "no PYOPENGL_PLATFORM set"
        raise RenderError(
            "drawing with pyrender",
            f"pyrender cannot be imported with {bound} ({type(error).__name__}: {error})",
            "pip install pyrender==0.1.45; apt-get install libegl1 libgl1 libgl1-mesa-dri; without a window, set "
            "PYOPENGL_PLATFORM=egl before anything imports pyrender",
        ) from error
    missing = [
        f"{kind}.{name}"
        for kind, names in _PRIVATE.items()
        for name in names
        if not hasattr(getattr(pyrender, kind), name)
    ]
    if missing:
        raise RenderError(
            f"drawing with pyrender {pyrender.__version__}",
            f"this version of pyrender has no {', '.join(missing)}",
            "run pip install pyrender==0.1.45",
        )
    _let_pyopengl_know_references()
    if os.environ.get("PYOPENGL_PLATFORM") == "egl":
        from pyrender.platforms.egl import EGLPlatform

        EGLPlatform.delete_context = _delete_context
    return pyrender  # type: ignore[no-any-return]


def _let_pyopengl_know_references() -> None:
    if sys.version_info >= (3, 12):
        from OpenGL.plugins import FormatHandler

        handler = "OpenGL.arrays.ctypesparameters.CtypesParameterHandler"
        if not any(plugin.name == "ctypesreference" for plugin in FormatHandler.all()):
            FormatHandler("ctypesreference", handler, ["_ctypes.CArgObject"])


def _delete_context(platform: Any) -> None:
    """End pyrender's context, and leave the display to the others."""
    from OpenGL.EGL import EGL_NO_CONTEXT, EGL_NO_SURFACE, eglDestroyContext, eglGetCurrentContext, eglMakeCurrent

    display, context = platform._egl_display, platform._egl_context
    if display is None or context is None:
        return
    platform._egl_display = platform._egl_context = None
    if _address(eglGetCurrentContext()) == _address(context):
        eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT)
    eglDestroyContext(display, context)


def _address(pointer: Any) -> int | None:
    return ctypes.cast(pointer, ctypes.c_void_p).value


#: What pyrender sees first is taken to be this fraction nearer: it may lie between the pixel centers.
_NEARER = 0.5


def scene_from_pyrender(
    scene: Any, media: Mapping[str, Medium], size: tuple[int, int], overlap: Overlap = "add"
) -> Scene:
    """The translucent objects of a pyrender scene, with its camera and lights.

    Parameters
    ----------
    scene : pyrender.Scene
    media : dict of str to Medium
        What fills the visible nodes of this name, or those whose mesh has it; the name of the node comes first.
    size : (width, height)
        Of the picture, in pixels, which some cameras of pyrender depend on.
    overlap : {"add", "union", "priority"}
        As for `Scene`.

    Returns
    -------
    Scene
        Meshes are welded and wound as by `load_mesh`. The environment is the background color of the pyrender scene.
        The camera's clipping planes do not clip media.

    Raises
    ------
    InputError
        If no visible node has one of the names, a mesh has points or lines, or there is no camera; if the camera
        stretches the picture, looks beside its middle, or is scaled; if the transform of a light is singular.
    RenderError
        If pyrender cannot be imported.
    """
    load_pyrender()
    from translucent.interop._pyrender_bridge import converted

    return converted(scene, media, check_size(size), overlap)


def backdrop_from_pyrender(scene: Any, translucent: Collection[str], size: tuple[int, int], flags: int = 0) -> Backdrop:
    """Opaque part of a pyrender scene as a picture, drawn by pyrender in its own OpenGL context.

    Parameters
    ----------
    scene : pyrender.Scene
        Is left as it is.
    translucent : collection of str
        Names of the nodes or meshes to leave out, as for `scene_from_pyrender`.
    size : (width, height)
        In pixels.
    flags : int
        `pyrender.RenderFlags` for shadows, culling and wireframes.

    Raises
    ------
    InputError
        If a name is unknown or a flag makes no picture.
    RenderError
        If pyrender cannot be imported, or has no OpenGL.
    """
    load_pyrender()
    from translucent.interop._pyrender_bridge import drawn_apart

    size = check_size(size)
    return drawn_apart(_opaque_part(scene, translucent, size, flags), size, flags).backdrop()


def render(
    scene: Any,
    media: Mapping[str, Medium],
    size: tuple[int, int],
    method: Method | None = None,
    samples: int = 1,
    renderer: Renderer | None = None,
    shared: bool | None = None,
    flags: int = 0,
    overlap: Overlap = "add",
) -> Frame:
    """Render a pyrender scene: pyrender draws its opaque objects, and translucent ones are shaded over them.

    Parameters
    ----------
    scene : pyrender.Scene
        Is left as it is, and may be in use by a renderer of pyrender.
    media, size, overlap
        As for `scene_from_pyrender`.
    method, samples
        As for `Renderer.render`. What pyrender draws is the same for all samples.
    renderer : Renderer, optional
        Default: a new one for this frame.
    shared : bool, optional
        True: pyrender draws in the OpenGL context of the renderer, and nothing is read back. False: in one of its own,
        and arrays are copied. None: shared where that works. ``frame.provenance["opaque"]`` says which, and why.
    flags : int
        `pyrender.RenderFlags` for shadows, culling and wireframes. Media cast colored shadows in any case: what
        pyrender draws is scaled by the fraction of its lights and `ambient_light` that they leave, in pyrender's own
        shadows, too.

    Returns
    -------
    Frame
        What pyrender blends by alpha counts as opaque where it is.

    Raises
    ------
    InputError
        As `scene_from_pyrender`, and if a flag makes no picture.
    RenderError
        If pyrender cannot be imported or has no OpenGL, or cannot share the context although it is asked to.
    """
    from translucent.renderer import Renderer

    if renderer is None:
        with Renderer() as made:
            return render(scene, media, size, method, samples, made, shared, flags, overlap)
    context = renderer.gpu.context
    pyrender = load_pyrender(context.backend)
    from translucent.interop import _pyrender_bridge as drawing

    size = check_size(size)
    ours = scene_from_pyrender(scene, media, size, overlap)
    opaque = _opaque_part(scene, media, size, flags)
    why_apart = "asked for" if shared is False else drawing.why_not_in(context)
    if why_apart is None:
        with drawing.drawn_in(context, opaque, size, flags) as textures:
            frame = renderer.render(ours, size, method, samples, textures)
        how = "in the same OpenGL context"
    else:
        _require_copying(why_apart, owned=context.owned, shared=shared)
        arrays = drawing.drawn_apart(opaque, size, flags).backdrop()
        frame = renderer.render(ours, size, method, samples, arrays)
        how = f"through arrays: {why_apart}"
    frame.provenance["opaque"] = f"pyrender {pyrender.__version__} {how}"
    return frame


def _require_copying(why: str, *, owned: bool, shared: bool | None) -> None:
    if shared:
        raise RenderError(
            "sharing an OpenGL context with pyrender",
            why,
            (
                "omit shared=, or bind PyOpenGL to the same window system: without a window, set "
                "PYOPENGL_PLATFORM=egl before anything imports pyrender"
            ),
        )
    if not owned:
        raise RenderError(
            "copying a picture from pyrender",
            (
                f"{why}; the renderer draws in the OpenGL context of another library, which pyrender's own "
                "context would replace"
            ),
            "use another renderer, or set PYOPENGL_PLATFORM for the window before anything imports pyrender",
        )


def to_pyrender(scene: Scene) -> Any:
    """The opaque objects of a scene as a pyrender scene, with its camera and lights.

    The eye is at the origin of it, since pyrender's coordinates are float32. Faces are flat and reflect alike on both
    sides. Of the environment it has the light, as the mean from everywhere, and a background without opacity. A
    sphere light is a point light there, of the same irradiance.

    Returns
    -------
    pyrender.Scene

    Raises
    ------
    InputError
        If nothing is opaque, or there are more lights of a kind than pyrender draws with.
    RenderError
        If pyrender cannot be imported.
    """
    load_pyrender()
    from translucent.interop._pyrender_bridge import written

    _require_opaque(scene)
    return written(scene)


def render_scene(
    scene: Scene,
    size: tuple[int, int],
    method: Method | None = None,
    samples: int = 1,
    renderer: Renderer | None = None,
    scattering: Scattering | None = None,
) -> Frame:
    """Render a scene of the toolkit, whose opaque objects pyrender draws.

    They reflect as pyrender's rough dielectrics do. The environment is seen behind them.

    Parameters
    ----------
    scene : Scene
        With at least one opaque object.
    size, method, samples
        As for `Renderer.render`.
    renderer : Renderer, optional
        Default: a new one for this frame.
    scattering
        As for `Renderer.render`.

    Raises
    ------
    InputError
        As `to_pyrender` and `Renderer.render`.
    RenderError
        If pyrender cannot be imported or has no OpenGL.
    """
    from translucent.renderer import Renderer

    if renderer is None:
        with Renderer() as made:
            return render_scene(scene, size, method, samples, made, scattering)
    _require_opaque(scene)
    context = renderer.gpu.context
    _require_copying("this picture needs a copy", owned=context.owned, shared=None)
    pyrender = load_pyrender(context.backend)
    from translucent.interop._pyrender_bridge import drawn_apart, written

    size = check_size(size)
    picture = drawn_apart(written(scene), size, 0)
    # Depth has most of its digits near the camera: once that is known, it need not begin at the eye.
    nearest = float(picture.depth.min())
    if scene.camera.fov_y is not None and np.isfinite(nearest):
        picture = drawn_apart(written(scene, _NEARER * nearest), size, 0)
    backdrop = picture.before(scene.environment, scene.camera)
    bodies = dataclasses.replace(scene, objects=scene.bodies)
    frame = renderer.render(bodies, size, method, samples, backdrop, scattering=scattering)
    frame.provenance["opaque"] = f"pyrender {pyrender.__version__} through arrays"
    return frame


def _require_opaque(scene: Scene) -> None:
    if not scene.opaque:
        names = ", ".join(repr(body.mesh.name) for body in scene.bodies)
        raise InputError(
            "drawing opaque objects with pyrender",
            f"all nodes have a medium, so no opaque node is left: {names}",
            "render without pyrender",
        )


def _opaque_part(scene: Any, translucent: Collection[str], size: tuple[int, int], flags: int) -> Any:
    """Check the scene that pyrender is to draw."""
    from translucent.interop._pyrender_bridge import PICTURE_FLAGS, camera_of, opaque_part, translucent_nodes

    if flags & ~PICTURE_FLAGS:
        raise InputError(
            f"pyrender flags {flags}",
            (
                f"the flags {flags & ~PICTURE_FLAGS} do not concern shadows of directional or spot lights, "
                "culling or wireframes"
            ),
            "omit these flags",
        )
    hidden = [node for node, _ in translucent_nodes(scene, translucent)]
    camera_of(scene, size)
    return opaque_part(scene, hidden)
