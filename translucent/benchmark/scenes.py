"""The thirty scenes of the benchmark, each with its subject and the features that a renderer needs for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from translucent.arrays import Array
from translucent.bench.shapes import bent_leaf, placed, square_ground, toolkit
from translucent.errors import InputError, closest_name
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Ellipsoid, Sphere, SphericalShell, Torus
from translucent.media.albedo import scattering_medium
from translucent.media.medium import Medium
from translucent.media.presets import preset
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.environment_map import texel_directions
from translucent.scene.lights import DirectionalLight, Light, PointLight
from translucent.scene.scene import Object, Overlap, Scene
from translucent.scene.surface import Surface

#: Width and height of the stored truth, in pixels.
SIZE = 128

Group = Literal["thickness", "color", "interfaces", "rough", "scattering", "light", "emission"]

#: What a renderer needs for a scene, as in the list of features that an adapter says it has.
Feature = Literal[
    "absorption", "refraction", "roughness", "nesting", "scattering", "anisotropy", "shadows", "emission", "sheets"
]

#: What each feature means, for people who look up a word.
FEATURES: dict[Feature, str] = {
    "absorption": "light is absorbed by the length of its path in a medium (Beer and Lambert)",
    "refraction": "interfaces reflect and refract by Fresnel and Snell",
    "roughness": "rough interfaces (GGX, alpha = roughness squared)",
    "nesting": "bodies in bodies: the one with the higher priority counts where two overlap",
    "scattering": "media scatter light, any number of times",
    "anisotropy": "scattering has a preferred direction (Henyey and Greenstein's g)",
    "shadows": "light of lamps or sky reaches opaque surfaces through bodies, or is blocked by them",
    "emission": "media emit light",
    "sheets": "open meshes stand for thin sheets of a stated thickness",
}

WHITE = Environment.constant((1.0, 1.0, 1.0))
DAY = Environment.gradient((0.3, 0.28, 0.25), (1.1, 1.2, 1.4))
DUSK = Environment.gradient((0.1, 0.1, 0.1), (0.3, 0.33, 0.4))
BACKLIT = Environment.gradient((1.0, 0.9, 0.75), (0.1, 0.12, 0.15))

#: Refracting glass, and colors of grounds.
GLASS_IOR = 1.5
GREY, PALE = (0.55, 0.52, 0.48), (0.85, 0.85, 0.85)


@dataclass(frozen=True)
class BenchmarkScene:
    """One scene of the benchmark.

    Attributes
    ----------
    name : str
        Of its folder and of the picture to be scored.
    title : str
    tests : str
        What a renderer gets wrong here.
    group : str
    needs : tuple of str
        Features that a renderer must have; one that lacks some is not judged here.
    make : callable
        Makes the scene.
    thickness : bool
        Length of straight view rays in media is defined, and can be scored.
    sharp : bool
        No path has a random turn: the reference needs few rays for each pixel.
    """

    name: str
    title: str
    tests: str
    group: Group
    needs: tuple[Feature, ...]
    make: Callable[[], Scene]
    thickness: bool = False
    sharp: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the truth, in pixels."""
        return SIZE, SIZE


def _framed(objects: Sequence[Object], environment: Environment, fit: float | None = None, turn: float = 0.6) -> Scene:
    """Objects from the front, a little to the side and above, as large as the picture."""
    corners = np.concatenate([one.world_vertices for one in objects])
    camera = Camera.framing(corners, (1, 1), direction=(-turn, -0.45, -1.0), fov_y=28.0, fit=fit)
    nested = any(one.priority for one in objects)
    return Scene(list(objects), camera, (), environment, "priority" if nested else "add")


def _on_ground(
    objects: Sequence[Object],
    color: Sequence[float],
    environment: Environment,
    lights: Sequence[Light] = (),
    overlap: Overlap = "add",
) -> Scene:
    """Objects of about two metres on a square of eight metres."""
    camera = Camera.look_at((0.5, 2.2, 5.0), (0.0, 0.8, 0.0), fov_y=34.0)
    return Scene([*objects, square_ground(color)], camera, lights, environment, overlap, environment_shadows=64)


