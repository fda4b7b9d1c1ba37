"""Nothing leaks: OpenGL objects, memory, and the state of contexts that are not ours."""

from __future__ import annotations

import ctypes
import gc
import resource
import sys
from collections.abc import Callable

import moderngl
import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.targets import Targets

KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Program", "Query")
NAMES = range(1, 4000)


METHODS = (
    None,
    tl.BackFaceDepth(),
    tl.ThinLayer(),
    tl.FragmentLists(),
    tl.DepthPeeling(),
    tl.KBuffer(),
    tl.PathTraced(2),
)


def _counter(renderer: tl.Renderer) -> Callable[[], dict[str, int]]:
    """Counts living OpenGL objects by asking the driver about every name, independent of any bookkeeping of ours."""
    if renderer.gpu.context.backend == "osmesa":
        pytest.skip("glIsTexture and its kin are reached through libGL, which OSMesa does without")
    library = ctypes.CDLL("libGL.so.1")
    for kind in KINDS:
        getattr(library, f"glIs{kind}").restype = ctypes.c_ubyte

    def count() -> dict[str, int]:
        with renderer.gpu.context.current():
            return {kind: sum(getattr(library, f"glIs{kind}")(name) for name in NAMES) for kind in KINDS}

    return count


def _scene(mesh: tl.Mesh) -> tl.Scene:
    return tl.Scene([tl.Object(mesh, medium=tl.Medium(absorption=1.0))], tl.Camera.look_at((1, 2, 3), (0, 0, 0)))


def test_renders_and_resizes_leave_nothing_behind() -> None:
    mesh = Sphere().tessellate(24)
    with tl.Renderer() as renderer:
        count = _counter(renderer)

        def work(renders: int, resizes: int) -> None:
            for i in range(renders):
                renderer.render(_scene(mesh), (32, 24), METHODS[i % len(METHODS)])
            for i in range(resizes):
                renderer.render(_scene(mesh), (20 + i % 50, 20))
            renderer.render(_scene(mesh), (32, 24))
            gc.collect()
            renderer.render(_scene(mesh), (32, 24))

        work(60, 20)
        objects, memory = count(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        work(400, 50)
        assert count() == objects
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        # The peak may rise by a garbage collection's worth; a leak of one 32 x 24 frame each time would be 16 MB.
        assert grown * (1 if sys.platform != "darwin" else 1 / 1024) < 10_000


def test_density_grids_that_are_drawn_no_more_free_their_texture() -> None:
    mesh, camera = Box().tessellate(), tl.Camera.look_at((1, 2, 3), (0, 0, 0))
    with tl.Renderer() as renderer:
        count = _counter(renderer)

        def work(sizes: tuple[int, ...]) -> None:
            for size in sizes:
                grid = tl.DensityGrid(np.ones((size, size, size)))
                renderer.render(tl.Scene([tl.Object(mesh, tl.Medium(1.0), density=grid)], camera), (32, 24))
            gc.collect()

        work((2,))
        objects = count()
        work((3, 4, 5))
        assert count() == objects


def test_meshes_that_are_gone_free_their_buffers() -> None:
    with tl.Renderer() as renderer:
        count = _counter(renderer)
        keep = Box().tessellate()
        for _ in range(3):
            renderer.render(_scene(keep), (16, 16))
        objects = count()
        for _ in range(20):
            renderer.render(_scene(Sphere().tessellate(12)), (16, 16))
        gc.collect()
        renderer.render(_scene(keep), (16, 16))
        assert count() == objects


def test_closing_frees_and_a_closed_renderer_says_so() -> None:
    renderer = tl.Renderer()
    scene = _scene(Box().tessellate())
    renderer.render(scene, (8, 8))
    renderer.close()
    renderer.close()
    with pytest.raises(tl.RenderError, match="closed; create a new renderer"):
        renderer.render(scene, (8, 8))


def test_two_renderers_do_not_disturb_each_other() -> None:
    scene = _scene(Sphere().tessellate(24))
    with tl.Renderer() as one, tl.Renderer() as other:
        first = one.render(scene, (40, 30))
        second = other.render(scene, (30, 40))
        again = one.render(scene, (40, 30))
    assert second.thickness.shape == (40, 30)
    np.testing.assert_array_equal(first.thickness, again.thickness)


def test_provenance_before_the_first_frame_spoils_nothing() -> None:
    with tl.Renderer() as renderer:
        assert renderer.provenance["renderer"]
        renderer.render(_scene(Box().tessellate()), (8, 8))


def test_contexts_nest() -> None:
    scene = _scene(Sphere().tessellate(24))
    with tl.Renderer() as one, tl.Renderer() as other:
        alone = one.render(scene, (40, 30))
        with one.gpu.context.current() as gl:
            np.testing.assert_array_equal(other.render(scene, (40, 30)).thickness, alone.thickness)
            np.testing.assert_array_equal(one.render(scene, (40, 30)).thickness, alone.thickness)
            # Only with its own context current does this read what was written.
            buffer = gl.buffer(b"still here")
            assert buffer.read() == b"still here"


def test_an_adopted_context_stays_alive_and_is_used() -> None:
    with tl.Renderer() as owner:
        scene = _scene(Box().tessellate())
        with owner.gpu.context.current() as gl:
            with tl.Renderer(context=gl) as guest:
                frame = guest.render(scene, (20, 10))
                assert frame.provenance["backend"] == "adopted"
            np.testing.assert_array_equal(owner.render(scene, (20, 10)).thickness, frame.thickness)


def test_unknown_backend_and_size_are_refused(renderer: tl.Renderer) -> None:
    with pytest.raises(tl.InputError, match="backend 'vulkan'; no backend has this name; use one of egl"):
        tl.Renderer("vulkan")
    scene = _scene(Box().tessellate())
    for size in ((0, 10), (10, -1), (10.5, 10), "ab", (10,)):
        with pytest.raises(tl.InputError, match="frame size"):
            renderer.render(scene, size)  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match="samples 0; the number of samples must be a whole number"):
        renderer.render(scene, (8, 8), samples=0)
    with pytest.raises(tl.RenderError, match=r"frame size 1000000x2; this OpenGL allows at most \d+"):
        renderer.render(scene, (1_000_000, 2))


def test_a_frame_that_opengl_has_no_room_for_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise moderngl.Error("the framebuffer is not complete")

    monkeypatch.setattr(Targets, "_make", full)
    with tl.Renderer() as renderer:
        with pytest.raises(
            tl.RenderError, match=r"frame size 4000x4000; OpenGL does not have enough memory for 128 MB of pixels"
        ):
            renderer.render(_scene(Box().tessellate()), (4000, 4000))
        monkeypatch.undo()
        assert renderer.render(_scene(Box().tessellate()), (8, 8)).valid.all()
