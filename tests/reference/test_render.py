"""Frames of the reference against closed forms."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import numpy.typing as npt
import pytest

from tests.solids import Box, Solid, Sphere, SphericalShell, Torus, TwoSpheres
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.frames.frame import ARRAYS
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.planning.methods import BackFaceDepth
from translucent.reference import hit_counts, line_hits, pixel_rays, render, shade_hits
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene

Array = npt.NDArray[np.float64]
MEDIUM = Medium(absorption=(1.0, 2.0, 3.0))
SIZE = (48, 32)
TWO_SPHERES = TwoSpheres(Sphere((-1.5, 0.0, 0.0), 1.0), Sphere((1.5, 0.0, 0.0), 1.0))
BOX = Box((-0.4, -0.3, -0.6), (0.5, 0.7, 0.2))


def scene(mesh: Mesh, camera: Camera, transform: Array | None = None) -> Scene:
    return Scene([Object(mesh, MEDIUM, transform)], camera)


def chords(solid: Solid, camera: Camera, size: tuple[int, int] = SIZE) -> Array:
    return solid.chord(*camera.rays(size))


CAMERAS = {
    "perspective": Camera.look_at((1.5, 1.2, 2.0), (0.0, 0.1, 0.0)),
    "wide": Camera.look_at((0.7, 0.8, 0.5), (0.0, 0.1, 0.0), fov_y=150.0),
    "orthographic": Camera.orthographic((1.5, 1.2, 2.0), (0.0, 0.1, 0.0), height=1.5),
    "inside": Camera.look_at((0.1, 0.2, -0.1), (0.5, 0.3, 0.4), fov_y=120.0),
    "inside, orthographic": Camera.orthographic((0.1, 0.2, -0.1), (0.5, 0.3, 0.4), height=3.0),
    "at a corner": Camera.look_at((0.5, 0.7, 0.2), (0.0, 0.0, 0.0), fov_y=100.0),
    "flat on a face": Camera.look_at((0.1, 0.2, 0.2), (0.1, 0.2, -1.0), fov_y=100.0),
    "on a face": Camera.look_at((0.1, 0.2, 0.2), (0.13, 0.24, -1.0), fov_y=100.0),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_box_is_exact(name: str) -> None:
    frame = render(scene(BOX.tessellate(), CAMERAS[name]), SIZE)
    expected = chords(BOX, CAMERAS[name])
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness, expected, atol=1e-12)
    np.testing.assert_array_equal(frame.coverage, frame.thickness > 0)
    np.testing.assert_allclose(frame.optical_depth, expected[..., None] * [1, 2, 3], atol=1e-11)
    np.testing.assert_allclose(frame.transmittance, np.exp(-expected[..., None] * [1, 2, 3]), atol=1e-11)


@pytest.mark.parametrize("diameters", [1e2, 1e4, 1e6])
def test_far_away(diameters: float) -> None:
    direction = np.array([0.6, 0.3, 0.74])
    camera = Camera.look_at(diameters * direction, (0, 0, 0), fov_y=float(np.degrees(1.8 / diameters)))
    frame = render(scene(BOX.tessellate(), camera), SIZE)
    assert frame.valid.all()
    assert 0.2 < frame.coverage.mean() < 1
    # Rays and distances are known to a few units in the last place of the distance.
    np.testing.assert_allclose(frame.thickness, chords(BOX, camera), atol=20 * diameters * np.finfo(float).eps)


@pytest.mark.parametrize("solid", [Sphere(), SphericalShell(), Torus(), TWO_SPHERES], ids=lambda s: type(s).__name__)
@pytest.mark.parametrize(
    "eye", [(2.0, 3.0, 2.5), (0.1, 0.05, 0.02), (0.9, 0.2, 0.1)], ids=["outside", "middle", "wall"]
)
def test_solids_converge(solid: Solid, eye: tuple[float, float, float]) -> None:
    """In the middle of a shell or ring the eye is in the cavity; at the wall within the body."""
    camera = Camera.look_at(eye, (1.5, 0.2, -0.3), fov_y=70.0)
    truth = chords(solid, camera)
    errors = []
    for segments in (32, 128):
        frame = render(scene(solid.tessellate(segments), camera), SIZE)
        assert frame.valid.all()
        errors.append(np.median(np.abs(frame.thickness - truth)[truth > 0]))
    assert errors[1] < errors[0] / 12, "second order: 16 times better"


def test_mean_thickness_is_volume() -> None:
    mesh = Torus().tessellate(64)
    for up in ((0, 1, 0), (0.3, 1, 0.2)):
        camera = Camera.orthographic((2.0, 1.0, 3.0), (0, 0, 0), up, height=2.8)
        frame = render(scene(mesh, camera), (280, 280))
        assert frame.thickness.sum() * 0.01**2 == pytest.approx(mesh.volume, rel=3e-4)
    camera = Camera.orthographic((0.0, 0.0, 3.0), (0, 0, 0), height=2.1)
    frame = render(scene(Sphere().tessellate(256), camera), (420, 420))
    assert frame.thickness.sum() * 0.005**2 == pytest.approx(4 / 3 * np.pi, rel=5e-4)


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
TURN = TURN * np.sign(np.linalg.det(TURN))


@pytest.mark.parametrize("scale", [(0.5, 1.0, 1.7), (-0.5, 1.0, 1.7), (-1.0, -1.0, -1.0)])
@pytest.mark.parametrize("inverted", [False, True])
def test_transforms_equal_transformed_vertices(scale: tuple[float, float, float], inverted: bool) -> None:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN * scale, (0.1, -0.2, 0.3)
    mesh = Torus(0.7, 0.2).tessellate(24)
    moved = Mesh(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces[:, :: -1 if np.prod(scale) < 0 else 1])
    given = Mesh(mesh.vertices, mesh.faces[:, ::-1]) if inverted else mesh
    for camera in (Camera.look_at((1.0, 2.0, 2.0), (0, 0, 0)), Camera.look_at((0.1, -0.1, 0.3), (1, 0, 0), fov_y=120)):
        a, b = render(scene(given, camera, matrix), SIZE), render(scene(moved, camera), SIZE)
        assert a.valid.all()
        assert a.coverage.any()
        np.testing.assert_allclose(a.thickness, b.thickness, atol=1e-12)


def test_a_place_far_from_the_world_origin() -> None:
    shift = np.array([148376.0, 1234.0, -223423.0])
    matrix = np.eye(4)
    matrix[:3, 3] = shift
    mesh, eye = Sphere().tessellate(32), np.array([1.5, 0.75, 2.25])
    near = render(scene(mesh, Camera.look_at(eye, (0, 0, 0))), SIZE)
    camera = Camera.look_at(eye + shift, shift)
    np.testing.assert_array_equal(render(scene(mesh, camera, matrix), SIZE).thickness, near.thickness)
    moved = render(scene(Mesh(mesh.vertices + shift, mesh.faces), camera), SIZE)
    assert moved.valid.all()
    np.testing.assert_allclose(moved.thickness, near.thickness, atol=2e-9)  # vertices were rounded to 3e-11


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units(unit: float) -> None:
    camera = Camera.look_at(np.array((1.5, 1.2, 2.0)) * unit, (0, 0, 0))
    box = Box((-unit, -unit, -unit), (unit, unit, unit))
    frame = render(Scene([Object(box.tessellate(), Medium(absorption=1 / unit))], camera), SIZE)
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness, chords(box, camera), atol=1e-12 * unit)


@pytest.mark.parametrize("defect", ["hole", "flipped"])
def test_a_defect_is_invalid_only_where_it_shows(defect: str) -> None:
    mesh = Box().tessellate()
    faces = mesh.faces.copy()
    side = np.flatnonzero((mesh.vertices[faces][..., 2] == 0.5).all(axis=1))[0]
    if defect == "hole":
        faces = np.delete(faces, side, axis=0)
    else:
        faces[side] = faces[side, ::-1]
    camera = Camera.orthographic((0.0, 0.0, 2.0), (0, 0, 0), height=1.2)
    frame = render(scene(Mesh(mesh.vertices, faces), camera), (64, 64))
    covered = render(scene(mesh, camera), (64, 64)).coverage
    assert (~frame.valid).mean() == pytest.approx(0.5 / 1.2**2, rel=0.05)
    np.testing.assert_array_equal(frame.coverage, covered)
    np.testing.assert_array_equal(frame.thickness[frame.valid & frame.coverage], 1.0)
    away = Camera.look_at((0.0, 0.0, 2.0), (0, 0, 4.0))
    assert render(scene(Mesh(mesh.vertices, faces), away), (8, 8)).valid.all()


def test_a_part_wound_inwards_is_invalid() -> None:
    two = TwoSpheres(Sphere((-1.5, 0, 0), 1.0), Sphere((1.5, 0, 0), 0.5)).tessellate(32)
    faces = two.faces.copy()
    right = (two.vertices[faces][..., 0] > 0).all(axis=1)
    faces[right] = faces[right, ::-1]
    frame = render(scene(Mesh(two.vertices, faces), Camera.orthographic((0, 0, 4), (0, 0, 0), height=3.0)), (64, 32))
    assert frame.valid[:, :32].all()
    np.testing.assert_array_equal(frame.valid[:, 32:], ~(frame.coverage[:, 32:]))
    assert (frame.thickness >= 0).all()


def test_media_add_up_and_nested_bodies_hold_the_eye() -> None:
    inner, outer = Box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)), Box((-1, -1, -1), (1, 1, 1))
    wine, glass = Medium(absorption=(1, 4, 2)), Medium(absorption=(0.1, 0.1, 0.3))
    camera = Camera.look_at((0.05, 0.1, 0.0), (1, 0.3, 0.2), fov_y=90)
    frame = render(Scene([Object(inner.tessellate(), wine), Object(outer.tessellate(), glass)], camera), SIZE)
    a, b = chords(inner, camera), chords(outer, camera)
    assert frame.valid.all()
    np.testing.assert_allclose(frame.thickness, a + b, atol=1e-12)
    expected = a[..., None] * wine.extinction + b[..., None] * glass.extinction
    np.testing.assert_allclose(frame.optical_depth, expected, atol=1e-12)


def test_radiance_is_backdrop_and_emission() -> None:
    glow = Medium(absorption=(1.0, 0.0, 40.0), emission=(0.3, 0.2, 0.1))
    environment = Environment.checkerboard((0.0, 0.1, 0.2), (1.0, 0.9, 0.8), tiles=4)
    camera = CAMERAS["perspective"]
    frame = render(Scene([Object(BOX.tessellate(), glow)], camera, environment=environment), SIZE)
    row, column = np.indices(SIZE[::-1])
    second = ((row // 8 + column // 8) % 2)[..., None]
    d = chords(BOX, camera)[..., None]
    behind = np.where(second, (1.0, 0.9, 0.8), (0.0, 0.1, 0.2))
    with np.errstate(under="ignore"):
        expected = behind * np.exp(-glow.extinction * d) + optics.emitted_radiance(glow.emission, glow.extinction, d)
    np.testing.assert_allclose(frame.radiance, expected, atol=1e-12)
    np.testing.assert_allclose(frame.radiance[..., 1], (behind + 0.2 * d)[..., 1], atol=1e-12)


def test_hit_counts() -> None:
    shell = SphericalShell().tessellate(32)
    outside = scene(shell, Camera.look_at((0.1, 0.2, 4), (0, 0, 0)))
    assert set(np.unique(hit_counts(outside, SIZE))) == {0, 2, 4}
    assert (hit_counts(scene(shell, Camera.look_at((0.1, 0.2, 0), (0, 0, 1))), SIZE) == 2).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (300, 1)])
def test_frame_is_complete(size: tuple[int, int]) -> None:
    frame = render(scene(Sphere().tessellate(16), Camera.look_at((0, 0, 4), (0, 0, 0))), size, BackFaceDepth())
    for name in ARRAYS:
        array = getattr(frame, name)
        assert array.shape[:2] == size[::-1]
        assert array.flags.c_contiguous
        assert array.dtype == (bool if name in ("coverage", "valid") else np.float64)
    assert frame.plan.exact
    assert frame.seconds["total"] > 0
    assert frame.provenance["backend"] == "reference"


def test_what_cannot_be_rendered_is_refused() -> None:
    camera = Camera.look_at((0, 0, 4), (0, 0, 0))
    with pytest.raises(InputError, match="frame size"):
        render(scene(Sphere().tessellate(8), camera), (0, 4))


def test_a_picture_in_parts_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    glow = Medium(absorption=1.0, emission=(0.3, 0.2, 0.1))
    bodies = [Object(BOX.tessellate(), glow), Object(Torus().tessellate(24), MEDIUM), Object(Sphere().tessellate(8))]
    whole_scene = Scene(bodies, CAMERAS["perspective"])
    whole = render(whole_scene, SIZE)
    for most in (1, 40, 1000):
        monkeypatch.setattr(import_module("translucent.reference.render"), "CHUNK", most)
        parts = render(whole_scene, SIZE)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


def test_any_rays_can_be_shaded_alone() -> None:
    body = scene(BOX.tessellate(), CAMERAS["orthographic"])
    frame, rays = render(body, SIZE), pixel_rays(body.camera, SIZE)
    chosen = np.arange(5, len(rays), 7)
    line = line_hits(body.objects[0].mesh, body.objects[0].matrix, body.camera, SIZE)
    own = line.where(np.isin(line.pixel, chosen))
    renumbered = replace(own, pixel=np.searchsorted(chosen, own.pixel), barycentric=np.zeros((len(own.pixel), 3)))
    found = shade_hits(body, rays.where(chosen), [renumbered], [None])
    assert tuple(found) == ARRAYS
    for name in ARRAYS:
        array = getattr(frame, name)
        np.testing.assert_array_equal(found[name], array.reshape(-1, *array.shape[2:])[chosen])


@pytest.mark.parametrize("name", ["perspective", "orthographic"])
def test_rays_are_those_of_the_camera_seen_from_the_eye(name: str) -> None:
    camera, offset = CAMERAS[name], (0.25, -0.125)
    rays = pixel_rays(camera, SIZE, offset)
    origins, directions = (array.reshape(-1, 3) for array in camera.rays(SIZE, offset))
    np.testing.assert_array_equal(rays.directions, directions)
    np.testing.assert_allclose(rays.origins + camera.eye, origins, atol=1e-15)
    np.testing.assert_allclose(rays.backdrop[SIZE[0] * 3 + 5] * SIZE[1], [5.75, 3.375], rtol=1e-15)
