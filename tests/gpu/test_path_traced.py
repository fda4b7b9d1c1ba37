"""Random paths on the GPU: the float64 reference's picture within the noise that both tell, and furnaces."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.textured import TEXTURED
from translucent import assets
from translucent.formulas.interface import slab_reflectance, slab_transmittance
from translucent.geometry.solids import Box, Sphere
from translucent.gpu.passes import path_trace as path_tracer
from translucent.planning.passes import PassName
from translucent.reference import path_trace

Array = npt.NDArray[np.float64]

CAMERA = tl.Camera.look_at((0.4, 0.5, 6.0), (0, 0, 0), fov_y=21)
SIZE = (8, 8)
BALL, CORE = Sphere().tessellate(10), Sphere(radius=0.8).tessellate(6)
FLOOR = Box((-3.0, -3.0, -4.0), (3.0, -1.05, 4.0)).tessellate()
SUN = tl.DirectionalLight((0.3, -0.8, -0.5), 3.0)
BLACK, WHITE = (tl.Environment.constant((level,) * 3) for level in (0.0, 1.0))
SKY = tl.Environment.gradient((1.0, 0.5, 0.2), (0.1, 0.5, 1.0))
SPECTRAL = tl.Medium(0.1, (0.2, 2.0, 4.0), (0.05, 0.1, 0.2), anisotropy=0.8)
GLASS = tl.Medium((0.1, 0.3, 0.6), ior=1.5)
FROSTED = tl.Surface(roughness=0.6)
COATED = tl.Surface(
    iridescence=1.0,
    iridescence_ior=2.0,
    iridescence_thickness=3e-7,
    clearcoat=1.0,
    transmission=0.6,
    color=(0.8, 0.4, 0.3),
)


def ball(medium: tl.Medium, surface: tl.Surface | None = None, *, mesh: tl.Mesh = BALL, priority: int = 0) -> tl.Object:
    return tl.Object(mesh, medium, surface=surface, priority=priority)


#: What each shows, and how many paths the reference follows: enough for errors of a normal distribution.
SCENES = {
    "glass in a studio": (
        tl.Scene([ball(tl.Medium((0.1, 0.3, 0.6), ior=1.5))], CAMERA, [], tl.Environment.studio()),
        400,
    ),
    "frosted glass on a floor": (
        tl.Scene([ball(GLASS, FROSTED), tl.Object(FLOOR)], CAMERA, [SUN], SKY),
        80,
    ),
    "milk": (tl.Scene([ball(tl.Medium((1.0, 1.2, 1.5), 4.0, anisotropy=0.7, ior=1.4))], CAMERA, [], WHITE), 120),
    "ball in a ball": (
        tl.Scene(
            [
                ball(tl.Medium((0.1, 0.4, 0.9), ior=1.5)),
                ball(tl.Medium((1.0, 0.5, 0.1), 5.0, 0.1, ior=1.2), mesh=CORE, priority=1),
            ],
            CAMERA,
            [],
            SKY.with_background(tl.Environment.checkerboard((1.0, 0.4, 0.1), (0.1, 0.5, 0.9))),
            "priority",
        ),
        60,
    ),
    "film, coat and base": (tl.Scene([ball(GLASS, COATED)], CAMERA, [], SKY), 120),
    "film and coat on rough glass": (
        tl.Scene([ball(GLASS, replace(COATED, roughness=0.5))], CAMERA, [SUN], SKY),
        120,
    ),
    "a cloud": (tl.Scene([ball(tl.Medium(0.0, 3.0, phase=tl.WaterDroplets(2e-5)))], CAMERA, [SUN], SKY), 80),
    "two smokes, of two shapes": (
        tl.Scene(
            [ball(SPECTRAL), ball(tl.Medium(0.1, (4.0, 2.0, 0.2), phase=tl.Draine(-0.5, 10.0)), mesh=CORE)],
            CAMERA,
            [SUN, tl.PointLight((2.0, 2.0, 3.0), 8.0)],
            BLACK,
        ),
        40,
    ),
    **{name: (scene, 120) for name, scene in TEXTURED.items()},
}


def scores(difference: Array, variance: Array) -> Array:
    """(n, 3): by how many standard errors pixels differ that have any."""
    noisy = variance.min(axis=2) > 1e-12
    return np.asarray(difference[noisy] / np.sqrt(variance[noisy]))


def require_normal(found: Array) -> None:
    """Mean square of 1, and no mean: to five standard errors, of pixels whose channels are not independent."""
    count = len(found)
    assert count > 30
    assert abs(np.square(found).mean() - 1.0) < 5.0 * np.sqrt(2.0 / count)
    assert (np.abs(found.mean(axis=0)) < 5.0 / np.sqrt(count)).all()


@pytest.mark.parametrize("name", SCENES)
def test_the_picture_is_that_of_the_reference(name: str, renderer: tl.Renderer) -> None:
    scene, paths = SCENES[name]
    frame = renderer.render(scene, SIZE, tl.PathTraced(200))
    truth, error = path_trace(scene, SIZE, paths=paths, seed=1)
    assert frame.standard_error is not None
    difference = frame.radiance - truth.radiance
    variance = np.square(frame.standard_error, dtype=np.float64) + error**2
    require_normal(scores(difference, variance))
    # Where neither has noise: the background, to float32 and the texels of its map, and of maps of shadows.
    quiet = variance.max(axis=2) <= 1e-12
    assert np.abs(difference[quiet]).max(initial=0.0) < 1e-4
    assert frame.valid.all()
    assert np.median(np.abs(frame.thickness - truth.thickness)) < 1e-6 * scene.diagonal
    assert np.median(np.abs(frame.transmittance - truth.transmittance)) < 1e-5


def test_lossless_bodies_vanish_in_a_furnace(renderer: tl.Renderer) -> None:
    """Rough, in media that scatter the channels differently: what one of them loses the others gain."""
    medium = tl.Medium(0.0, (0.5, 2.0, 8.0), anisotropy=0.5, ior=1.5)
    frame = renderer.render(tl.Scene([ball(medium, FROSTED)], CAMERA, [], WHITE), SIZE, tl.PathTraced(500))
    assert frame.standard_error is not None
    require_normal(scores(frame.radiance - 1.0, np.square(frame.standard_error, dtype=np.float64)))
    assert frame.standard_error.max() < 0.1
    # Films and coats take nothing, either.
    surface = replace(FROSTED, iridescence=1.0, iridescence_ior=2.0, iridescence_thickness=3e-7, clearcoat=0.5)
    frame = renderer.render(tl.Scene([ball(medium, surface)], CAMERA, [], WHITE), SIZE, tl.PathTraced(500))
    assert frame.standard_error is not None
    require_normal(scores(frame.radiance - 1.0, np.square(frame.standard_error, dtype=np.float64)))


def test_a_room_lights_itself(renderer: tl.Renderer) -> None:
    """Walls of albedo a that emit L, and a lossless body: L / (1 - a) everywhere, of all bounces."""
    walls = tl.Surface(color=(0.5, 0.2, 0.8), ior=1.0, emissive=(1.0, 0.5, 0.25))
    room = tl.Object(Box((-3, -3, -3), (3, 3, 3)).tessellate(), surface=walls)
    camera = tl.Camera.look_at((1, 1, 2.5), (0, 0, 0))
    scene = tl.Scene([ball(tl.Medium(0.0, 3.0, ior=1.5)), room], camera, [], BLACK)
    frame = renderer.render(scene, SIZE, tl.PathTraced(300))
    np.testing.assert_allclose(frame.radiance.mean(axis=(0, 1)), (2.0, 0.625, 1.25), rtol=5e-3)


def test_opaque_surfaces_take_nothing_in_a_furnace(renderer: tl.Renderer) -> None:
    """White grounds are exact; metal and coats, but for Schlick's microfacets and the fit of their albedo."""
    wax = ball(tl.Medium(0.0, 3.0))
    looks = {1e-6: tl.Surface(ior=1.0), 0.03: tl.Surface(metallic=1.0, roughness=0.3), 0.031: tl.Surface(roughness=0.4)}
    for most, look in looks.items():
        scene = tl.Scene([wax, tl.Object(FLOOR, surface=look)], CAMERA, [], WHITE)
        frame = renderer.render(scene, SIZE, tl.PathTraced(400))
        assert abs(frame.radiance.mean() - 1.0) < most, look


