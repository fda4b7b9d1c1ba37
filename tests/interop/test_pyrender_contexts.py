"""pyrender beside other contexts and renderers: nobody is disturbed, nothing leaks, and what fails says what to do."""

from __future__ import annotations

import copy
import ctypes
import gc
import os
import subprocess
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.interop.pyrender import backdrop_from_pyrender, load_pyrender, render, render_scene

SIZE = (48, 36)
GREEN = tl.Medium(absorption=(3.0, 0.5, 2.0))
MEDIA = {"ball": GREEN}
NAMES = range(1, 600)


def _thickness(renderer: tl.Renderer, studio: Any) -> np.ndarray:
    """Thickness of a frame that has nothing to do with pyrender."""
    scene = tl.Scene([tl.Object(studio.ball, medium=GREEN)], tl.Camera(studio.pose))
    return renderer.render(scene, SIZE).thickness


@pytest.mark.parametrize("ours_first", [True, False])
def test_renderers_of_both_kinds_live_side_by_side(pyrender: ModuleType, studio: Any, ours_first: bool) -> None:
    scene, offscreen, ours = studio.scene(), None, None
    try:
        for mine in (True, False) if ours_first else (False, True):
            if mine:
                ours = tl.Renderer()
            else:
                offscreen = pyrender.OffscreenRenderer(*SIZE)
        assert ours is not None
        assert offscreen is not None
        alone, picture = _thickness(ours, studio), offscreen.render(scene)[0]
        assert len(np.unique(picture)) > 20
        for shared in (True, False, True):
            frame = render(scene, MEDIA, SIZE, renderer=ours, shared=shared)
            assert frame.coverage.any()
            # The same scene, while pyrender's own renderer has it in its context.
            np.testing.assert_array_equal(offscreen.render(scene)[0], picture)
            np.testing.assert_array_equal(_thickness(ours, studio), alone)
    finally:
        if offscreen is not None:
            offscreen.delete()
        if ours is not None:
            ours.close()


def test_the_end_of_a_renderer_of_pyrender_is_not_that_of_others(
    pyrender: ModuleType, renderer: tl.Renderer, studio: Any
) -> None:
    """Unmended, pyrender ends the display of all: frames are wrong from then on, and new buffers fail."""
    alone = _thickness(renderer, studio)
    staying, leaving = pyrender.OffscreenRenderer(*SIZE), pyrender.OffscreenRenderer(*SIZE)
    scene = studio.scene()
    picture = staying.render(scene)[0]
    leaving.delete()
    np.testing.assert_array_equal(staying.render(scene)[0], picture)
    np.testing.assert_array_equal(_thickness(renderer, studio), alone)
    staying.delete()
    with tl.Renderer() as fresh:
        np.testing.assert_array_equal(_thickness(fresh, studio), alone)
    np.testing.assert_array_equal(_thickness(renderer, studio), alone)


def _state(scene: Any) -> Any:
    """All that a scene of pyrender is made of, down to the names that OpenGL has for it."""
    nodes = sorted(scene.nodes, key=id)
    meshes = [node.mesh for node in nodes if node.mesh is not None]
    primitives = [dict(vars(p)) for mesh in meshes for p in mesh.primitives]
    lights = [dict(vars(node.light)) for node in nodes if node.light is not None]
    poses = [scene.get_pose(node).tolist() for node in nodes]
    return copy.copy(vars(scene)), nodes, [mesh.is_visible for mesh in meshes], primitives, lights, poses


def _same(before: Any, after: Any) -> bool:
    if isinstance(before, dict):
        return before.keys() == after.keys() and all(_same(before[key], after[key]) for key in before)
    if isinstance(before, list | tuple):
        return len(before) == len(after) and all(map(_same, before, after))
    return before is after or np.array_equal(before, after)


def test_the_scene_stays_as_it_was(pyrender: ModuleType, renderer: tl.Renderer, studio: Any) -> None:
    scene = studio.scene()
    before = _state(scene)
    for shared in (True, False):
        render(scene, MEDIA, SIZE, renderer=renderer, shared=shared, flags=pyrender.RenderFlags.SHADOWS_DIRECTIONAL)
        assert _same(before, _state(scene))


@pytest.mark.parametrize("shared", [True, False])
def test_a_failure_leaves_scene_and_contexts_as_they_were(
    pyrender: ModuleType, renderer: tl.Renderer, studio: Any, monkeypatch: pytest.MonkeyPatch, shared: bool
) -> None:
    from OpenGL.error import GLError

    from translucent.interop import _pyrender_bridge as drawing

    def fail(self: Any, *_: Any) -> None:
        raise GLError(1282, description="refused on purpose")

    scene, alone = studio.scene(), _thickness(renderer, studio)
    before = _state(scene)
    with monkeypatch.context() as patch:
        patch.setattr(drawing.OpaqueRenderer, "_read_main_framebuffer", fail)
        with pytest.raises(
            tl.RenderError, match=r"drawing with pyrender; OpenGL reported an error \(.*refused on purpose"
        ):
            render(scene, MEDIA, SIZE, renderer=renderer, shared=shared)
    assert _same(before, _state(scene))
    np.testing.assert_array_equal(_thickness(renderer, studio), alone)
    assert render(scene, MEDIA, SIZE, renderer=renderer, shared=shared).coverage.any()


