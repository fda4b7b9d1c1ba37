"""Scenes on which methods are compared: built-in scenes, each hard in one respect, and models of the user."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from translucent import reference
from translucent.bench.contenders import Effect
from translucent.bench.drawing import Size
from translucent.bench.record import MODEL_CASE
from translucent.bench.shapes import (
    bent_leaf,
    lens_row,
    lying_torus,
    menger_sponge,
    nested_shells,
    placed,
    square_ground,
    subdivided,
    toolkit,
)
from translucent.errors import InputError, printable
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, SphericalShell, Torus
from translucent.media.density import DensityGrid
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Light, Object, Overlap, Scene
from translucent.scene.showcase import framing, showcase
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Distance of a far body, in its own diameters.
FAR = 1e4

#: Thickness of the thin slab as a fraction of its width.
THIN = 1e-3

#: Nearly black background of scenes in which light is to be seen.
DUSK = Environment.constant((0.02, 0.02, 0.025))

#: A sky brighter and bluer than the ground: smooth, so that few paths estimate it; and at dusk, beside a light.
SKY = Environment.gradient((0.22, 0.19, 0.16), (1.25, 1.4, 1.6))
EVENING = Environment.gradient((0.05, 0.045, 0.04), (0.1, 0.11, 0.13))

#: Skies: bright and dim, above a ground, and behind a leaf.
DAY = Environment.gradient((0.3, 0.28, 0.25), (1.1, 1.2, 1.4))
DIM_DAY = Environment.gradient((0.1, 0.1, 0.1), (0.3, 0.33, 0.4))
BACKLIT = Environment.gradient((2.0, 1.8, 1.5), (0.2, 0.25, 0.3))

#: Colors of a ground, and of the squares of a cube.
GREY, WHITE = (0.55, 0.52, 0.48), (0.85, 0.85, 0.85)
DARK, LIGHT = (0.05, 0.08, 0.3), (0.9, 0.85, 0.6)

WAX = Medium((0.05, 0.12, 0.35), (7.0, 6.5, 5.5), anisotropy=0.3, ior=1.44)
GLASS = Medium((0.05, 0.02, 0.04), ior=1.5)

#: A model is no solid if the reference can trust less than this fraction of the pixels that it covers ...
LEAST_VALID = 0.5
#: ... in a picture of this size.
LOOK: Size = (64, 64)


@dataclass(frozen=True)
class Case:
    """A scene to measure on.

    Attributes
    ----------
    name, title, why : str
    scene : callable
        Makes it for a picture of a size.
    effect : str
        Of its media: methods differ in what they can render.
    quick : bool
        Measured with ``--quick``, too.
    brief : bool
        Only the contenders that are `brief`: another case with this effect has them all.
    shrink : int
        Timed at this part of the width and height: many steps along each ray take long.
    compared : int
        Largest width or height at which it is compared with the reference, which takes its time for some; less with
        ``--quick``.
    tolerance : float
        Relative error of scattered light in the reference.
    paths : int
        Of each pixel, in each of the two halves of a truth that is path traced; 0: along rays of pixels.
    by_opengl : bool
        These paths are those of `PathTraced`: the reference takes too long.
    stored : bool
        The package brings this truth.
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
    paths: int = 0
    by_opengl: bool = False
    stored: bool = True


def _body(make: Callable[[], Mesh], size: Size) -> Scene:
    return showcase(make(), size=size, stage="none")


def _knot() -> Mesh:
    return subdivided("knot", 80_000)


def _thin_slab() -> Mesh:
    return Box.slab(thickness=THIN).tessellate()


def _far(make: Callable[[], Mesh], size: Size) -> Scene:
    """A body from `FAR` diameters away, with a field of view that keeps its size in the picture."""
    near = _body(make, size)
    center, eye = near.objects[0].mesh.center, near.camera.pose[:3, 3]
    away = (eye - center) / np.linalg.norm(eye - center)
    fov = 2 * np.degrees(np.arctan(0.55 / FAR / min(1.0, size[0] / size[1])))
    camera = Camera.look_at(center + away * FAR * near.diagonal, center, fov_y=float(fov))
    return dataclasses.replace(near, camera=camera)


