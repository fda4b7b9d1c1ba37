"""Scenes in which light travels between objects: grounds and bodies, nested bodies, leaves, fog and emission.

Their truth is made of random paths (`PathTraced`), which agree with Mitsuba 3 on such scenes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from translucent.bench.shapes import placed
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere, SphericalShell, Torus
from translucent.media.medium import Medium
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight
from translucent.scene.scene import Light, Object, Overlap, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Directions of the environment that throw shadows.
SHADOWS = 64

#: Skies: bright and dim, above a ground.
DAY = Environment.gradient((0.3, 0.28, 0.25), (1.1, 1.2, 1.4))
DUSK = Environment.gradient((0.1, 0.1, 0.1), (0.3, 0.33, 0.4))

#: Colors of a ground, and of the squares of a cube.
GREY, WHITE = (0.55, 0.52, 0.48), (0.85, 0.85, 0.85)
DARK, LIGHT = (0.05, 0.08, 0.3), (0.9, 0.85, 0.6)

WAX = Medium((0.05, 0.12, 0.35), (7.0, 6.5, 5.5), anisotropy=0.3, ior=1.44)
GLASS = Medium((0.05, 0.02, 0.04), ior=1.5)


def _ball(radius: float = 1.0, center: Sequence[float] = (0.0, 1.01, 0.0), segments: int = 48) -> Mesh:
    return Sphere(radius=radius, center=(center[0], center[1], center[2])).tessellate(segments)


def _ground(color: Sequence[float], height: float = 0.0) -> Object:
    """Flat square of 8 m."""
    corners = np.array([(-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)], dtype=np.float64)
    return Object(
        Mesh(corners + (0, height, 0), np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32), name="ground"),
        color=tuple(color),
    )


def _scene(
    objects: Sequence[Object], lights: Sequence[Light] = (), environment: Environment = DAY, overlap: Overlap = "add"
) -> Scene:
    """Objects of about two metres, from the front, a little to the side and above."""
    camera = Camera.look_at((0.5, 1.8, 4.8), (0.0, 0.95, 0.0), fov_y=32.0)
    shadows = SHADOWS if any(item.medium is None for item in objects) else 0
    return Scene(list(objects), camera, lights, environment, overlap, environment_shadows=shadows)


def wax_on_white() -> Scene:
    """Ball of wax on a white ground under a sky."""
    return _scene([Object(_ball(), WAX), _ground(WHITE)])


def matched_wax_in_the_sun() -> Scene:
    """Ball of wax without an interface on a gray ground, in the sun."""
    sun = DirectionalLight((-0.5, -0.7, -0.45), 3.0)
    medium = Medium(WAX.absorption, WAX.scattering, anisotropy=0.3)
    return _scene([Object(_ball(), medium), _ground(GREY)], [sun], DUSK)


def fog_ahead() -> Scene:
    """Ball of fog before the sun, six mean free paths thick."""
    fog = Medium((0.03,) * 3, (2.97,) * 3, anisotropy=0.85)
    return _scene([Object(_ball(), fog)], [DirectionalLight((0.25, -0.2, 1.0), 3.0)], DUSK)


def leaf() -> Scene:
    """Bent leaf before a bright part of the sky, three mean free paths thick in the middle."""
    ball = Sphere().tessellate(64)
    x, y, z = ball.vertices.T
    vertices = np.stack([0.6 * x, 0.015 * y + 0.18 * np.sin(1.2 * x) + 0.12 * z, z], axis=1)
    medium = Medium((8.0, 2.0, 16.0), (100.0, 110.0, 80.0), anisotropy=0.4)
    camera = Camera.look_at((0.6, 1.9, 2.6), (0.0, 0.0, 0.0), fov_y=36.0)
    sky = Environment.gradient((2.0, 1.8, 1.5), (0.2, 0.25, 0.3))
    return Scene([Object(Mesh(vertices, ball.faces, name="leaf"), medium)], camera, (), sky)


def ball_in_soap() -> Scene:
    """Red ball inside a ball of soap."""
    soap = Medium((0.03, 0.05, 0.12), (2.6, 2.4, 2.0), anisotropy=0.4, ior=1.45)
    core = Object(_ball(0.45, (0.1, 1.05, 0.25)), color=(0.75, 0.08, 0.05))
    return _scene([Object(_ball(), soap), core])


def neon() -> Scene:
    """Ring that emits, absorbs, scatters and refracts light."""
    medium = Medium((0.8, 0.5, 0.3), (1.2, 1.4, 1.8), (0.9, 0.35, 0.1), anisotropy=0.2, ior=1.4)
    camera = Camera.look_at((0.5, 2.2, 3.0), (0.0, 0.0, 0.0), fov_y=36.0)
    return Scene([Object(Torus(0.8, 0.3).tessellate(48), medium)], camera, (), DUSK)


def _squared_cube(half: float, center: Sequence[float]) -> Object:
    """Cube with a texture of four by four squares on each face."""
    points, uv = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            out, across, up = (np.roll(np.eye(3), -axis, axis=0)[i] for i in range(3))
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)) if side > 0 else ((-1, -1), (-1, 1), (1, 1), (1, -1)):
                points.append(half * (side * out + a * across + b * up) + center)
                uv.append((0.5 + 0.5 * a, 0.5 + 0.5 * b))
    faces = [(4 * i, 4 * i + j, 4 * i + j + 1) for i in range(6) for j in (1, 2)]
    square = np.arange(64) // 16
    pixels = np.where((square[:, None] + square) % 2 == 0, 0.0, 1.0)[..., None] * np.subtract(LIGHT, DARK) + DARK
    surface = Surface(color_texture=Texture(pixels.astype(np.float32)), ior=1.0, roughness=1.0)
    return Object(
        Mesh(np.array(points), np.array(faces, dtype=np.int32), uv=np.array(uv), name="cube"), surface=surface
    )


def cubes_in_and_behind_glass() -> Scene:
    """Checkered cubes inside and behind a ball of glass."""
    cubes = _squared_cube(0.42, (0.0, 1.0, 0.0)), _squared_cube(0.6, (-0.6, 0.95, -2.2))
    return _scene([Object(_ball(), GLASS), *cubes, _ground(GREY, -0.05)])


def _in_a_shell(*inner: Object) -> Scene:
    shell = placed(SphericalShell(1.0, 0.8).tessellate(48), GLASS, (0.0, 1.01, 0.0), priority=2)
    return _scene([*inner, shell, _ground(GREY)], overlap="priority")


def ice_in_a_drink() -> Scene:
    """Ice in a drink in a round glass, whose walls touch."""
    drink, ice = Medium((0.3, 0.9, 2.0), ior=1.34), Medium((0.1, 0.1, 0.1), ior=1.31)
    inner = Object(_ball(0.8), drink, priority=1), Object(_ball(0.35, (0.1, 1.2, 0.1)), ice, priority=3)
    return _in_a_shell(*inner)


def milk_in_a_glass() -> Scene:
    """Milk in a round glass, whose walls touch."""
    milk = Medium((0.005, 0.01, 0.03), (5.0, 5.5, 6.0), anisotropy=0.7, ior=1.34)
    return _in_a_shell(Object(_ball(0.8), milk, priority=1))
