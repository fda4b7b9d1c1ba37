"""Frames of the CPU backend: those of the reference and of OpenGL, whatever the threads do."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Solid, Sphere, Torus
from tools.cpu_throughput import throughput
from translucent import threads as pool
from translucent.cpu import hits, ray_tree
from translucent.cpu import renderer as own
from translucent.cpu.renderer import CpuRenderer
from translucent.formulas.sampling import sample_shifts
from translucent.frames.frame import ARRAYS
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.plan import plan_scene
from translucent.planning.request import RenderRequest

SIZE = (48, 36)
EPS = float(np.finfo(np.float32).eps)
WINE = tl.Medium(absorption=(1.0, 2.0, 3.0))
GLOW = tl.Medium(absorption=(0.5, 0.1, 2.0), emission=(3.0, 2.0, 0.0))
CAMERA = tl.Camera.look_at((1.5, 1.2, 2.0), (0.0, 0.1, 0.0))
BALL = Sphere().tessellate(32)
BOX = Box((-0.4, -0.3, -0.6), (0.5, 0.7, 0.2))


def frame_of(scene: tl.Scene, size: tuple[int, int] = SIZE, samples: int = 1, threads: int | None = None) -> tl.Frame:
    return CpuRenderer(threads).render(plan_scene(scene, RenderRequest(samples=samples)), size)


def moved(x: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 3] = x
    return matrix


SCENES = {
    "one body": tl.Scene([tl.Object(BALL, WINE)], CAMERA),
    "two media": tl.Scene([tl.Object(BALL, WINE), tl.Object(BALL, GLOW, moved(0.7))], CAMERA),
    "union": tl.Scene([tl.Object(BALL, WINE), tl.Object(BALL, WINE, moved(0.7))], CAMERA, overlap="union"),
    "priority": tl.Scene(
        [tl.Object(BALL, WINE, priority=2), tl.Object(BALL, GLOW, moved(0.7), priority=1)], CAMERA, overlap="priority"
    ),
    "opaque": tl.Scene(
        [tl.Object(BALL, WINE), tl.Object(BOX.tessellate(), None, moved(0.9), color=(0.9, 0.5, 0.1))],
        CAMERA,
        lights=[tl.PointLight((2.0, 3.0, 1.0), (5.0, 5.0, 5.0))],
    ),
    "sheet": tl.Scene([tl.Object(BALL, WINE), tl.Object(BALL, WINE, moved(0.5), sheet_thickness=0.01)], CAMERA),
    "inside": tl.Scene([tl.Object(BALL, WINE)], tl.Camera.look_at((0.3, 0.1, 0.2), (0.0, 0.0, -1.0), fov_y=110.0)),
    "orthographic": tl.Scene(
        [tl.Object(BALL, WINE)], tl.Camera.orthographic((0.2, 0.3, 0.4), (0.0, 0.1, 0.0), height=2.5)
    ),
    "gradient": tl.Scene(
        [tl.Object(BALL, WINE)], CAMERA, environment=tl.Environment.gradient((1.0, 0.5, 0.2), (0.0, 0.1, 0.4))
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_as_the_reference(name: str) -> None:
    frame, truth = frame_of(SCENES[name]), tl.reference.render(SCENES[name], SIZE)
    for array in ("thickness", "optical_depth", "transmittance", "coverage", "valid"):
        expected = getattr(truth, array)
        found = getattr(frame, array)
        np.testing.assert_array_equal(found, expected.astype(found.dtype), err_msg=array)
    # The directions of the rays, in which the environment is looked up, may differ in their last digit.
    np.testing.assert_allclose(frame.radiance, truth.radiance, rtol=2 * EPS, atol=1e-15)


def test_arrays_and_provenance() -> None:
    frame = frame_of(SCENES["one body"], threads=3)
    for name in ARRAYS:
        array = getattr(frame, name)
        assert array.dtype == (bool if name in ("coverage", "valid") else np.float32)
        assert array.shape == (36, 48, 3) if name in ("radiance", "transmittance", "optical_depth") else (36, 48)
        assert array.flags.c_contiguous
        assert array.flags.owndata
    assert frame.provenance["backend"] == "cpu"
    assert frame.provenance["threads"] == "3"
    assert frame.provenance["embree"].startswith("4.")
    assert set(frame.provenance) == {"backend", "embreex", "embree", "threads"}
    assert set(frame.seconds) == {"prepare", "intersect", "shade", "total"}


@pytest.mark.parametrize("solid", [BOX, Sphere(), Torus()], ids=lambda solid: type(solid).__name__)
def test_analytic_solids(solid: Solid) -> None:
    segments = 96
    mesh = solid.tessellate() if isinstance(solid, Box) else solid.tessellate(segments)
    scene = tl.Scene([tl.Object(mesh, WINE)], CAMERA)
    error = np.abs(frame_of(scene).thickness - solid.chord(*CAMERA.rays(SIZE)))
    if isinstance(solid, Box):
        # One rounding, from exact chords to float32.
        assert error.max() <= EPS * mesh.diagonal
    else:
        # A face is off the surface by at most its sagitta, which a ray meets at 60 degrees or less on half of them.
        sagitta = mesh.diagonal / 4 * (1 - np.cos(np.pi / segments))
        assert np.median(error) <= 4 * sagitta


@pytest.mark.parametrize("name", ["near", "far", "inside"])
def test_as_opengl(name: str, renderer: tl.Renderer) -> None:
    mesh = tl.load_mesh(Path(__file__).parents[2] / "meshes" / "bear.ply")
    center, reach = mesh.center, mesh.diagonal
    view = np.array([0.45, 0.35, 1.0]) / np.linalg.norm([0.45, 0.35, 1.0])
    camera = {
        "near": tl.Camera.framing(mesh.vertices),
        "far": tl.Camera.look_at(center + 1e4 * reach * view, center, fov_y=np.degrees(1e-4)),
        "inside": tl.Camera.look_at(center, center + view, fov_y=100.0),
    }[name]
    scene = tl.Scene([tl.Object(mesh, tl.Medium(absorption=np.array([1.0, 2.0, 3.0]) / reach))], camera)
    frame, drawn = frame_of(scene, (128, 128)), renderer.render(scene, (128, 128))
    both = frame.valid & drawn.valid & frame.coverage & drawn.coverage
    assert both.any()
    # At silhouettes a rasterizer rounds to 1/256 of a pixel.
    assert np.count_nonzero(frame.coverage != drawn.coverage) <= 2e-4 * both.sum() + 1
    assert np.percentile(np.abs(frame.thickness - drawn.thickness)[both], 99.9) <= 1e-5 * reach
    assert np.percentile(np.abs(frame.transmittance - drawn.transmittance)[both], 99.9) <= 3e-5


def test_threads_and_pieces_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = SCENES["opaque"]
    alone = frame_of(scene, samples=2, threads=1)
    monkeypatch.setattr(hits, "BAND", 100)
    monkeypatch.setattr(own, "SURFACES", 64)
    for threads in (1, 5):
        frame = frame_of(scene, samples=2, threads=threads)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(frame, name), getattr(alone, name), err_msg=name)


@pytest.mark.skipif(sys.platform == "win32", reason="no signal to one thread")
@pytest.mark.parametrize(("where", "method"), [(own._EmbreeObject, "_candidates"), (ray_tree._Growth, "_correct")])
def test_ctrl_c_ends_the_threads_within_a_picture(monkeypatch: pytest.MonkeyPatch, where: type, method: str) -> None:
    """Its step of the work is not begun again once the picture has been interrupted."""
    real: Callable[..., Any] = getattr(where, method)
    begun = []

    def interrupted(*arguments: Any) -> Any:
        if threading.current_thread() is threading.main_thread():
            return real(*arguments)
        begun.append(method)
        if len(begun) == 1:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            assert pool._ended.get().wait(30.0)
        return real(*arguments)

    monkeypatch.setattr(where, method, interrupted)
    scene = tl.showcase(BALL, replace(WINE, ior=1.5), SIZE)
    with pytest.raises(KeyboardInterrupt):
        frame_of(scene, threads=1)
    assert begun == [method]


@pytest.mark.parametrize("samples", [4, 16, 7])
def test_samples_average_what_they_see(samples: int) -> None:
    # A pixel is 1/8 wide; the box ends within pixels, and each of its rays is 1 long.
    box = Box((-1.03, -1.045, 0.0), (0.77, 0.98, 1.0))
    camera = tl.Camera.orthographic((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), height=4.0)
    scene = tl.Scene([tl.Object(box.tessellate(), WINE)], camera)
    frame, single = frame_of(scene, (32, 32), samples), frame_of(scene, (32, 32))
    expected = np.zeros((32, 32, 3))
    for shift in sample_shifts(samples):
        x, y = np.moveaxis(camera.rays((32, 32), tuple(shift))[0][..., :2], -1, 0)
        inside = (x >= -1.03) & (x < 0.77) & (y >= -1.045) & (y < 0.98)
        expected += np.where(inside[..., None], np.exp([-1.0, -2.0, -3.0]), 1.0) / samples
    np.testing.assert_allclose(frame.transmittance, expected, atol=samples * EPS)
    np.testing.assert_allclose(frame.radiance, expected, atol=samples * EPS)
    for name in ("thickness", "optical_depth", "coverage", "valid"):
        np.testing.assert_array_equal(getattr(frame, name), getattr(single, name))


def test_open_bodies_show_sheets_where_they_do_not_balance() -> None:
    box = Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
    front = (box.vertices[box.faces][..., 2] == 0.5).all(axis=1)
    mesh = tl.Mesh(box.vertices, box.faces[~front])
    camera = tl.Camera.orthographic((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), height=1.5)
    behind = tl.Object(Box((0.0, -9.0, -2.0), (9.0, 9.0, -1.5)).tessellate(), WINE)
    frame = frame_of(tl.Scene([tl.Object(mesh, WINE), behind], camera), (30, 30))
    x, y = np.moveaxis(camera.rays((30, 30))[0][..., :2], -1, 0)
    hole = (np.abs(x) < 0.5) & (np.abs(y) < 0.5)
    np.testing.assert_array_equal(frame.valid, ~hole)
    path = np.where(hole, FALLBACK_SHEET * np.sqrt(3.0), 0.0) + np.where(x > 0, 0.5, 0.0)
    np.testing.assert_allclose(frame.thickness, path, rtol=1e-6)
    np.testing.assert_allclose(frame.transmittance, np.exp(-path[..., None] * [1.0, 2.0, 3.0]), rtol=1e-6)
    np.testing.assert_array_equal(frame.coverage, hole | (x > 0))


@pytest.mark.parametrize("scale", [1e-15, 1e12])
@pytest.mark.parametrize("absorption", [1e-30, 1e30])
def test_sizes_and_densities_beyond_float32(scale: float, absorption: float) -> None:
    mesh = tl.Mesh(scale * BALL.vertices, BALL.faces)
    medium = tl.Medium(absorption=(absorption,) * 3, emission=(1e10, 0.0, 1e-30))
    camera = tl.Camera.framing(mesh.vertices)
    frame = frame_of(tl.Scene([tl.Object(mesh, medium)], camera), (16, 16), samples=2)
    for name in ("radiance", "transmittance", "optical_depth", "thickness"):
        assert np.isfinite(getattr(frame, name)).all(), name


def test_meshes_are_kept_until_the_renderer_is_closed() -> None:
    scene = SCENES["one body"]
    renderer = CpuRenderer()
    first = renderer.render(tl.plan(scene), SIZE)
    elsewhere = replace(scene, camera=tl.Camera.look_at((3.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    again = renderer.render(tl.plan(elsewhere), SIZE)
    assert not np.array_equal(first.thickness, again.thickness)
    np.testing.assert_array_equal(renderer.render(tl.plan(scene), SIZE).thickness, first.thickness)
    renderer.close()
    renderer.close()
    with pytest.raises(tl.RenderError, match="the renderer has been closed; create a new renderer"):
        renderer.render(tl.plan(scene), SIZE)


def test_bad_size() -> None:
    with pytest.raises(tl.InputError, match="frame size"):
        frame_of(SCENES["one body"], (0, 5))


def test_throughput() -> None:
    rates = throughput(BALL, (64, 64), rounds=1)
    assert min(rates["frame"], rates["all_hits"], rates["first_hit"]) > 0
    assert 1.0 < rates["hits_per_ray"] < 2.0
    assert rates["last_resort"] < 1e-3


def test_pictures_that_take_more_memory_than_is_free_are_refused_before() -> None:
    scene = tl.showcase(Box((0, 0, 0), (1, 1, 1)).tessellate(), tl.Medium(absorption=1.0), stage="none")
    with tl.Renderer(backend="cpu") as renderer:
        for render in (renderer.render, tl.reference.render):
            with pytest.raises(tl.InputError, match="frame size 1000000x1000000; 1000000 million pixels need about"):
                render(scene, (10**6, 10**6))