def test_a_lamp_with_a_size_is_found_through_what_bends(renderer: tl.Renderer) -> None:
    """Rays to it and hits of it, none counted twice: against a ball that shines, which paths only hit."""
    lamp = tl.SphereLight.from_radiance((0.0, 2.2, 0.0), 3.0, 0.8)
    shining = tl.Surface(color=(0, 0, 0), ior=1.0, emissive=(3, 3, 3))
    globe = tl.Object(Sphere((0.0, 2.2, 0.0), 0.8).tessellate(24), surface=shining)
    walls = tl.Surface(color=(0.2, 0.2, 0.2), ior=1.0)
    grey = tl.Object(Box((-3, -3, -3), (3, 4, 3)).tessellate(), surface=walls)
    camera = tl.Camera.look_at((1.0, 0.2, 2.6), (0, -1.2, 0), fov_y=60)
    for surface in (None, FROSTED):
        glass = ball(tl.Medium(ior=1.5), surface)
        one, other = (
            renderer.render(tl.Scene([glass, grey, *more], camera, lights, BLACK), SIZE, tl.PathTraced(800))
            for more, lights in (([], [lamp]), ([globe], []))
        )
        error = [np.sqrt(np.square(f.standard_error, dtype=np.float64).mean() / 64) for f in (one, other)]
        off = one.radiance.mean(dtype=np.float64) - other.radiance.mean(dtype=np.float64)
        assert abs(off) < 4.0 * np.hypot(*error)
        assert np.hypot(*error) < 0.06 * other.radiance.mean()