def _ball(radius: float = 1.0, center: Sequence[float] = (0.0, 0.0, 0.0), segments: int = 48) -> Mesh:
    x, y, z = center
    return Sphere(radius=radius, center=(x, y, z)).tessellate(segments)


def _tinted(mesh: Mesh, color: Sequence[float], part: float = 0.3, ior: float = 1.0) -> Medium:
    """Medium that transmits a color after a part of the diagonal of a mesh."""
    return Medium.from_color(tuple(color), part * mesh.diagonal, ior=ior)


@cache
def soft_sun() -> Environment:
    """Sky with a sun that is blurred to a lobe 25 degrees wide, so that random paths find it by chance."""
    directions = texel_directions(64, 128)
    towards = np.array([-0.55, 0.75, -0.35])
    cosine = np.clip(directions @ (towards / np.linalg.norm(towards)), 0, 1)
    with np.errstate(under="ignore"):
        lobe = np.where(cosine > 0.5, cosine, 0.0) ** 40
    sky = 0.25 + 0.2 * (0.5 + 0.5 * directions[..., 1:2]) * np.array([0.85, 1.0, 1.25])
    return Environment.image((sky + lobe[..., None] * np.array([12.0, 11.0, 9.5])).astype(np.float32))


@cache
def window_room() -> Environment:
    """Room with a bright window, a dim one and a dark floor: smooth, and something for glass to bend."""
    height = 64
    up = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    around = 2 * np.pi * ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5)[None]

    def box(middle: float, wide: float, low: float, high: float) -> Array:
        off = np.abs((around - middle + np.pi) % (2 * np.pi) - np.pi)
        edge = 0.1
        side = np.clip((wide - off) / edge + 0.5, 0, 1)
        part = side * np.clip((up - low) / edge + 0.5, 0, 1) * np.clip((high - up) / edge + 0.5, 0, 1)
        return part[..., None]

    floor = np.clip(-2 * up, 0, 1)[..., None] * np.array([0.02, 0.0, -0.05])
    walls = 0.35 + 0.12 * np.sin(up)[..., None] + floor + 0.08 * np.sin(4 * around)[..., None]
    bright = box(-1.0, 0.45, 0.1, 0.9) * np.array([3.0, 3.1, 3.3])
    dim = box(1.8, 0.7, -0.1, 0.6) * np.array([1.3, 1.1, 0.8])
    return Environment.image((walls + bright + dim).astype(np.float32))


# --- thickness, and color at a distance ------------------------------------------------------------------------------


def _thick_ball() -> Scene:
    ball = _ball()
    return _framed([Object(ball, _tinted(ball, (0.2, 0.6, 0.35)))], WHITE)


def _thick_knot() -> Scene:
    knot = toolkit("knot")
    return _framed([Object(knot, _tinted(knot, (0.5, 0.25, 0.6), 0.15))], WHITE)


def _thick_shell() -> Scene:
    shell = SphericalShell(1.0, 0.8).tessellate(48)
    return _framed([Object(shell, _tinted(shell, (0.75, 0.4, 0.2), 0.2))], DAY)


def _far_away() -> Scene:
    ball = Torus(0.7, 0.3).tessellate(64)
    distance = 2000.0
    camera = Camera.look_at((0.0, 0.6 * distance, 0.8 * distance), (0, 0, 0), fov_y=float(np.degrees(2.3 / distance)))
    return Scene([Object(ball, _tinted(ball, (0.6, 0.3, 0.2), 0.2))], camera, (), WHITE)


