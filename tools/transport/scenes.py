"""Scenes in which light travels between objects, for ``tools/transport_truth.py`` and ``tools/measure_transport.py``.

Each is hard in one respect, and made of the project's own meshes. Keys of ``SCENES`` are names; ``make(name)`` is a
scene, and the side of its picture in pixels. ``CHOICES`` are arguments of `Renderer.render` for scenes that need some.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import translucent as tl
from translucent.assets import mesh_path
from translucent.geometry.solids import Box, Sphere, Torus

SIDE = 96

DAY = tl.Environment.gradient((0.3, 0.28, 0.25), (1.1, 1.2, 1.4))
DIM = tl.Environment.gradient((0.1, 0.1, 0.1), (0.3, 0.33, 0.4))
WAX = tl.Medium((4.0, 9.0, 28.0), (480.0, 470.0, 430.0), anisotropy=0.3, ior=1.44)
GLASS = tl.Medium((4.0, 1.0, 2.0), ior=1.5)

CHOICES = {"ball_on_a_ground": {"caustics": tl.Caustics()}, "wine_on_a_ground": {"caustics": tl.Caustics()}}


def mesh(name: str) -> tl.Mesh:
    """Mesh of the project."""
    return tl.load_mesh(mesh_path(name))


def placed(scale: float = 1.0, shift: Sequence[float] = (0.0, 0.0, 0.0), turn: float = 0.0) -> np.ndarray:
    """Transform (4, 4): a scale, then a rotation about +Y in degrees, then a translation."""
    angle, matrix = np.radians(turn), np.eye(4)
    matrix[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    matrix[:3, :3] *= scale
    matrix[:3, 3] = shift
    return matrix


def ground(half: float, color: Sequence[float] = (0.55, 0.52, 0.48), top: float = 0.0) -> tl.Object:
    """Square slab below a height."""
    slab = Box((-half, top - 0.1 * half, -half), (half, top, half)).tessellate()
    return tl.Object(slab, color=color, surface=tl.Surface(ior=1.0, roughness=1.0))


def viewed(
    objects: Sequence[tl.Object],
    size: float,
    height: float,
    lights: Sequence[object] = (),
    environment: tl.Environment = DAY,
    overlap: str = "add",
) -> tl.Scene:
    """Objects of about a size in metres around a height, from the front, a little to the side and above."""
    middle = np.array((0.0, height, 0.0))
    camera = tl.Camera.look_at(middle + size * np.array((0.3, 0.55, 2.1)), middle, fov_y=32.0)
    shadows = 64 if any(item.medium is None for item in objects) else 0
    return tl.Scene(list(objects), camera, lights, environment, overlap, environment_shadows=shadows)


def soft_boxes() -> tl.Environment:
    """Three soft boxes, to the left, to the right and above and behind, in a dim room."""
    pixels = np.full((128, 256, 3), 0.06, np.float32)
    for row, column, half, radiance in (
        (50, 80, (20, 14), (7.0, 6.6, 6.0)),
        (58, 190, (16, 10), (2.0, 2.6, 3.6)),
        (24, 12, (12, 12), (5.0, 5.0, 5.0)),
    ):
        pixels[row - half[0] : row + half[0], column - half[1] : column + half[1]] = radiance
    return tl.Environment.image(pixels)


def _head() -> tl.Scene:
    bear, skin = mesh("bear"), tl.preset("skin").medium
    scale = 0.25 / float(bear.bounds[1][1] - bear.bounds[0][1])
    body = tl.Object(bear, skin, placed(scale, turn=-18.0))
    camera = tl.Camera.look_at((0.05, 0.2, 0.6), (0.0, 0.17, 0.0), fov_y=20.0)
    return tl.Scene([body], camera, environment=soft_boxes())


def _milk_in_a_glass() -> tl.Scene:
    milk = tl.Medium((0.3, 0.6, 2.0), (160.0, 175.0, 190.0), anisotropy=0.7, ior=1.34)
    glass = tl.Object(mesh("tumbler"), GLASS, priority=2)
    return viewed([glass, tl.Object(mesh("drink"), milk, priority=1)], 0.12, 0.05, overlap="priority")


def _ball_on_a_ground() -> tl.Scene:
    glass = tl.Object(mesh("sphere"), GLASS, placed(shift=(0.0, 0.001, 0.0)))
    key = tl.SphereLight.from_radiance((-0.12, 0.2, 0.06), (70.0, 66.0, 60.0), 0.02)
    return viewed([glass, ground(0.3)], 0.07, 0.01, [key], DIM)


def _wine_on_a_ground() -> tl.Scene:
    red = tl.Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    body = tl.Object(mesh("sphere"), red, placed(1.5, (0.0, 0.001, 0.0)))
    key = tl.SphereLight.from_radiance((-0.12, 0.25, -0.05), (60.0, 60.0, 60.0), 0.02)
    return viewed([body, ground(0.3)], 0.1, 0.015, [key], DIM)


def _rough_wax() -> tl.Scene:
    body = tl.Object(mesh("bear"), WAX, placed(3.0, turn=-18.0), surface=tl.Surface(roughness=0.4))
    return viewed([body], 0.06, 0.03, environment=tl.Environment.studio())


def _soap() -> tl.Scene:
    soap = tl.Medium((0.2, 1.1, 4.0), (330.0, 330.0, 330.0), ior=1.45)
    body = tl.Object(mesh("soap"), soap, placed(turn=24.0), surface=tl.Surface(roughness=0.35))
    return viewed([body], 0.08, 0.012, environment=tl.Environment.studio())


def _ball_in_soap() -> tl.Scene:
    soap = tl.Medium((0.8, 1.3, 3.0), (62.0, 60.0, 50.0), anisotropy=0.4, ior=1.45)
    core = tl.Object(Sphere(radius=0.012, center=(0.004, 0.03, 0.008)).tessellate(48), color=(0.75, 0.08, 0.05))
    return viewed([tl.Object(mesh("sphere"), soap, placed(1.4)), core], 0.055, 0.028)


def _neon() -> tl.Scene:
    medium = tl.Medium((22.0, 14.0, 9.0), (40.0, 45.0, 55.0), (25.0, 10.0, 3.0), anisotropy=0.2, ior=1.4)
    ring = tl.Object(Torus(0.03, 0.009).tessellate(64), medium, placed(shift=(0.0, 0.03, 0.0)))
    return viewed([ring], 0.06, 0.03, environment=DIM)


def _leaf() -> tl.Scene:
    green = tl.Medium((300.0, 60.0, 600.0), (3000.0, 3270.0, 2700.0), anisotropy=0.3, ior=1.4)
    slab = Box((-0.02, 0.0, -0.0005), (0.02, 0.05, 0.0005)).tessellate(12)
    bent = slab.vertices.copy()
    bent[:, 2] += 4.0 * bent[:, 0] ** 2 + 2.0 * (bent[:, 1] - 0.025) ** 2
    leaf = tl.Object(tl.Mesh(bent, slab.faces), green, placed(turn=15.0))
    behind = tl.Environment.image(_behind())
    return viewed([leaf], 0.06, 0.025, environment=behind)


def _behind() -> np.ndarray:
    """Equirectangular picture of one large soft light straight ahead of the camera, which is behind what it sees."""
    pixels = np.full((64, 128, 3), 0.1, np.float32)
    pixels[20:44, 48:80] = (4.0, 3.8, 3.4)
    return pixels


def _fog_ahead() -> tl.Scene:
    fog = tl.Medium((1.5,) * 3, (148.5,) * 3, anisotropy=0.85)
    sun = tl.DirectionalLight((0.25, -0.2, 1.0), 3.0)
    return viewed([tl.Object(mesh("sphere"), fog)], 0.04, 0.02, [sun], DIM)


def _ice_in_a_drink() -> tl.Scene:
    drink, ice = tl.Medium((4.0, 12.0, 26.0), ior=1.34), tl.Medium((1.5, 1.0, 1.0), ior=1.31)
    objects = [
        tl.Object(mesh("tumbler"), GLASS, priority=2),
        tl.Object(mesh("drink"), drink, priority=1),
        tl.Object(mesh("ice"), ice, placed(shift=(0.012, 0.058, 0.01), turn=30.0), priority=3),
        tl.Object(mesh("ice"), ice, placed(0.9, (-0.015, 0.05, -0.006), turn=70.0), priority=4),
    ]
    return viewed([*objects, ground(0.4)], 0.12, 0.05, overlap="priority")


def _wax_on_a_ground() -> tl.Scene:
    body = tl.Object(mesh("bear"), WAX, placed(3.0, turn=-18.0))
    # Of a light with a size, random paths find what the interface refracts.
    lamp = tl.SphereLight.from_radiance((0.25, 0.35, 0.23), (15.0, 15.0, 15.0), 0.1)
    return viewed([body, ground(0.4, (0.8, 0.78, 0.75))], 0.06, 0.025, [lamp], DIM)


def _matched_wax_on_a_ground() -> tl.Scene:
    matched = tl.Medium(WAX.absorption, WAX.scattering, anisotropy=0.3)
    body = tl.Object(mesh("bear"), matched, placed(3.0, turn=-18.0))
    sun = tl.DirectionalLight((-0.5, -0.7, -0.45), 3.0)
    return viewed([body, ground(0.4)], 0.06, 0.025, [sun], DIM)


def _wax_over_an_edge() -> tl.Scene:
    matched = tl.Medium(WAX.absorption, WAX.scattering, anisotropy=0.3)
    body = tl.Object(mesh("bear"), matched, placed(3.0, turn=-18.0))
    board = Box((-0.1, -0.03, -0.1), (0.004, 0.0, 0.1)).tessellate()
    white = tl.Object(board, color=(0.8, 0.78, 0.75), surface=tl.Surface(ior=1.0, roughness=1.0))
    return viewed([body, white], 0.06, 0.025, [tl.DirectionalLight((-0.5, -0.7, -0.45), 3.0)], DIM)


SCENES = {
    name.removeprefix("_"): make
    for name, make in {
        one.__name__: one
        for one in (
            _head,
            _milk_in_a_glass,
            _ball_on_a_ground,
            _wine_on_a_ground,
            _rough_wax,
            _soap,
            _ball_in_soap,
            _neon,
            _leaf,
            _fog_ahead,
            _ice_in_a_drink,
            _wax_on_a_ground,
            _matched_wax_on_a_ground,
            _wax_over_an_edge,
        )
    }.items()
}


def make(name: str) -> tuple[tl.Scene, int]:
    """Scene of a name, and the side of its picture in pixels."""
    return SCENES[name](), SIDE