def test_a_dark_pane_in_closed_form(renderer: tl.Renderer) -> None:
    """Russian roulette ends most of the little that goes through; the rest makes up for it."""
    medium = tl.Medium((3.0, 4.0, 5.0), ior=1.5)
    pane = tl.Object(Box((-50.0, -50.0, -0.5), (50.0, 50.0, 0.5)).tessellate(), medium)
    camera = tl.Camera.look_at((0, 0, 6), (0, 0, 0), fov_y=0.01)
    frame = renderer.render(tl.Scene([pane], camera, [], WHITE), (4, 4), tl.PathTraced(20_000))
    assert frame.standard_error is not None
    expected = slab_reflectance(0.04, medium.absorption) + slab_transmittance(0.04, medium.absorption)
    error = np.sqrt(np.square(frame.standard_error, dtype=np.float64).sum(axis=(0, 1))) / 16
    assert (error < 1e-3).all()
    assert (np.abs(frame.radiance.mean(axis=(0, 1)) - expected) < 4 * error).all()


def test_many_lamps_through_microfacets_are_a_furnace(renderer: tl.Renderer) -> None:
    """A lossless cube in suns from everywhere: what its microfacets turn to them adds up to what white light shows."""
    count = 30
    up, turn = 1 - (2 * np.arange(count) + 1) / count, np.pi * (1 + math.sqrt(5)) * np.arange(count)
    ways = np.stack([np.sqrt(1 - up**2) * np.cos(turn), up, np.sqrt(1 - up**2) * np.sin(turn)], axis=1)
    suns = [tl.DirectionalLight(way, 4 * np.pi / count) for way in ways]
    cube = tl.Object(Box().tessellate(), tl.Medium(ior=1.5), surface=tl.Surface(roughness=0.8))
    camera = tl.Camera.look_at((2, 3, 4), (0, 0, 0), fov_y=2)
    frame = renderer.render(tl.Scene([cube], camera, suns, BLACK), (4, 4), tl.PathTraced(6000))
    assert frame.standard_error is not None
    error = math.sqrt(np.square(frame.standard_error[..., 0], dtype=np.float64).sum()) / 16
    assert error < 0.015
    # And what the sum over so few directions is off.
    assert abs(frame.radiance[..., 0].mean() - 1.0) < 4 * error + 0.02


def test_seeds_differ_by_the_standard_error_which_falls_with_the_root_of_their_number(renderer: tl.Renderer) -> None:
    scene = SCENES["milk"][0]
    first, again, other, more = (
        renderer.render(scene, SIZE, tl.PathTraced(paths, seed))
        for paths, seed in ((100, 1), (100, 1), (100, 2), (1600, 3))
    )
    np.testing.assert_array_equal(first.radiance, again.radiance)
    errors = [np.square(frame.standard_error, dtype=np.float64) for frame in (first, other, more)]  # type: ignore[arg-type]
    require_normal(scores(first.radiance.astype(np.float64) - other.radiance, errors[0] + errors[1]))
    assert np.sqrt(errors[0].sum() / errors[2].sum()) == pytest.approx(4.0, rel=0.1)