def _thin_plate() -> Scene:
    plate = Box.slab(thickness=1e-3).tessellate()
    camera = Camera.look_at((0.9, 0.7, 1.6), (0.0, 0.0, 0.0), fov_y=32.0)
    return Scene([Object(plate, Medium.from_color((0.35, 0.6, 0.8), 1e-3))], camera, (), WHITE)


def _open_bowl() -> Scene:
    ball = _ball(segments=48)
    kept = ball.vertices[ball.faces, 1].max(axis=1) < 0.6
    bowl = Mesh(ball.vertices, ball.faces[kept], name="bowl")
    medium = Medium.from_color((0.4, 0.65, 0.3), 0.02)
    return _framed([Object(bowl, medium, sheet_thickness=0.02)], WHITE)


def _wedge() -> Scene:
    # A prism whose thickness along z goes from nearly nothing to 4 cm.
    x, y, thick, thin = 0.03, 0.02, 0.04, 1e-4
    corners = np.array([(s, t, 0) for s, t in ((-x, -y), (x, -y), (x, y), (-x, y))], dtype=np.float64)
    back = corners - np.stack([np.zeros(4), np.zeros(4), np.where(corners[:, 0] > 0, thick, thin)], axis=1)
    quads = [(0, 1, 2, 3), (5, 4, 7, 6), (4, 0, 3, 7), (1, 5, 6, 2), (3, 2, 6, 7), (4, 5, 1, 0)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    mesh = Mesh(np.concatenate([corners, back]), np.array(faces, np.int32), name="wedge")
    camera = Camera.look_at((0.0, 0.0, 0.14), (0.0, 0.0, 0.0), fov_y=26.0)
    return Scene([Object(mesh, Medium.from_color("#7b1e3a", 0.01))], camera, (), WHITE)


def _two_media() -> Scene:
    left = Object(_ball(0.7, (-0.35, 0.0, 0.2)), Medium.from_color((0.2, 0.5, 0.9), 0.6))
    right = Object(_ball(0.7, (0.35, 0.1, -0.2)), Medium.from_color((0.9, 0.6, 0.2), 0.6))
    return _framed([left, right], WHITE)


# --- interfaces ------------------------------------------------------------------------------------------------------


def _glass_ball() -> Scene:
    ball = _ball(segments=64)
    return _framed([Object(ball, _tinted(ball, (0.8, 0.95, 0.9), ior=GLASS_IOR))], window_room())


def _glass_shell() -> Scene:
    shell = SphericalShell(1.0, 0.84).tessellate(64)
    return _framed([Object(shell, _tinted(shell, (0.7, 0.9, 0.95), 0.15, ior=GLASS_IOR))], DAY)


def _glass_knot() -> Scene:
    knot = toolkit("knot")
    return _framed([Object(knot, _tinted(knot, (0.18, 0.62, 0.35), 0.15, ior=GLASS_IOR))], DAY)


def _lens() -> Scene:
    lens = Ellipsoid(radii=(1.0, 1.0, 0.35)).tessellate(64)
    medium = _tinted(lens, (0.9, 0.95, 0.97), ior=GLASS_IOR)
    bars = [
        placed(Box((-0.15, -1.2, -0.05), (0.15, 1.2, 0.05)).tessellate(), None, (0.9 * i, 0.0, -1.6), color=color)
        for i, color in ((-1, (0.8, 0.1, 0.08)), (0, (0.1, 0.55, 0.15)), (1, (0.1, 0.2, 0.7)))
    ]
    camera = Camera.look_at((0.5, 0.4, 4.6), (0.0, 0.0, -0.2), fov_y=34.0)
    return Scene([Object(lens, medium), *bars], camera, (), DAY, environment_shadows=64)


def _amber() -> Scene:
    pebble = toolkit("amber")
    return _framed([Object(pebble, Medium.from_color((0.93, 0.46, 0.06), 0.02, ior=1.54))], DAY)


def _wine() -> Scene:
    red = Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    goblet = Object(toolkit("goblet"), preset("crystal").medium, priority=1)
    camera = Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    return Scene([goblet, Object(toolkit("wine"), red)], camera, (), DAY, "priority")


def _ice() -> Scene:
    glass, drink = Medium((0.05, 0.02, 0.04), ior=GLASS_IOR), Medium((0.3, 0.9, 2.0), ior=1.34)
    ice = Medium((0.1, 0.1, 0.1), ior=1.31)
    bodies = [
        Object(SphericalShell(1.0, 0.8).tessellate(48), glass, priority=2),
        Object(_ball(0.8), drink, priority=1),
        Object(_ball(0.35, (0.1, 0.2, 0.1)), ice, priority=3),
    ]
    return _framed(bodies, DAY)


def _core_in_ball() -> Scene:
    outer, core = _ball(segments=64), _ball(0.5, (0.15, 0.0, 0.1))
    bodies = [
        Object(outer, _tinted(outer, (0.8, 0.95, 0.9), ior=1.33)),
        Object(core, _tinted(outer, (0.95, 0.55, 0.2), ior=1.8), priority=1),
    ]
    return _framed(bodies, DAY)


# --- rough interfaces ------------------------------------------------------------------------------------------------


def _frosted(name: str, roughness: float, color: Sequence[float]) -> Scene:
    mesh = _ball(segments=64) if name == "ball" else toolkit(name)
    body = Object(mesh, _tinted(mesh, color, ior=GLASS_IOR), surface=Surface(roughness=roughness))
    return _framed([body], window_room() if name == "ball" else DAY)


# --- scattering ------------------------------------------------------------------------------------------------------


def _scattered(name: str, medium: Medium, roughness: float = 0.0, environment: Environment = DAY) -> Scene:
    mesh = toolkit(name)
    return _framed([Object(mesh, medium, surface=Surface(roughness=roughness))], environment)


def _jade() -> Scene:
    return _scattered("bangle", scattering_medium((0.07, 0.34, 0.17), 0.003, ior=1.6), 0.18)


def _soap() -> Scene:
    return _scattered("soap", scattering_medium((0.9, 0.66, 0.34), 0.006, ior=1.45), 0.2)


def _skin() -> Scene:
    return _scattered("bear", scattering_medium((0.75, 0.42, 0.3), 0.0006, ior=1.4), 0.2)


def _milk_ball() -> Scene:
    milk = Medium((0.002, 0.008, 0.04), (10.0, 10.5, 11.0), anisotropy=0.5, ior=1.34)
    return _framed([Object(_ball(), milk)], DAY)


def _milk_in_a_glass() -> Scene:
    milk = Medium((0.005, 0.01, 0.03), (5.0, 5.5, 6.0), anisotropy=0.7, ior=1.34)
    glass = Object(SphericalShell(1.0, 0.8).tessellate(48), Medium((0.05, 0.02, 0.04), ior=GLASS_IOR), priority=2)
    return _framed([glass, Object(_ball(0.8), milk, priority=1)], DAY)


def _wax_and_lamp() -> Scene:
    bear = toolkit("bear")
    wax = Medium((30.0, 60.0, 150.0), (500.0, 480.0, 400.0), anisotropy=0.2)
    lamp = PointLight(bear.center + np.array([0.02, 0.012, -0.02]), (0.006, 0.0045, 0.002))
    scene = _framed([Object(bear, wax)], DUSK)
    return Scene(scene.objects, scene.camera, [lamp], DUSK)


def _fog_ahead() -> Scene:
    fog = Medium((0.03,) * 3, (2.97,) * 3, anisotropy=0.85)
    scene = _framed([Object(_ball(), fog)], DUSK)
    return Scene(scene.objects, scene.camera, [DirectionalLight((0.25, 0.1, 1.0), 1.2)], DUSK)


# --- light that arrives elsewhere, and light from within -------------------------------------------------------------


def _colored_shadow() -> Scene:
    ball = _ball(center=(0.0, 1.01, 0.0))
    body = Object(ball, _tinted(ball, (0.75, 0.2, 0.15), 0.4))
    return _on_ground([body], PALE, DUSK, [DirectionalLight((-0.6, -0.7, -0.25), (2.6, 2.5, 2.3))])


def _caustic() -> Scene:
    ball = _ball(center=(0.0, 1.01, 0.0), segments=64)
    return _on_ground([Object(ball, _tinted(ball, (0.8, 0.95, 0.9), ior=GLASS_IOR))], GREY, soft_sun())


def _wax_on_white() -> Scene:
    wax = Medium((0.05, 0.12, 0.35), (7.0, 6.5, 5.5), anisotropy=0.3, ior=1.44)
    return _on_ground([Object(_ball(center=(0.0, 1.01, 0.0)), wax)], PALE, DAY)


def _glow() -> Scene:
    ring = Torus(0.8, 0.3).tessellate(48)
    medium = Medium((0.8, 0.5, 0.3), emission=(0.9, 0.35, 0.1))
    camera = Camera.look_at((0.5, 2.2, 3.0), (0.0, 0.0, 0.0), fov_y=36.0)
    return Scene([Object(ring, medium)], camera, (), DUSK)


_ABSORBS: tuple[Feature, ...] = ("absorption",)
_GLASS: tuple[Feature, ...] = ("absorption", "refraction")
_FOGGY: tuple[Feature, ...] = ("absorption", "scattering", "anisotropy")
_MILKY: tuple[Feature, ...] = ("absorption", "refraction", "scattering", "anisotropy")


def _one(
    name: str,
    title: str,
    tests: str,
    group: Group,
    needs: tuple[Feature, ...],
    make: Callable[[], Scene],
) -> BenchmarkScene:
    straight = group in ("thickness", "color")
    return BenchmarkScene(name, title, tests, group, needs, make, straight or group == "emission", straight)


SCENES: tuple[BenchmarkScene, ...] = (
    _one("thick-ball", "Ball", "thickness of a convex body", "thickness", _ABSORBS, _thick_ball),
    _one("thick-knot", "Knot", "concave: several stretches on one ray", "thickness", _ABSORBS, _thick_knot),
    _one("thick-shell", "Hollow ball", "nested surfaces of one mesh", "thickness", _ABSORBS, _thick_shell),
    _one("far-away", "Ring, 2000 m away", "precision far from the camera", "thickness", _ABSORBS, _far_away),
    _one("thin-plate", "Plate of 1 mm", "a wall of a thousandth of its width", "thickness", _ABSORBS, _thin_plate),
    _one("open-bowl", "Open bowl", "a mesh without an inside, as a sheet", "thickness", ("sheets",), _open_bowl),
    _one("wedge", "Wedge of wine", "color at a distance, from 0.1 to 40 mm", "color", _ABSORBS, _wedge),
    _one("two-media", "Two media", "media that overlap add up", "color", _ABSORBS, _two_media),
    _one("glass-ball", "Glass ball", "refraction, and what lies behind", "interfaces", _GLASS, _glass_ball),
    _one("glass-shell", "Glass bubble", "four interfaces on a ray", "interfaces", _GLASS, _glass_shell),
    _one("glass-knot", "Glass knot", "total reflection in a concave body", "interfaces", _GLASS, _glass_knot),
    _one("lens", "Lens", "things seen through a lens", "interfaces", (*_GLASS, "shadows"), _lens),
    _one("amber", "Amber pebble", "refraction and color together", "interfaces", _GLASS, _amber),
    _one("wine-glass", "Wine in a glass", "two bodies that share a face", "interfaces", (*_GLASS, "nesting"), _wine),
    _one("iced-drink", "Ice in a drink", "three bodies in each other", "interfaces", (*_GLASS, "nesting"), _ice),
    _one("core", "Dense core", "a heavier glass inside", "interfaces", (*_GLASS, "nesting"), _core_in_ball),
    _one(
        "frosted-ball",
        "Frosted ball",
        "rough refraction twice",
        "rough",
        (*_GLASS, "roughness"),
        lambda: _frosted("ball", 0.25, (0.8, 0.95, 0.9)),
    ),
    _one(
        "frosted-pebble",
        "Frosted pebble",
        "rough, dented, colored",
        "rough",
        (*_GLASS, "roughness"),
        lambda: _frosted("amber", 0.4, (0.5, 0.8, 0.9)),
    ),
    _one("jade", "Jade bangle", "dense, rough, colored by albedo", "scattering", (*_MILKY, "roughness"), _jade),
    _one("soap", "Bar of soap", "pale, with edges and a dent", "scattering", (*_MILKY, "roughness"), _soap),
    _one("skin", "Skin-like bear", "short free paths on a small body", "scattering", (*_MILKY, "roughness"), _skin),
    _one("milk-ball", "Ball of milk", "almost no absorption", "scattering", _MILKY, _milk_ball),
    _one(
        "milk-glass",
        "Milk in a glass",
        "a milky body in a clear one",
        "scattering",
        (*_MILKY, "nesting"),
        _milk_in_a_glass,
    ),
    _one("wax-lamp", "Wax and a lamp", "a lamp behind a bear, no interface", "scattering", _FOGGY, _wax_and_lamp),
    _one("leaf", "Leaf", "a thin body against the light", "scattering", _FOGGY, lambda: bent_leaf(BACKLIT)),
    _one("fog-ahead", "Fog before the sun", "scattering ahead, g = 0.85", "scattering", _FOGGY, _fog_ahead),
    _one(
        "colored-shadow",
        "Colored shadow",
        "light through a body on a ground",
        "light",
        ("absorption", "shadows"),
        _colored_shadow,
    ),
    _one("caustic", "Caustic", "light that a ball focuses on a ground", "light", (*_GLASS, "shadows"), _caustic),
    _one(
        "wax-on-white",
        "Wax on white",
        "a body and a ground that light each other",
        "light",
        (*_MILKY, "shadows"),
        _wax_on_white,
    ),
    _one("glow", "Glowing ring", "emission and absorption together", "emission", ("absorption", "emission"), _glow),
)

#: Error of 4 x 4 pixels that this toolkit promises for each group, with its own settings for pictures at rest: exact
#: where the plan is; rays of 16 samples at interfaces; what the notes of plans say of diffused light (15 %).
PROMISED: dict[Group, float] = {
    "thickness": 0.005,
    "color": 0.005,
    "emission": 0.005,
    "interfaces": 0.05,
    "rough": 0.1,
    "scattering": 0.15,
    "light": 0.15,
}

#: Scenes for which nothing is promised, with what their plans say.
NOT_PROMISED = {"caustic": "its plan leaves out light of the environment that the ball focuses onto the ground"}


def promise_kept(scene: BenchmarkScene, block: float) -> str:
    """Sentence on the promised error of a scene, and whether an error of 4 x 4 pixels keeps the promise."""
    if why := NOT_PROMISED.get(scene.name):
        return f"Nothing is promised: {why}. Measured: {block:.1%}."
    promised = PROMISED[scene.group]
    kept = "kept" if block <= promised else "not kept"
    return f"Promised: an error of 4 x 4 pixels up to {promised:.1%}. Measured: {block:.1%}: {kept}."


def scene_names() -> list[str]:
    """Names of all scenes, in the order of the table."""
    return [scene.name for scene in SCENES]


def scene_named(name: str) -> BenchmarkScene:
    """The scene of a name; raises `InputError` for other names."""
    for scene in SCENES:
        if scene.name == name:
            return scene
    do = closest_name(name, scene_names(), "see `translucent benchmark list`")
    raise InputError(f"scene {name!r}", "the benchmark has no scene of this name", do)
