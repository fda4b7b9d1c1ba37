"""Scenes whose shadows are measured, as data: bodies over a ground, in the light of one lamp."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Object, Overlap, Scene
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

DARK = Environment.constant((0.0, 0.0, 0.0))
WINE, LEAF = Medium(absorption=(0.5, 2.0, 1.0)), Medium(absorption=(2.0, 0.3, 1.0))

#: Where suns shine to: towards the eye, so that shadows lie in front of what throws them.
SUNWARDS = (0.7, -1.0, 0.5)
#: Where lamps are, from the middle of what they light, in diagonals of it.
LAMP = (-0.9, 1.6, -0.8)

_QUAD = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], dtype=np.float64)
_FACES = np.array([(0, 2, 1), (0, 3, 2)], dtype=np.int32)


@dataclass(frozen=True)
class ShadowScene:
    """Scene with one light and a ground, which is its last object.

    Attributes
    ----------
    name, title, why : str
        As of `translucent.bench.shadows.record.ShadowCase`.
    make : callable
        Makes it, always the same.
    pictured, quick : bool
        With pictures; measured with ``--quick``, too.
    """

    name: str
    title: str
    why: str
    make: Callable[[], Scene]
    pictured: bool = False
    quick: bool = False


def over_ground(
    objects: Sequence[Object],
    light: str,
    *,
    gap: float = 0.02,
    surface: Surface | None = None,
    overlap: Overlap = "add",
) -> Scene:
    """Objects over a ground, so many of their diagonals above it, in a light, with all of their shadow in view."""
    corners = np.concatenate([item.bounds for item in objects])
    low, high = corners.min(axis=0), corners.max(axis=0)
    center, diagonal = 0.5 * (low + high), float(np.linalg.norm(high - low))
    height = float(low[1]) - gap * diagonal
    quad = 8.0 * diagonal * _QUAD + (center[0], height, center[2])
    floor = Mesh(quad, _FACES, uv=0.5 * (_QUAD[:, [0, 2]] + 1.0), name="ground")
    ground = Object(floor, color=(1.0, 1.0, 1.0)) if surface is None else Object(floor, surface=surface)
    lamp = _light(light, center, diagonal)
    seen = np.concatenate([_box(low, high), _shadow(_box(low, high), lamp, height)])
    camera = Camera.framing(seen, direction=(-0.1, -1.1, -1.0), fov_y=30.0)
    return Scene([*objects, ground], camera, [lamp], DARK, overlap)


def _light(kind: str, center: Array, diagonal: float) -> Light:
    """A light about as bright as any other on the ground."""
    if kind == "sun":
        return DirectionalLight(SUNWARDS, np.pi)
    place, power = center + np.array(LAMP) * diagonal, 4.0 * np.pi * diagonal**2
    return PointLight(place, power) if kind == "lamp" else SpotLight(place, center - place, power, 14.0, 30.0)


def _box(low: Array, high: Array) -> Array:
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _shadow(points: Array, light: Light, height: float) -> Array:
    """Places on a ground where points throw their shadows."""
    if isinstance(light, DirectionalLight):
        ways = np.broadcast_to(np.asarray(light.direction), points.shape)
    else:
        ways = points - np.asarray(light.position)
    return np.asarray(points + ((height - points[:, 1]) / ways[:, 1])[:, None] * ways)


def _body(name: str, light: str) -> Scene:
    mesh = load_mesh(mesh_path(name))
    return over_ground([Object(mesh, _across(mesh))], light)


def _across(mesh: Mesh) -> Medium:
    """Medium with optical depths of 1, 2 and 4 across the diagonal of a mesh."""
    return Medium(absorption=np.array([1.0, 2.0, 4.0]) / mesh.diagonal)


def _moved(mesh: Mesh, place: Sequence[float], medium: Medium | None = None) -> Object:
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return Object(mesh, medium, matrix)


def _finest() -> Scene:
    mesh = Sphere().tessellate(290)
    return over_ground([Object(mesh, _across(mesh))], "sun")


def _stack() -> Scene:
    plate, ball = Box((-1.0, -0.25, -0.8), (1.0, 0.25, 0.8)).tessellate(), Sphere(radius=0.6).tessellate(96)
    return over_ground([Object(plate, WINE), _moved(ball, (0.1, 0.86, 0.0), WINE)], "sun")


def _two_media() -> Scene:
    ball, box = Sphere().tessellate(96), Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
    return over_ground([Object(ball, WINE), _moved(box, (1.3, 0.1, 0.2), LEAF)], "lamp")


def _textured() -> Scene:
    tiles = np.where(np.indices((64, 64)).sum(axis=0)[..., None] % 2, (0.85, 0.8, 0.7), (0.35, 0.4, 0.45))
    mesh = load_mesh(mesh_path("knot"))
    return over_ground(
        [Object(mesh, _across(mesh))], "lamp", surface=Surface(roughness=1.0, color_texture=Texture(tiles))
    )


def _in_a_glass() -> Scene:
    glass, wine = (load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    # Straight ways: of what bends, the caustics are measured.
    bodies = [
        Object(glass, Medium(absorption=(60.0, 25.0, 35.0)), priority=1),
        Object(wine, Medium.from_color((0.62, 0.05, 0.09), 0.02)),
    ]
    return over_ground(bodies, "spot", overlap="priority")


def _stone() -> Scene:
    ball, stone = Sphere().tessellate(96), Sphere(radius=0.5).tessellate(96)
    return over_ground([Object(ball, WINE), _moved(stone, (-1.3, 1.0, 0.2))], "sun")


def _single(name: str, light: str, *, pictured: bool = False, quick: bool = False) -> ShadowScene:
    shape = "a bar of soap" if name == "soap" else f"a {name}"
    title, make = f"{name.capitalize()}, {light}", partial(_body, name, light)
    return ShadowScene(f"{name}, {light}", title, f"{shape} over a ground", make, pictured, quick)


SCENES: tuple[ShadowScene, ...] = (
    _single("bear", "sun", pictured=True, quick=True),
    _single("bear", "lamp"),
    _single("bear", "spot"),
    *(_single(name, light) for name in ("knot", "shell", "goblet", "bangle", "soap") for light in ("sun", "lamp")),
    ShadowScene("fine ball", "Ball of 83,520 triangles, sun", "many triangles, each of a few texels", _finest),
    ShadowScene(
        "stack",
        "Stack of two bodies, sun",
        "a ball on a plate, of one medium: what passes one, passes the other",
        _stack,
    ),
    ShadowScene(
        "two media",
        "Two media, lamp",
        "a ball and a box of other colors, whose shadows cross",
        _two_media,
        pictured=True,
        quick=True,
    ),
    ShadowScene("textured", "Knot over tiles, lamp", "a ground with a texture", _textured, pictured=True),
    ShadowScene(
        "in a glass",
        "Wine in a glass, spot",
        "a body inside another, which gives way to it",
        _in_a_glass,
        pictured=True,
    ),
    ShadowScene("stone", "Ball and stone, sun", "something opaque between the light and a body", _stone, pictured=True),
)
