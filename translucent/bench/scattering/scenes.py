"""Scenes whose media scatter light many times, each hard on something else.

Lamps are before bodies without interfaces alone: what a polished interface bends of a lamp's light, no path finds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from translucent.assets import mesh_path
from translucent.bench.shapes import lying_torus
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, SphericalShell
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.mesh_files import load_mesh
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PointLight
from translucent.scene.scene import Light, Object, Scene
from translucent.scene.surface import Surface

#: A sky brighter and bluer than the ground: smooth, so that few paths tell what it gives.
SKY = Environment.gradient((0.22, 0.19, 0.16), (1.25, 1.4, 1.6))
#: The same at dusk, beside a lamp.
DUSK = Environment.gradient((0.05, 0.045, 0.04), (0.1, 0.11, 0.13))


@dataclass(frozen=True)
class ScatteringScene:
    """Scene with a stored truth.

    Attributes
    ----------
    name, title, why : str
        As of `translucent.bench.cases.Case`; the truth's file has the name.
    make : callable
        Makes it, always the same.
    side : int
        Width and height of the truth in pixels.
    paths : int
        Of each pixel, in each of the two halves of the truth.
    quick : bool
        Measured with ``--quick``, too.
    """

    name: str
    title: str
    why: str
    make: Callable[[], Scene]
    side: int = 40
    paths: int = 80
    quick: bool = False


def _shown(body: Object, lights: Sequence[Light] = (), environment: Environment = SKY, turn: float = 0.6) -> Scene:
    """A body from the front, a little to the side and above, as large as the picture."""
    corners = body.mesh.vertices
    camera = Camera.framing(corners, (1, 1), direction=(-turn, -0.45, -1.0), fov_y=28.0)
    return Scene([body], camera, lights, environment)


def _medium(depth: float, length: float, albedo: Sequence[float], ior: float, anisotropy: float = 0.0) -> Medium:
    """Medium of an optical depth over a length in metres, and of a single-scattering albedo for each channel."""
    extinction, share = depth / length, np.asarray(albedo)
    return Medium(extinction * (1.0 - share), extinction * share, anisotropy=anisotropy, ior=ior)


def _toolkit(name: str) -> Mesh:
    return load_mesh(mesh_path(name))


def _jade() -> Scene:
    return _shown(Object(lying_torus(64, 1.0, 0.3), _medium(8.0, 0.6, (0.9, 0.985, 0.96), 1.6)), turn=0.2)


def _soap() -> Scene:
    mesh = _toolkit("soap")
    height = float(mesh.bounds[1][1] - mesh.bounds[0][1])
    return _shown(Object(mesh, _medium(6.0, height, (0.999, 0.995, 0.97), 1.45), surface=Surface(roughness=0.35)))


def _milk() -> Scene:
    return _shown(Object(Sphere().tessellate(64), _medium(40.0, 2.0, (0.9999, 0.9996, 0.998), 1.33, anisotropy=0.5)))


def _bear() -> Scene:
    return _shown(Object(_toolkit("bear"), preset("skim_milk").medium), turn=-0.3)


def _marble() -> Scene:
    mesh = _toolkit("knot")
    thick = 4.0 * abs(mesh.volume) / _area(mesh)
    return _shown(Object(mesh, _medium(8.0, thick, (0.999, 0.998, 0.996), 1.5)), turn=0.2)


def _area(mesh: Mesh) -> float:
    """Area of a mesh in square metres."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _wax() -> Scene:
    block = Box((-0.6, -0.5, -0.3), (0.6, 0.5, 0.3)).tessellate()
    lamp = PointLight((-0.95, 0.35, -0.75), (1.6, 1.3, 1.0))
    return _shown(Object(block, _medium(12.0, 1.2, (0.995, 0.98, 0.94), 1.0)), [lamp], DUSK)


def _lantern() -> Scene:
    shell = SphericalShell(1.0, 0.8).tessellate(64)
    lamp = PointLight((0.0, 0.0, 0.0), (1.5, 1.1, 0.6))
    return _shown(Object(shell, _medium(2.5, 0.2, (0.99, 0.99, 0.99), 1.0)), [lamp], DUSK)


SCENES: tuple[ScatteringScene, ...] = (
    ScatteringScene(
        "jade ring", "Ring of jade", "a green ring, its tube 8 mean free paths thick", _jade, paths=280, quick=True
    ),
    ScatteringScene("soap", "Bar of soap", "a rough box with round edges, 6 mean free paths high", _soap, paths=160),
    ScatteringScene(
        "milk ball", "Ball of milk", "40 mean free paths, half of them forwards; next to nothing is absorbed", _milk
    ),
    ScatteringScene("milk bear", "Bear of skimmed milk", "limbs that shadow each other", _bear, paths=100),
    ScatteringScene("marble knot", "Knot of marble", "a body beside itself, in its own light", _marble, paths=90),
    ScatteringScene(
        "wax block", "Block of wax with a lamp behind it", "light of one corner that spreads sideways", _wax, paths=400
    ),
    ScatteringScene(
        "lantern",
        "Hollow ball with a lamp inside",
        "a wall of 2.5 mean free paths around a hollow, in which light goes to and fro",
        _lantern,
        side=32,
        paths=550,
    ),
)