def test_where_nothing_is_left_to_chance_one_path_tells_all(renderer: tl.Renderer) -> None:
    """Bodies that only absorb and emit, before what is black: the picture of other methods, without noise."""
    medium = tl.Medium((0.5, 1.0, 2.0), 0.0, (0.1, 0.2, 0.3))
    black = tl.Object(FLOOR, surface=tl.Surface(color=(0, 0, 0), ior=1.0, emissive=(0.2, 0.4, 0.3)))
    scene = tl.Scene([ball(medium), black], CAMERA, [SUN], tl.Environment.checkerboard())
    frame, usual = (renderer.render(scene, (24, 24), method) for method in (tl.PathTraced(64), None))
    assert frame.standard_error is not None
    # Those see faces where the rasterizer moves them, by up to 1/256 of a pixel.
    difference = np.abs(frame.radiance - usual.radiance)
    assert difference.mean() < 2e-5
    assert difference.max() < 1e-3
    assert np.abs(frame.transmittance - usual.transmittance).max() < 1e-6
    assert usual.standard_error is None
    still = renderer.render(scene, (24, 24), tl.PathTraced(64))
    assert still.standard_error is not None
    assert still.standard_error.max() < 1e-6
    assert still.seconds[PassName.PATH_TRACE] > 0.0


def test_passes_and_tiles_leave_no_trace(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths are the same however many events there are in a pass, and wherever a tile ends."""
    scene = SCENES["milk"][0]
    whole = renderer.render(scene, SIZE, tl.PathTraced(8))
    monkeypatch.setattr(path_tracer, "MOST_EVENTS", 3)
    monkeypatch.setattr(path_tracer.PathTracer.steps, "__kwdefaults__", {"seconds": 1e-9, "tile": 4})
    shares: list[float] = []
    parts = renderer.render(scene, SIZE, tl.PathTraced(8), progress=shares.append)
    np.testing.assert_array_equal(whole.radiance, parts.radiance)
    np.testing.assert_array_equal(whole.standard_error, parts.standard_error)  # type: ignore[arg-type]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) > 9


def test_loops_that_a_driver_cuts_short_are_gone_through_again(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With so many events in a pass that Mesa stops in their midst, after 65,535 turns of loops."""
    dense = tl.Medium((0.1, 0.5, 2.0), (300.0, 200.0, 100.0), anisotropy=0.8, ior=1.4)
    scene, size = tl.Scene([ball(dense)], CAMERA, [], SKY), (4, 4)
    usual = renderer.render(scene, size, tl.PathTraced(4))
    monkeypatch.setattr(path_tracer, "MOST_EVENTS", 1 << 20)
    monkeypatch.setattr(renderer.gpu.paths, "_events", 1 << 20)
    monkeypatch.setattr(path_tracer.PathTracer.steps, "__kwdefaults__", {"seconds": 1e9, "tile": path_tracer.TILE})
    cut = renderer.render(scene, size, tl.PathTraced(4))
    np.testing.assert_array_equal(usual.radiance, cut.radiance)
    assert cut.valid.all()


def test_paths_that_are_cut_short_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a limit on the random numbers of a path that light in milk exceeds."""
    shutil.copytree(assets._folder("shaders"), tmp_path / "shaders")
    file = tmp_path / "shaders" / "transport" / "path_step.glsl"
    text = file.read_text()
    file.write_text(text.replace("MOST_DRAWN = 1u << 22", "MOST_DRAWN = 40u"))
    assert file.read_text() != text
    monkeypatch.setattr(assets, "_folder", lambda kind: tmp_path / kind)
    with tl.Renderer() as renderer, pytest.warns(tl.TranslucentWarning, match="pixels are not valid"):
        frame = renderer.render(SCENES["milk"][0], SIZE, tl.PathTraced(16))
    assert 0 < np.count_nonzero(~frame.valid) <= np.count_nonzero(frame.coverage)


def test_the_truth_image(transport: ModuleType, renderer: tl.Renderer) -> None:
    """Wine in a glass, both of which bend light: only the noise that the frame states is left."""
    scene, size = transport.make("goblet_wine")
    truth = transport.load("goblet_wine")
    frame = renderer.render(scene, (size, size), tl.PathTraced(8), samples=16)
    found = transport.errors(frame.radiance, truth)
    assert frame.standard_error is not None
    mean, mask = (0.5 * (truth[0] + truth[1]))[truth[2]].mean(), truth[2]
    noise = np.sqrt(np.square(frame.standard_error[mask], dtype=np.float64).mean()) / mean
    assert found["nrmse"] == pytest.approx(noise, rel=0.1)
    # Five standard errors of the mean of all those pixels.
    assert np.abs(found["bias"]).max() < 5.0 * noise / np.sqrt(mask.sum())