def _framed(bodies: list[Object], size: Size, environment: Environment | None, overlap: Overlap = "add") -> Scene:
    """Bodies as large as the picture; by default over a light table."""
    light = environment or showcase(bodies[0].mesh, stage="none").environment
    return Scene(bodies, framing(bodies, size), environment=light, overlap=overlap)


def _two_media(size: Size) -> Scene:
    glass = Medium.from_color((0.82, 0.9, 0.86), distance=0.01)
    wine = Medium.from_color((0.6, 0.05, 0.12), distance=0.02)
    return _framed([Object(toolkit("goblet"), glass), Object(toolkit("wine"), wine)], size, None)


def _leaf(size: Size) -> Scene:
    green = Medium.from_color((0.25, 0.6, 0.12), distance=4e-4, ior=1.4)
    return _framed([Object(toolkit("leaf"), green, sheet_thickness=4e-4)], size, None)


def _emission(size: Size) -> Scene:
    mesh = _knot()
    reach = 0.1 * mesh.diagonal
    glowing = Medium(absorption=np.array([1.5, 0.6, 0.3]) / reach, emission=np.array([0.2, 0.6, 1.2]) / reach)
    return showcase(mesh, glowing, size, environment=DUSK)


def _two_emitters(size: Size) -> Scene:
    hot = Medium(absorption=(1.0, 2.0, 4.0), emission=(3.0, 1.2, 0.2))
    cold = Medium(absorption=(3.0, 1.5, 0.6), emission=(0.1, 0.5, 2.0))
    ball = placed(Sphere(radius=0.6).tessellate(160), cold, (0.9, 0.25, 0.5))
    return _framed([Object(Torus(0.7, 0.3).tessellate(200), hot), ball], size, DUSK)


def _scattering(make: Callable[[], Mesh], optical_depth: float, size: Size) -> Scene:
    """Body that scatters, lit by a point light from behind and by the sky."""
    mesh = make()
    extinction, reach = optical_depth / mesh.diagonal, mesh.diagonal
    milky = Medium(absorption=(0.1 * extinction,) * 3, scattering=(0.9 * extinction,) * 3, anisotropy=0.3)
    behind = PointLight(mesh.center + np.array([0.7, 0.5, -0.8]) * reach, (3.0 * reach**2,) * 3)
    sky = DirectionalLight((0.4, -0.8, -0.5), (2.0, 2.2, 2.6))
    return showcase(mesh, milky, size, environment=DUSK, lights=[behind, sky])


def _cloud(size: Size) -> Scene:
    """A cloud in a torus: smooth blobs, and places where there is nothing."""
    x, y, z = np.meshgrid(*(np.linspace(0, 1, count) for count in (20, 10, 20)), indexing="ij")
    blobs = np.sin(9 * x + 1) * np.sin(8 * y) + np.cos(7 * x * y + 4 * z)
    density = DensityGrid(np.clip(1.0 + blobs, 0.0, None))
    glowing = Medium(absorption=(1.2, 2.2, 3.0), emission=(1.6, 0.7, 0.2))
    return _framed([Object(lying_torus(160, 0.7, 0.3), glowing, density=density)], size, DUSK)


def _ball() -> Mesh:
    return Sphere().tessellate(128)


def _glass(make: Callable[[], Mesh], size: Size, surface: Surface | None = None) -> Scene:
    """A body of green glass in a studio."""
    mesh = make()
    scene = showcase(mesh, size=size, environment=Environment.studio())
    glass = Medium.from_color((0.8, 0.95, 0.9), 0.3 * mesh.diagonal, ior=1.5)
    return dataclasses.replace(scene, objects=[Object(mesh, glass, surface=surface or Surface())])


def _filled_goblet(size: Size) -> Scene:
    crystal = Medium.from_color((0.82, 0.9, 0.86), distance=0.01, ior=1.5)
    wine = Medium.from_color((0.6, 0.05, 0.12), distance=0.02, ior=1.34)
    bodies = [Object(toolkit("wine"), wine), Object(toolkit("goblet"), crystal, priority=1)]
    return _framed(bodies, size, Environment.studio(), "priority")


