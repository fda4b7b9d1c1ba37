"""Hard cases from a light's side: what breaks views from cameras breaks maps of shadows, too."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from translucent import reference
from translucent.arrays import Array
from translucent.bench.hard.cases import Checks, Hard
from translucent.bench.shadows.ground import Ground, errors_of
from translucent.bench.shadows.maps import texel_errors
from translucent.bench.shadows.scenes import DARK, WINE, over_ground
from translucent.errors import TranslucentWarning
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.media.medium import Medium
from translucent.scene.camera import Camera
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene

#: Largest error of transmittance in the rays of texels, as the report claims it.
EXACT = 1e-5

#: Texels along a side of the maps whose texels are looked at, and of pictures.
TEXELS, PIXELS = 96, 64


def _measured(checks: Checks, what: str, scene: Scene) -> None:
    """Note errors in the rays of texels, and of the median point of the ground."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)
        texels = errors_of(texel_errors(checks.renderer, scene, TEXELS))
        ground = Ground(checks.renderer, scene, PIXELS)
        found = errors_of((ground.shown() - ground.truth)[ground.away])
    checks.error(f"{what}: in rays of texels", texels.p999)
    checks.error(f"{what}: in the median of the ground", found.median)


def _ring(unit: float = 1.0, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Object:
    ring = Torus().tessellate(64)
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return Object(Mesh(unit * ring.vertices, ring.faces), Medium(absorption=np.array((0.5, 2.0, 1.0)) / unit), matrix)


def _far_lamp(checks: Checks) -> None:
    near = over_ground([_ring()], "sun")
    towards = -np.asarray(near.lights[0].direction)  # type: ignore[union-attr]
    for diameters in (1e2, 1e4):
        away = diameters * float(np.linalg.norm(np.ptp(near.objects[0].bounds, axis=0)))
        lamp = PointLight(away * towards, np.pi * away**2)
        _measured(checks, f"{diameters:g} diameters", replace(near, lights=[lamp]))


def _elsewhere(checks: Checks) -> None:
    for light in ("sun", "lamp"):
        _measured(checks, light, over_ground([_ring(place=(-1e6, 1e6, 1e6))], light))


def _units(checks: Checks) -> None:
    for unit, light in ((1e-6, "sun"), (1e6, "lamp")):
        _measured(checks, f"{unit:g} m, {light}", over_ground([_ring(unit)], light))


def _opaque(checks: Checks) -> None:
    """Opaque objects between a body and its light, in it, beneath it, and in its place."""
    ball, plate = Sphere().tessellate(64), Box((-0.45, -0.05, -0.45), (0.45, 0.05, 0.45)).tessellate()
    body = Object(ball, WINE)
    for name, height in (("before", 1.6), ("inside", 0.1), ("beneath", -1.3), ("coincident", 0.0)):
        matrix = np.eye(4)
        matrix[1, 3] = height
        stone = Object(ball) if name == "coincident" else Object(plate, None, matrix)
        scene = over_ground([body, stone], "sun", gap=0.1)
        ground = Ground(checks.renderer, scene, PIXELS)
        found, dark = ground.shown(), ground.away & ~ground.truth.any(axis=-1)
        lit = ground.inside & (ground.truth == 1.0).all(axis=-1)
        checks.holds(f"{name}: no light in {int(dark.sum())} dark points", not found[dark].any())
        checks.error(f"{name}: in lit ones", np.abs(found[lit] - 1.0).max())
        checks.error(f"{name}: in the median of the shadow", errors_of((found - ground.truth)[ground.away]).median)
    checks.error("on the lit side of a ball, of the brightest", _lost(checks, ball).max())


def _lost(checks: Checks, ball: Mesh) -> Array:
    """Light that a ball takes from its own lit side, where it faces the light by more than a few degrees."""
    below = np.eye(4)
    below[1, 3] = -3.0
    camera = Camera.look_at((3.0, 3.0, 3.0), (0.0, 0.0, 0.0), fov_y=25.0)
    sun = DirectionalLight((1.0, -1.5, -0.4), 1.0)
    scene = Scene([Object(ball, color=(1.0, 1.0, 1.0)), Object(ball, WINE, below)], camera, [sun], DARK)
    frame, truth = checks.render(scene, (PIXELS, PIXELS)), reference.render(scene, (PIXELS, PIXELS)).radiance
    lit = truth.max(axis=-1) > 0.25 * truth.max()
    return np.asarray((truth - frame.radiance).max(axis=-1)[lit] / truth.max())


_EXACTLY = "exact: transmittance within 1e-5 in 99.9 % of the rays of texels, and in the median of the ground"

CASES = (
    Hard("H33", "H07 from the light's side: a lamp 10,000 diameters away", _EXACTLY, _far_lamp, EXACT, "of 1"),
    Hard("H34", "H09 from the light's side: a shadow 1e6 m from the origin", _EXACTLY, _elsewhere, EXACT, "of 1"),
    Hard("H35", "H10 from the light's side: units of 1e-6 m and 1e6 m", _EXACTLY, _units, EXACT, "of 1"),
    Hard(
        "H36",
        "H19 from the light's side: opaque object before, inside, beneath, coincident",
        "exact: no light in shadows of opaque objects, none lost elsewhere, transmittance within 1e-5 in the median",
        _opaque,
        EXACT,
        "of 1",
    ),
)
