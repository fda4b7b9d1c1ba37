"""Scenes that are measured, as data: each hard on something."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from translucent.assets import mesh_path
from translucent.bench.contenders import Effect
from translucent.bench.scattering.scenes import SCENES, ScatteringScene
from translucent.bench.shapes import lens_row, lying_torus, menger_sponge, nested_shells, subdivided
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, SphericalShell, Torus
from translucent.media.density import DensityGrid
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene
from translucent.scene.showcase import framing, showcase
from translucent.scene.surface import Surface

Size = tuple[int, int]

#: Distance of a far body, in its own diameters.
FAR = 1e4

#: Thickness of the thin slab as a share of its width.
THIN = 1e-3

#: Nearly black background of scenes in which light is to be seen.
DUSK = Environment.constant((0.02, 0.02, 0.025))


@dataclass(frozen=True)
class Case:
    """A scene to measure on.

    Attributes
    ----------
    name, title, why : str
    scene : callable
        Makes it for a picture of a size.
    effect : str
        What its media do: methods differ in what they can render.
    quick : bool
        Measured with ``--quick``, too.
    brief : bool
        Only the contenders that are `brief`: another case of this kind has them all.
    shrink : int
        Timed at this part of the width and height: many steps along each ray take long.
    compared : int
        Largest width or height at which it is held against the reference, which takes its time for some; less with
        ``--quick``.
    tolerance : float
        Relative error of scattered light in the reference.
    stored : bool
        Its truth is path traced beforehand: see `translucent.bench.scattering.stored`.
    """

    name: str
    title: str
    why: str
    scene: Callable[[Size], Scene]
    effect: Effect = "absorption"
    quick: bool = True
    brief: bool = False
    shrink: int = 1
    compared: int = 240
    tolerance: float = 1e-4
    stored: bool = False


def _shown(make: Callable[[], Mesh], size: Size) -> Scene:
    return showcase(make(), size=size, stage="none")


def _glass(make: Callable[[], Mesh], surface: Surface, size: Size) -> Scene:
    """A body of green glass in a studio."""
    mesh = make()
    scene = showcase(mesh, size=size, environment=Environment.studio())
    glass = Medium.from_color((0.8, 0.95, 0.9), 0.3 * mesh.diagonal, ior=1.5)
    return dataclasses.replace(scene, objects=[Object(mesh, glass, surface=surface)])


def _nested(outer: Object, inner: Object, size: Size) -> Scene:
    """A body within another, in a studio: where both are, the one of higher priority is."""
    bodies = [outer, inner]
    return Scene(bodies, framing(bodies, size), environment=Environment.studio(), overlap="priority")


def _filled_goblet(size: Size) -> Scene:
    crystal = Medium.from_color((0.82, 0.9, 0.86), distance=0.01, ior=1.5)
    wine = Medium.from_color((0.6, 0.05, 0.12), distance=0.02, ior=1.34)
    return _nested(Object(_toolkit("wine"), wine), Object(_toolkit("goblet"), crystal, priority=1), size)


def _ball_in_ball(size: Size) -> Scene:
    glass = Medium.from_color((0.8, 0.95, 0.9), distance=0.6, ior=1.5)
    heavy = Medium.from_color((0.9, 0.5, 0.2), distance=0.6, ior=1.8)
    core = Object(Sphere(radius=0.5).tessellate(96), heavy, priority=1)
    return _nested(Object(Sphere().tessellate(96), glass), core, size)


def _wall(size: Size) -> Scene:
    """A wavy sheet of green glass in a studio."""
    glass = Medium.from_color((0.6, 0.9, 0.75), distance=2e-3, ior=1.5)
    wall = Object(_toolkit("leaf"), glass, sheet_thickness=2e-3)
    return Scene([wall], framing([wall], size), environment=Environment.studio())


def _ball() -> Mesh:
    return Sphere().tessellate(128)


def _toolkit(name: str) -> Mesh:
    return load_mesh(mesh_path(name))


def _far(make: Callable[[], Mesh], size: Size) -> Scene:
    """The picture of a body from `FAR` diameters away, through a lens that shows it as large as ever."""
    near = showcase(make(), size=size, stage="none")
    center, eye = near.objects[0].mesh.center, near.camera.pose[:3, 3]
    away = (eye - center) / np.linalg.norm(eye - center)
    fov = 2 * np.degrees(np.arctan(0.55 / FAR / min(1.0, size[0] / size[1])))
    camera = Camera.look_at(center + away * FAR * near.diagonal, center, fov_y=float(fov))
    return dataclasses.replace(near, camera=camera)


def _two_media(size: Size) -> Scene:
    glass = Medium.from_color((0.82, 0.9, 0.86), distance=0.01)
    wine = Medium.from_color((0.6, 0.05, 0.12), distance=0.02)
    objects = [Object(_toolkit("goblet"), glass), Object(_toolkit("wine"), wine)]
    return Scene(objects, framing(objects, size), environment=showcase(objects[0].mesh, stage="none").environment)


def _sheet(size: Size) -> Scene:
    green = Medium.from_color((0.25, 0.6, 0.12), distance=4e-4)
    leaf = Object(_toolkit("leaf"), dataclasses.replace(green, ior=1.4), sheet_thickness=4e-4)
    return Scene([leaf], framing([leaf], size), environment=showcase(leaf.mesh, stage="none").environment)


def _emission(size: Size) -> Scene:
    mesh = subdivided("knot", 80_000)
    reach = 0.1 * mesh.diagonal
    glowing = Medium(absorption=np.array([1.5, 0.6, 0.3]) / reach, emission=np.array([0.2, 0.6, 1.2]) / reach)
    return showcase(mesh, glowing, size, environment=DUSK)


def _two_emitters(size: Size) -> Scene:
    hot = Medium(absorption=(1.0, 2.0, 4.0), emission=(3.0, 1.2, 0.2))
    cold = Medium(absorption=(3.0, 1.5, 0.6), emission=(0.1, 0.5, 2.0))
    shifted = np.eye(4)
    shifted[:3, 3] = (0.9, 0.25, 0.5)
    ring, ball = Torus(0.7, 0.3).tessellate(200), Sphere(radius=0.6).tessellate(160)
    objects = [Object(ring, hot), Object(ball, cold, shifted)]
    return Scene(objects, framing(objects, size), environment=DUSK)


def _scattering(mesh: Mesh, optical_depth: float, size: Size) -> Scene:
    """Lit by a lamp from behind and by the sky."""
    extinction = optical_depth / mesh.diagonal
    milky = Medium(absorption=(0.1 * extinction,) * 3, scattering=(0.9 * extinction,) * 3, anisotropy=0.3)
    reach = mesh.diagonal
    lamp = PointLight(mesh.center + np.array([0.7, 0.5, -0.8]) * reach, (3.0 * reach**2,) * 3)
    sky = DirectionalLight((0.4, -0.8, -0.5), (2.0, 2.2, 2.6))
    return showcase(mesh, milky, size, environment=DUSK, lights=[lamp, sky])


def _density(size: Size) -> Scene:
    """A cloud in a torus: smooth blobs, and places where there is nothing."""
    mesh = lying_torus(160, 0.7, 0.3)
    x, y, z = np.meshgrid(*(np.linspace(0, 1, count) for count in (20, 10, 20)), indexing="ij")
    blobs = np.sin(9 * x + 1) * np.sin(8 * y) + np.cos(7 * x * y + 4 * z)
    density = DensityGrid(np.clip(1.0 + blobs, 0.0, None))
    glowing = Medium(absorption=(1.2, 2.2, 3.0), emission=(1.6, 0.7, 0.2))
    cloud = Object(mesh, glowing, density=density)
    return Scene([cloud], framing([cloud], size), environment=DUSK)


def _scattered_again(one: ScatteringScene) -> Case:
    """A case of light that is scattered many times, which is looked at from where its truth was."""
    return Case(
        one.name,
        one.title,
        one.why,
        lambda size: one.make(),
        "multiple scattering",
        quick=one.quick,
        shrink=4,
        compared=one.side,
        stored=True,
    )


#: Cases of interfaces, which take long: all but one are left out by ``--quick``.
_WITH_INTERFACES = partial(Case, effect="interfaces", quick=False, shrink=2)

CASES: tuple[Case, ...] = (
    Case("sphere", "Sphere", "convex: two surfaces on every ray", partial(_shown, lambda: Sphere().tessellate(316))),
    Case("torus", "Torus", "concave: up to four", partial(_shown, lambda: lying_torus(316)), quick=False),
    Case("knot", "Knot", "concave, and seen through itself", partial(_shown, lambda: subdivided("knot", 80_000))),
    Case("bear", "Gummy bear", "a figure with limbs", partial(_shown, lambda: subdivided("bear", 80_000)), quick=False),
    Case("sponge", "Menger sponge", "many layers, and walls that coincide", partial(_shown, menger_sponge)),
    Case("shells", "Nested shells", "hollow balls within each other", partial(_shown, nested_shells), quick=False),
    Case("two media", "Wine in a glass", "two media that share a face exactly", _two_media),
    Case("sheet", "Leaf", "an open sheet, declared thin", _sheet, "sheet", quick=False),
    Case(
        "slab",
        "Thin slab",
        "a closed body a thousand times as wide as thick",
        partial(_shown, lambda: Box.slab(thickness=THIN).tessellate()),
    ),
    Case(
        "far slab",
        "Thin slab, far away",
        "the same from 10,000 diameters",
        partial(_far, lambda: Box.slab(thickness=THIN).tessellate()),
    ),
    Case(
        "far knot",
        "Knot, far away",
        "concave, from 10,000 diameters",
        partial(_far, lambda: subdivided("knot", 80_000)),
        quick=False,
    ),
    Case("emission", "Glowing knot", "one medium that emits light", _emission, "emission", quick=False, shrink=2),
    Case(
        "two emitters",
        "Two glowing bodies",
        "emission in order",
        _two_emitters,
        "emission",
        quick=False,
        brief=True,
        shrink=2,
    ),
    Case(
        "scattering",
        "Milky torus",
        "light of a lamp and of the sky, scattered once; shadows that the body throws into itself",
        lambda size: _scattering(lying_torus(96), 8.0, size),
        "scattering",
        shrink=4,
        compared=96,
    ),
    Case(
        "deep scattering",
        "Milky sphere",
        "the same through a depth that hardly any light crosses",
        lambda size: _scattering(_ball(), 12.0, size),
        "scattering",
        quick=False,
        brief=True,
        shrink=4,
        compared=80,
        tolerance=3e-4,
    ),
    _WITH_INTERFACES(
        "glass",
        "Glass ball",
        "interfaces that mirror, and bend rays twice",
        partial(_glass, _ball, Surface()),
        quick=True,
        compared=128,
    ),
    _WITH_INTERFACES(
        "hollow",
        "Hollow glass ball",
        "rays that enter and leave twice, and mirrors around a hollow",
        partial(_glass, SphericalShell().tessellate, Surface()),
        compared=80,
    ),
    _WITH_INTERFACES(
        "glass knot",
        "Glass knot",
        "the same where rays leave and enter again",
        partial(_glass, partial(_toolkit, "knot"), Surface()),
        compared=96,
    ),
    _WITH_INTERFACES(
        "filled goblet",
        "Wine in a crystal glass",
        "media that touch, and differ in how they bend",
        _filled_goblet,
        compared=96,
    ),
    _WITH_INTERFACES(
        "nested balls",
        "Ball in a ball",
        "a body of one medium within another",
        _ball_in_ball,
        compared=80,
    ),
    _WITH_INTERFACES(
        "amber",
        "Amber",
        "flat faces that mirror totally, again and again",
        partial(_glass, partial(_toolkit, "amber"), Surface()),
        compared=96,
    ),
    _WITH_INTERFACES(
        "lenses",
        "Row of lenses",
        "bodies behind each other, seen through each other",
        partial(_glass, lens_row, Surface()),
        compared=80,
    ),
    _WITH_INTERFACES(
        "frosted",
        "Frosted glass ball",
        "rough interfaces, that blur what they mirror and what is behind",
        partial(_glass, _ball, Surface(roughness=0.4)),
        compared=32,
    ),
    _WITH_INTERFACES(
        "dispersion",
        "Ball of heavy flint",
        "each channel bends on its own",
        partial(_glass, _ball, Surface(dispersion=1.0)),
        brief=True,
        compared=96,
    ),
    _WITH_INTERFACES(
        "thin wall",
        "Sheet of glass",
        "a thin wall: both of its faces mirror, and rays that pass go straight on",
        _wall,
        brief=True,
        compared=120,
    ),
    Case("density", "Cloud", "density that varies from place to place", _density, "density", shrink=2, compared=192),
    *map(_scattered_again, SCENES),
)