def _ball_in_ball(size: Size) -> Scene:
    glass = Medium.from_color((0.8, 0.95, 0.9), distance=0.6, ior=1.5)
    heavy = Medium.from_color((0.9, 0.5, 0.2), distance=0.6, ior=1.8)
    core = Object(Sphere(radius=0.5).tessellate(96), heavy, priority=1)
    return _framed([Object(Sphere().tessellate(96), glass), core], size, Environment.studio(), "priority")


def _wall(size: Size) -> Scene:
    """A wavy sheet of green glass in a studio."""
    glass = Medium.from_color((0.6, 0.9, 0.75), distance=2e-3, ior=1.5)
    return _framed([Object(toolkit("leaf"), glass, sheet_thickness=2e-3)], size, Environment.studio())


def _scene(body: Object, lights: Sequence[Light] = (), environment: Environment = SKY, turn: float = 0.6) -> Scene:
    """A body from the front, a little to the side and above, as large as the picture."""
    camera = Camera.framing(body.mesh.vertices, (1, 1), direction=(-turn, -0.45, -1.0), fov_y=28.0)
    return Scene([body], camera, lights, environment)


def _milky(depth: float, length: float, albedo: Sequence[float], ior: float, anisotropy: float = 0.0) -> Medium:
    """Medium of an optical depth over a length in metres, and of a single-scattering albedo for each channel."""
    extinction, bright = depth / length, np.asarray(albedo)
    return Medium(extinction * (1.0 - bright), extinction * bright, anisotropy=anisotropy, ior=ior)


def _jade(_: Size) -> Scene:
    return _scene(Object(lying_torus(64, 1.0, 0.3), _milky(8.0, 0.6, (0.9, 0.985, 0.96), 1.6)), turn=0.2)


def _soap(_: Size) -> Scene:
    mesh = toolkit("soap")
    soap = _milky(6.0, float(mesh.bounds[1][1] - mesh.bounds[0][1]), (0.999, 0.995, 0.97), 1.45)
    return _scene(Object(mesh, soap, surface=Surface(roughness=0.35)))


def _milk(_: Size) -> Scene:
    return _scene(Object(Sphere().tessellate(64), _milky(40.0, 2.0, (0.9999, 0.9996, 0.998), 1.33, anisotropy=0.5)))


def _bear(_: Size) -> Scene:
    return _scene(Object(toolkit("bear"), preset("skim_milk").medium), turn=-0.3)


def _marble(_: Size) -> Scene:
    mesh = toolkit("knot")
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    area = float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    marble = _milky(8.0, 4.0 * abs(mesh.volume) / area, (0.999, 0.998, 0.996), 1.5)
    return _scene(Object(mesh, marble), turn=0.2)


def _wax(_: Size) -> Scene:
    block = Box((-0.6, -0.5, -0.3), (0.6, 0.5, 0.3)).tessellate()
    light = PointLight((-0.95, 0.35, -0.75), (1.6, 1.3, 1.0))
    return _scene(Object(block, _milky(12.0, 1.2, (0.995, 0.98, 0.94), 1.0)), [light], EVENING)


def _lantern(_: Size) -> Scene:
    shell = SphericalShell(1.0, 0.8).tessellate(64)
    light = PointLight((0.0, 0.0, 0.0), (1.5, 1.1, 0.6))
    return _scene(Object(shell, _milky(2.5, 0.2, (0.99, 0.99, 0.99), 1.0)), [light], EVENING)


# Scenes in which light travels between objects. Their truth is made of random paths (`PathTraced`), which agree with
# Mitsuba 3 on such scenes.


def _on_top(radius: float = 1.0, center: Sequence[float] = (0.0, 1.01, 0.0)) -> Mesh:
    """Ball, by default on the ground."""
    return Sphere(radius=radius, center=(center[0], center[1], center[2])).tessellate(48)


def _together(
    objects: Sequence[Object], lights: Sequence[Light] = (), environment: Environment = DAY, overlap: Overlap = "add"
) -> Scene:
    """Objects of about two metres, from the front, a little to the side and above."""
    camera = Camera.look_at((0.5, 1.8, 4.8), (0.0, 0.95, 0.0), fov_y=32.0)
    shadows = 64 if any(item.medium is None for item in objects) else 0
    return Scene(list(objects), camera, lights, environment, overlap, environment_shadows=shadows)