@pytest.mark.parametrize("shared", [True, False])
def test_the_context_that_was_current_is_so_afterwards(renderer: tl.Renderer, studio: Any, shared: bool) -> None:
    with renderer.gpu.context.current() as gl:
        render(studio.scene(), MEDIA, SIZE, renderer=renderer, shared=shared)
        # Only with its own context current does this read what was written.
        buffer = gl.buffer(b"still here")
        assert buffer.read() == b"still here"
        buffer.release()
        with tl.Renderer() as other:
            render(studio.scene(), MEDIA, SIZE, renderer=other, shared=shared)
        assert gl.error == "GL_NO_ERROR"


def test_errors_of_others_are_not_taken_for_those_of_pyrender(renderer: tl.Renderer, studio: Any) -> None:
    if renderer.gpu.context.backend != "egl":
        pytest.skip("glEnable is reached through libGL")
    with renderer.gpu.context.current():
        ctypes.CDLL("libGL.so.1").glEnable(0xFFFF)
        assert render(studio.scene(), MEDIA, SIZE, renderer=renderer, shared=True).coverage.any()


def test_what_pyrender_sets_does_not_last(pyrender: ModuleType, renderer: tl.Renderer, studio: Any) -> None:
    """Wires, of all states, would be seen in every later frame."""
    scene, alone = studio.scene(), _thickness(renderer, studio)
    with tl.Renderer() as fresh:  # or what earlier frames have left would be there to see
        wires = render(scene, MEDIA, SIZE, renderer=fresh, shared=True, flags=pyrender.RenderFlags.ALL_WIREFRAME)
        np.testing.assert_array_equal(_thickness(fresh, studio), alone)
        solid = render(scene, MEDIA, SIZE, renderer=fresh, shared=True)
    assert (wires.radiance != solid.radiance).any()


def test_an_adopted_context_is_shared_or_left_alone(studio: Any) -> None:
    with tl.Renderer() as owner, owner.gpu.context.current() as gl, tl.Renderer(context=gl) as guest:
        scene = studio.scene()
        frame = render(scene, MEDIA, SIZE, renderer=guest)
        assert frame.provenance["opaque"] == "pyrender 0.1.45 in the same OpenGL context"
        np.testing.assert_array_equal(frame.radiance, render(scene, MEDIA, SIZE, renderer=owner).radiance)
        with pytest.raises(
            tl.RenderError, match="asked for; the renderer draws in the OpenGL context of another library"
        ):
            render(scene, MEDIA, SIZE, renderer=guest, shared=False)
        ours = tl.Scene([tl.Object(studio.floor), tl.Object(studio.ball, medium=GREEN)], tl.Camera(studio.pose))
        with pytest.raises(
            tl.RenderError,
            match="this picture needs a copy; the renderer draws in the OpenGL context of another library",
        ):
            render_scene(ours, SIZE, renderer=guest)


def test_nothing_is_left_behind(pyrender: ModuleType, studio: Any) -> None:
    kinds = ("Texture", "Buffer", "Framebuffer", "Renderbuffer", "VertexArray", "Program")
    with tl.Renderer() as renderer:
        if renderer.gpu.context.backend != "egl":
            pytest.skip("glIsTexture and its kin are reached through libGL")
        library = ctypes.CDLL("libGL.so.1")
        for kind in kinds:
            getattr(library, f"glIs{kind}").restype = ctypes.c_ubyte

        def count() -> dict[str, int]:
            with renderer.gpu.context.current():
                return {kind: sum(getattr(library, f"glIs{kind}")(name) for name in NAMES) for kind in kinds}

        def work(times: int) -> None:
            for i in range(times):
                flags = pyrender.RenderFlags.SHADOWS_DIRECTIONAL if i % 2 else 0
                render(studio.scene(), MEDIA, SIZE, renderer=renderer, shared=True, flags=flags)
            gc.collect()
            _thickness(renderer, studio)

        work(4)
        objects = count()
        assert 0 < objects["Texture"] < len(NAMES) // 2
        work(12)
        assert count() == objects


@pytest.mark.parametrize("shared", [True, False])
def test_frames_that_are_too_large_are_refused(renderer: tl.Renderer, studio: Any, shared: bool) -> None:
    alone = _thickness(renderer, studio)
    with pytest.raises(
        tl.RenderError,
        match=r"frame size 1000000x2; this OpenGL allows at most \d+ pixels along a side; render the picture in parts",
    ):
        render(studio.scene(), MEDIA, (1_000_000, 2), renderer=renderer, shared=shared)
    np.testing.assert_array_equal(_thickness(renderer, studio), alone)


