"""Light paths of the CPU backend: those of the reference, whatever the bodies are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.cpu.renderer import CpuRenderer, EmbreeLightPaths
from translucent.geometry.ray_caster import RayCaster
from translucent.geometry.solids import Box, Sphere
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.surfaces import sheet_thicknesses

CAMERA = tl.Camera.look_at((2.5, 2.0, 3.5), (0.0, -0.3, 0.0))
RED = tl.Medium(absorption=(0.1, 1.0, 2.0))
BALL, BOX = Sphere().tessellate(24), Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
GROUND = tl.Object(Box((-6.0, -2.0, -6.0), (6.0, -1.0, 6.0)).tessellate())
SUN, LAMP = tl.DirectionalLight((-0.5, -1.0, -0.3), 2.0), tl.PointLight((0.5, 2.0, 0.25), 5.0)


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: float = 1.0) -> Array:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def bear() -> tl.Mesh:
    mesh = tl.load_mesh(mesh_path("bear"))
    return tl.Mesh((mesh.vertices - mesh.center) / (0.5 * mesh.diagonal), mesh.faces)


BODIES: dict[str, Any] = {
    "ball": lambda: [tl.Object(BALL, RED)],
    "opaque ball": lambda: [tl.Object(BALL)],
    "bear": lambda: [tl.Object(bear(), RED)],
    "opaque bear": lambda: [tl.Object(bear())],
    "many": lambda: [tl.Object(BALL, RED, moved(scale=0.4, x=i - 1.0, y=0.3 * j)) for i in range(3) for j in range(3)],
    "mirrored": lambda: [tl.Object(BOX, RED, np.diag((-1.0, 2.0, 0.5, 1.0)))],
    "sheet": lambda: [tl.Object(BOX, RED, sheet_thickness=0.1)],
    "open": lambda: [tl.Object(tl.Mesh(BOX.vertices, BOX.faces[1:]), RED)],
    "inside": lambda: [tl.Object(BALL, RED), tl.Object(BOX, tl.Medium(absorption=1.0), moved(scale=0.5))],
    "around the lamp": lambda: [tl.Object(BOX, RED, moved(0.5, 2.0, 0.25))],
    "far away": lambda: [tl.Object(BALL, RED, moved(1e3, 0.0, 0.0)), tl.Object(BALL)],
}


@pytest.mark.parametrize("name", BODIES)
def test_transmittance_is_that_of_the_reference(name: str) -> None:
    scene = tl.Scene([*BODIES[name](), GROUND], CAMERA, [SUN, LAMP])
    sheets = sheet_thicknesses(scene)
    meshes = {body.mesh: RayCaster(body.mesh) for body in scene.objects}
    rng = np.random.default_rng(3)
    # On the ground, a grid of places that edges and diagonals fall on, and anywhere.
    grid = np.stack(np.meshgrid(np.linspace(-3, 3, 25), [-1.0], np.linspace(-3, 3, 25)), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, rng.uniform(-1.5, 1.5, (400, 3))]) - CAMERA.eye
    up = np.tile((0.0, 1.0, 0.0), (len(points), 1))
    own, true = EmbreeLightPaths(scene, sheets, meshes), LightPaths(scene, sheets)
    for number in range(2):
        found, expected = (paths.arrival(paths.lights[number], points) for paths in (own, true))
        np.testing.assert_allclose(found.irradiance, expected.irradiance, rtol=1e-12, atol=1e-300)
        assert np.array_equal(found.sound, expected.sound)
    assert np.array_equal(SurfaceLight(own).on_opaque(points, up), SurfaceLight(true).on_opaque(points, up))


@pytest.mark.parametrize("directions", [0, 8])
def test_frames_have_the_shadows_of_the_reference(directions: int) -> None:
    scene = tl.Scene(
        [tl.Object(BALL, RED), tl.Object(BOX, transform=moved(1.5)), GROUND],
        CAMERA,
        [SUN, LAMP],
        tl.Environment.gradient(0.2, 1.0),
        environment_shadows=directions,
    )
    renderer = CpuRenderer(2)
    frame = renderer.render(tl.plan(scene, None, renderer.capabilities), (40, 30))
    truth = tl.reference.render(scene, (40, 30))
    # Float32 holds 24 bits.
    np.testing.assert_allclose(frame.radiance, truth.radiance, rtol=1e-7)
    plain = tl.reference.render(tl.Scene(scene.objects, CAMERA, [], scene.environment), (40, 30))
    assert (frame.radiance[..., 0] > 1.01 * plain.radiance[..., 0]).mean() > 0.3