def _wax_on_white(_: Size) -> Scene:
    """Ball of wax on a white ground under a sky."""
    return _together([Object(_on_top(), WAX), square_ground(WHITE)])


def _matched_wax_in_the_sun(_: Size) -> Scene:
    """Ball of wax without an interface on a gray ground, in the sun."""
    sun = DirectionalLight((-0.5, -0.7, -0.45), 3.0)
    medium = Medium(WAX.absorption, WAX.scattering, anisotropy=0.3)
    return _together([Object(_on_top(), medium), square_ground(GREY)], [sun], DIM_DAY)


def _fog_ahead(_: Size) -> Scene:
    """Ball of fog before the sun, six mean free paths thick."""
    fog = Medium((0.03,) * 3, (2.97,) * 3, anisotropy=0.85)
    return _together([Object(_on_top(), fog)], [DirectionalLight((0.25, -0.2, 1.0), 3.0)], DIM_DAY)


def _ball_in_soap(_: Size) -> Scene:
    """Red ball inside a ball of soap."""
    soap = Medium((0.03, 0.05, 0.12), (2.6, 2.4, 2.0), anisotropy=0.4, ior=1.45)
    core = Object(_on_top(0.45, (0.1, 1.05, 0.25)), color=(0.75, 0.08, 0.05))
    return _together([Object(_on_top(), soap), core])


def _neon(_: Size) -> Scene:
    """Ring that emits, absorbs, scatters and refracts light."""
    medium = Medium((0.8, 0.5, 0.3), (1.2, 1.4, 1.8), (0.9, 0.35, 0.1), anisotropy=0.2, ior=1.4)
    camera = Camera.look_at((0.5, 2.2, 3.0), (0.0, 0.0, 0.0), fov_y=36.0)
    return Scene([Object(Torus(0.8, 0.3).tessellate(48), medium)], camera, (), DIM_DAY)


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


def _cubes_in_and_behind_glass(_: Size) -> Scene:
    """Checkered cubes inside and behind a ball of glass."""
    cubes = _squared_cube(0.42, (0.0, 1.0, 0.0)), _squared_cube(0.6, (-0.6, 0.95, -2.2))
    return _together([Object(_on_top(), GLASS), *cubes, square_ground(GREY, -0.05)])


def _in_a_shell(*inner: Object) -> Scene:
    shell = placed(SphericalShell(1.0, 0.8).tessellate(48), GLASS, (0.0, 1.01, 0.0), priority=2)
    return _together([*inner, shell, square_ground(GREY)], overlap="priority")


def _ice_in_a_drink(_: Size) -> Scene:
    """Ice in a drink in a round glass, whose walls touch."""
    drink, ice = Medium((0.3, 0.9, 2.0), ior=1.34), Medium((0.1, 0.1, 0.1), ior=1.31)
    inner = Object(_on_top(0.8), drink, priority=1), Object(_on_top(0.35, (0.1, 1.2, 0.1)), ice, priority=3)
    return _in_a_shell(*inner)


def _milk_in_a_glass(_: Size) -> Scene:
    """Milk in a round glass, whose walls touch."""
    milk = Medium((0.005, 0.01, 0.03), (5.0, 5.5, 6.0), anisotropy=0.7, ior=1.34)
    return _in_a_shell(Object(_on_top(0.8), milk, priority=1))


#: Cases by effect: those of interfaces take long, and all but one are left out by ``--quick``. Those of light that is
#: scattered many times have a stored truth, and lights before bodies without interfaces alone: light that a polished
#: interface bends is found by no path.
_full = partial(Case, quick=False)
_scattered = partial(Case, effect="scattering", shrink=4)
_interfaces = partial(Case, effect="interfaces", quick=False, shrink=2)
_stored = partial(Case, effect="multiple scattering", quick=False, shrink=4, compared=40)
_lit = partial(Case, effect="all light", quick=False, brief=True, shrink=4, compared=32, by_opengl=True)