def test_what_is_freed_is_freed_once(
    pyrender: ModuleType, renderer: tl.Renderer, studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A renderer of pyrender frees again when it is collected: by then a name may be that of somebody else."""
    from translucent.interop._pyrender_bridge import OpaqueRenderer, opaque_part

    with renderer.gpu.context.current():
        drawing = OpaqueRenderer(SIZE)
        drawing.render(opaque_part(studio.scene(), ()), pyrender.RenderFlags.SHADOWS_DIRECTIONAL)
        drawing.delete()
        freed: list[Any] = []
        for kind in ("Framebuffers", "Renderbuffers"):
            monkeypatch.setattr(sys.modules["pyrender.renderer"], f"glDelete{kind}", lambda *names: freed.append(names))
        del drawing
    assert freed == []


def test_a_renderer_without_opengl_is_refused(pyrender: ModuleType, studio: Any) -> None:
    pytest.importorskip("embreex")
    with (
        tl.Renderer("cpu") as renderer,
        pytest.raises(
            tl.RenderError,
            match="drawing with OpenGL; this renderer works on the CPU, and has no OpenGL; use a backend other",
        ),
    ):
        render(studio.scene(), MEDIA, SIZE, renderer=renderer)


def test_pyrender_that_cannot_be_imported_is_told(uninstalled: Callable[[str], None]) -> None:
    uninstalled("pyrender")
    scene = tl.Scene([tl.Object(tl.Mesh(np.eye(3), [(0, 1, 2)]))], tl.Camera.look_at((2, 2, 2), (0, 0, 0)))
    for use in (
        lambda: render(None, MEDIA, SIZE),
        lambda: backdrop_from_pyrender(None, ["ball"], SIZE),
        lambda: render_scene(scene, SIZE),
    ):
        with pytest.raises(
            tl.RenderError, match=r"cannot be imported with .*; pip install pyrender==0\.1\.45; apt-get"
        ):
            use()


def test_another_pyrender_is_told_by_what_it_lacks(pyrender: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(pyrender.Renderer, "_read_main_framebuffer")
    monkeypatch.delattr(pyrender.Texture, "_add_to_context")
    with pytest.raises(
        tl.RenderError,
        match=r"this version of pyrender has no Renderer\._read_main_framebuffer, Texture\._add_to_context; run pip",
    ):
        load_pyrender()


def test_the_shim_mends_bounds_and_references(pyrender: ModuleType, studio: Any) -> None:
    assert np.isfinite(studio.scene().bounds).all()
    for _ in range(3):
        load_pyrender()
    if sys.version_info >= (3, 12):
        from OpenGL.plugins import FormatHandler

        assert sum(plugin.name == "ctypesreference" for plugin in FormatHandler.all()) == 1


#: A program that imports pyrender before the toolkit is asked for anything, as its users do.
PROGRAM = """
import os, sys
platform = sys.argv[1]
os.environ.pop("PYOPENGL_PLATFORM", None)
if platform:
    os.environ["PYOPENGL_PLATFORM"] = platform
import numpy as np
import pyrender
import translucent as tl
from translucent.interop.pyrender import render
from translucent.geometry.solids import Sphere
ball = Sphere().tessellate(48)
scene = pyrender.Scene()
scene.add(pyrender.Mesh([pyrender.Primitive(ball.vertices, indices=ball.faces)]), name="ball")
scene.add(pyrender.PerspectiveCamera(0.8), pose=tl.Camera.look_at((0, 0, 4), (0, 0, 0)).pose)
for shared in (True, None):
    try:
        frame = render(scene, {"ball": tl.Medium(absorption=1.0)}, (21, 21), shared=shared)
    except tl.TranslucentError as error:
        print(error)
    else:
        print(frame.provenance["opaque"], round(float(frame.thickness.max()), 1))
"""


@pytest.fixture
def program(pyrender: ModuleType) -> Callable[[str], list[str]]:
    """Runs it without a display, in a process of its own: PyOpenGL is bound for as long as a process lives."""
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}

    def run(platform: str) -> list[str]:
        command = [sys.executable, "-c", PROGRAM, platform]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.splitlines()

    return run


def test_programs_that_bind_pyopengl_to_egl_share(program: Callable[[str], list[str]]) -> None:
    assert program("egl") == ["pyrender 0.1.45 in the same OpenGL context 2.0"] * 2


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="GLX is a window system of Linux")
def test_programs_that_bind_pyopengl_to_windows_are_told(program: Callable[[str], list[str]]) -> None:
    shared, either = program("glx")
    bound = "PyOpenGL is bound to GLXPlatform, but the context of the renderer is 'egl'"
    assert shared == (
        f"sharing an OpenGL context with pyrender; {bound}; omit shared=, or bind PyOpenGL to the same "
        "window system: without a window, set PYOPENGL_PLATFORM=egl before anything imports pyrender"
    )
    assert either.startswith("drawing with pyrender in a separate OpenGL context; no such context can be created (")
    assert either.endswith("; without a window, set PYOPENGL_PLATFORM=egl before anything imports pyrender")