CASES: tuple[Case, ...] = (
    Case("sphere", "Sphere", "convex: two surfaces on every ray", partial(_body, lambda: Sphere().tessellate(316))),
    _full("torus", "Torus", "concave: up to four", partial(_body, lambda: lying_torus(316))),
    Case("knot", "Knot", "concave, and seen through itself", partial(_body, _knot)),
    _full("bear", "Gummy bear", "a figure with limbs", partial(_body, lambda: subdivided("bear", 80_000))),
    Case("sponge", "Menger sponge", "many layers, and walls that coincide", partial(_body, menger_sponge)),
    _full("shells", "Nested shells", "hollow balls within each other", partial(_body, nested_shells)),
    Case("two media", "Wine in a glass", "two media that share a face exactly", _two_media),
    _full("sheet", "Leaf", "an open sheet, declared thin", _leaf, "sheet"),
    Case("slab", "Thin slab", "a closed body a thousand times as wide as thick", partial(_body, _thin_slab)),
    Case("far slab", "Thin slab, far away", "the same from 10,000 diameters", partial(_far, _thin_slab)),
    _full("far knot", "Knot, far away", "concave, from 10,000 diameters", partial(_far, _knot)),
    _full("emission", "Glowing knot", "one medium that emits light", _emission, "emission", shrink=2),
    _full("two emitters", "Two glowing bodies", "emission in order", _two_emitters, "emission", brief=True, shrink=2),
    _scattered(
        "scattering",
        "Milky torus",
        "light of a point light and of the sky, scattered once; shadows that the body throws into itself",
        partial(_scattering, lambda: lying_torus(96), 8.0),
        compared=96,
    ),
    _scattered(
        "deep scattering",
        "Milky sphere",
        "the same through a depth that hardly any light crosses",
        partial(_scattering, _ball, 12.0),
        quick=False,
        brief=True,
        compared=80,
        tolerance=3e-4,
    ),
    _interfaces(
        "glass",
        "Glass ball",
        "interfaces that mirror, and bend rays twice",
        partial(_glass, _ball),
        quick=True,
        compared=128,
    ),
    _interfaces(
        "hollow",
        "Hollow glass ball",
        "rays that enter and leave twice, and mirrors around a hollow",
        partial(_glass, SphericalShell().tessellate),
        compared=80,
    ),
    _interfaces(
        "glass knot",
        "Glass knot",
        "the same where rays leave and enter again",
        partial(_glass, partial(toolkit, "knot")),
        compared=96,
    ),
    _interfaces(
        "filled goblet",
        "Wine in a crystal glass",
        "media that touch, and differ in how they bend",
        _filled_goblet,
        compared=96,
    ),
    _interfaces("nested balls", "Ball in a ball", "a body of one medium within another", _ball_in_ball, compared=80),
    _interfaces(
        "amber",
        "Amber",
        "flat faces that mirror totally, again and again",
        partial(_glass, partial(toolkit, "amber")),
        compared=96,
    ),
    _interfaces(
        "lenses",
        "Row of lenses",
        "bodies behind each other, seen through each other",
        partial(_glass, lens_row),
        compared=80,
    ),
    _interfaces(
        "frosted",
        "Frosted glass ball",
        "rough interfaces, that blur what they mirror and what is behind",
        partial(_glass, _ball, surface=Surface(roughness=0.4)),
        compared=32,
    ),
    _interfaces(
        "dispersion",
        "Ball of heavy flint",
        "each channel bends on its own",
        partial(_glass, _ball, surface=Surface(dispersion=1.0)),
        brief=True,
        compared=96,
    ),
    _interfaces(
        "thin wall",
        "Sheet of glass",
        "a thin wall: both of its faces mirror, and rays that pass go straight on",
        _wall,
        brief=True,
        compared=120,
    ),
    Case("density", "Cloud", "density that varies from place to place", _cloud, "density", shrink=2, compared=192),
    _stored(
        "jade ring", "Ring of jade", "a green ring, its tube 8 mean free paths thick", _jade, quick=True, paths=280
    ),
    _stored("soap", "Bar of soap", "a rough box with round edges, 6 mean free paths high", _soap, paths=160),
    _stored(
        "milk ball",
        "Ball of milk",
        "40 mean free paths, half of them forwards; next to nothing is absorbed",
        _milk,
        paths=80,
    ),
    _stored("milk bear", "Bear of skimmed milk", "limbs that shadow each other", _bear, paths=100),
    _stored("marble knot", "Knot of marble", "a body beside itself, in its own light", _marble, paths=90),
    _stored(
        "wax block", "Block of wax with a light behind it", "light of one corner that spreads sideways", _wax, paths=400
    ),
    _stored(
        "lantern",
        "Hollow ball with a light inside",
        "a wall of 2.5 mean free paths around a hollow, in which light goes to and fro",
        _lantern,
        compared=32,
        paths=550,
    ),
    _lit("wax on white", "Wax on a white ground", "light that goes between both", _wax_on_white, paths=250),
    _lit(
        "matched wax in the sun",
        "Wax without an interface in the sun",
        "its own shadow, and light of the ground",
        _matched_wax_in_the_sun,
        paths=300,
    ),
    _lit("fog ahead", "Fog before the sun", "nearly all light goes on ahead", _fog_ahead, paths=1500),
    _lit(
        "thin leaf",
        "Leaf before the sky",
        "thinner than a cell of a grid",
        lambda _: bent_leaf(BACKLIT),
        paths=400,
    ),
    _lit(
        "ball in soap",
        "Red ball in soap",
        "it takes light out of the soap around it",
        _ball_in_soap,
        paths=500,
    ),
    _lit("neon", "Ring that glows", "its light is scattered and mirrored inside", _neon, paths=400),
    _lit(
        "cubes in and behind glass",
        "Checkered cubes in and behind glass",
        "textures behind interfaces",
        _cubes_in_and_behind_glass,
        paths=500,
    ),
    _lit(
        "ice in a drink",
        "Ice in a drink in a glass",
        "three media and five interfaces",
        _ice_in_a_drink,
        paths=500,
    ),
    _lit(
        "milk in a glass",
        "Milk in a glass",
        "light that diffuses behind a wall",
        _milk_in_a_glass,
        paths=300,
    ),
)


def model_cases(scenes: Mapping[str, Scene]) -> list[Case]:
    """Cases for the scenes of models, by the names that the user gave.

    Methods differ in thickness: interfaces, which cost the same on top of each and have scenes of their own, are left
    out, and so is light that is scattered many times, which no method and no reference follows here. A case is called
    by the file's name, or by all of its path where several files have the same. One that no method can treat as solid
    raises `InputError` when its scene is made, so that it is a row of the report like all that fails.
    """
    shared = Counter(Path(model).name for model in scenes)
    found = []
    for model, scene in scenes.items():
        title = printable(model if shared[Path(model).name] > 1 else Path(model).name)
        why, bare = "a model of yours", [_without_interface(item) for item in scene.objects]
        if any(item is not own for item, own in zip(bare, scene.objects, strict=True)):
            why, scene = f"{why}, without its interfaces", dataclasses.replace(scene, objects=bare)
        found.append(Case(f"{MODEL_CASE}{title}", title, why, partial(_solid, title, scene), effect_of(scene)))
    return found


def _without_interface(item: Object) -> Object:
    if item.medium is None or (item.surface is None and item.medium.ior <= 1):
        return item
    return dataclasses.replace(item, medium=dataclasses.replace(item.medium, ior=1.0), surface=None)


def effect_of(scene: Scene) -> Effect:
    """Effect of the media of a scene, such as absorption or scattering, which selects the contenders."""
    media = [body.medium for body in scene.bodies if body.medium is not None]
    if any(body.density is not None for body in scene.bodies):
        return "density"
    if scene.lights and any(medium.scatters for medium in media):
        return "scattering"
    if any(medium.emits for medium in media):
        return "emission"
    return "sheet" if all(body.sheet_thickness is not None for body in scene.bodies) else "absorption"


def _solid(title: str, scene: Scene, _size: Size) -> Scene:
    """Return the scene if the reference finds that its bodies are closed."""
    look = reference.render(scene, LOOK)
    covered = look.coverage | ~look.valid
    if covered.any() and look.valid[covered].mean() < LEAST_VALID:
        wrong = "; ".join(f"{body.mesh.name!r} {body.mesh.diagnosis}" for body in scene.bodies)
        raise InputError(
            f"measuring {title!r}",
            (
                f"no method can render it as solid: {1.0 - look.valid[covered].mean():.0%} of its "
                f"pixels are invalid; {wrong}"
            ),
            "close the mesh, or declare it thin-walled in a .glb file",
        )
    return scene
