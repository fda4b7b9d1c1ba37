"""Hard cases of light: interfaces that trap it, bodies that scatter it, many bodies, and shadows; all hard cases."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from translucent import reference
from translucent.arrays import Array
from translucent.bench.claims import Judge, hard_claim
from translucent.bench.drawing import BenchContext
from translucent.bench.experiment import Experiment
from translucent.bench.hard import DEFINED, SIZE, Checks, HardCheck, hard
from translucent.bench.judgement import ROUNDING
from translucent.bench.record import HardCase, Part
from translucent.bench.shadows import DARK, WINE, Ground, error_statistics, over_ground, texel_errors
from translucent.bench.shapes import joined, placed
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, SphericalShell, Torus
from translucent.media.medium import Medium
from translucent.planning.scattering import Diffusion
from translucent.reference import slabs
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Overlap, Scene

_BOUNDED = "bounded: radiance within a RMS of {:.0%} of its mean, of branches that are not followed; no pixel is marked"
_EXACTLY = "exact: transmittance within 1e-5 in 99.9 % of the rays of texels, and in the median of the ground"

#: Interfaces at which the reference follows rays, along all their branches: so frames are smaller.
BOUNCES = 24

#: RMS error of radiance, of its mean, that branches left out may cause.
LEFT_OUT = 0.02

CRYSTAL = Medium(absorption=(0.5, 0.2, 0.9), ior=1.5)
BENT_WINE = Medium(absorption=(0.3, 1.5, 1.2), ior=1.34)
SKY = Environment.gradient((0.2, 0.3, 0.4), (1.4, 1.2, 1.0))
OBLIQUE = Camera.look_at((2.0, 1.5, 4.0), (0, 0, 0), fov_y=30.0)


def _bent(checks: Checks, what: str, objects: list[Object], camera: Camera, overlap: Overlap = "add") -> None:
    """Compare radiance with that of the ray tree in float64; no pixel may be marked."""
    scene = Scene(objects, camera, environment=SKY, overlap=overlap)
    frame, truth = checks.both(scene, (24, 24), bounces=BOUNCES)
    both = frame.coverage & truth.coverage
    off = (frame.radiance - truth.radiance)[both] / truth.radiance[both].mean()
    checks.error(what, np.sqrt(np.mean(off**2)))
    checks.holds(f"{what}: no pixel marked", frame.valid.all())


@hard(
    "H27",
    "a hollow body whose interfaces bend rays in and out again",
    _BOUNDED.format(LEFT_OUT),
    LEFT_OUT,
    unit="of the mean radiance",
)
def _hollow_glass(checks: Checks) -> None:
    outer = Sphere().tessellate(32)
    for inside in (0.8, 0.98):
        inner = Sphere(radius=inside).tessellate(32)
        mesh = joined([(outer.vertices, outer.faces), (inner.vertices, inner.faces[:, ::-1])], "hollow")
        _bent(checks, f"wall of {1 - inside:.2g} radii", [Object(mesh, CRYSTAL)], OBLIQUE)


@hard(
    "H28",
    "nested dielectrics that touch or overlap a little, eye inside one",
    _BOUNDED.format(LEFT_OUT),
    LEFT_OUT,
    unit="of the mean radiance",
)
def _nested(checks: Checks) -> None:
    for what, gap in (("touching", 0.0), ("apart by 1e-4", 1e-4), ("overlapping by 1e-4", -1e-4)):
        one = Box((-1, -1, -1), (0, 1, 1)).tessellate()
        other = Box((gap, -0.9, -0.9), (1, 0.9, 0.9)).tessellate()
        objects = [Object(one, CRYSTAL, priority=1), Object(other, BENT_WINE)]
        _bent(checks, what, objects, OBLIQUE, "priority")
    ball, core = Sphere().tessellate(32), Sphere(radius=0.5).tessellate(32)
    nested = [Object(core, BENT_WINE), Object(ball, CRYSTAL)]
    for what, eye in (("eye in the outer one", (0.1, 0.2, 0.8)), ("eye in both", (0.0, 0.1, 0.2))):
        _bent(checks, what, nested, Camera.look_at(eye, (0.3, 0, -1), fov_y=60.0))


@hard(
    "H29",
    "long chains of total internal reflection",
    _BOUNDED.format(3 * LEFT_OUT),
    3 * LEFT_OUT,
    unit="of the mean radiance",
)
def _guide(checks: Checks) -> None:
    """A rod 40 times as long as it is wide: light that enters at its end leaves at the other one, or never."""
    rod = Box((-0.05, -0.05, -2), (0.05, 0.05, 2)).tessellate()
    camera = Camera.look_at((0.1, 0.2, 2.6), (0, 0, 1.5), fov_y=12.0)
    _bent(checks, "end of a rod", [Object(rod, Medium(absorption=0.2, ior=1.5))], camera)


#: Fraction of the power of a light that may be lost or won between entering and leaving a wall.
POWER = 0.1

#: Radiance of a part that cells do not resolve, in light of 1 from all sides, that diffusion may be off by.
UNRESOLVED = 0.2

NODES, BODIES, MEDIA = 2000, 300, 60


@hard(
    "H30",
    "a light inside a hollow of a scattering body",
    f"bounded: of the power of the light, what leaves a lossless wall is within {POWER:.0%}; no pixel is marked",
    POWER,
    unit="of the power",
)
def _hollow(checks: Checks) -> None:
    """Energy balance of a hollow, lossless ball: its mean radiance from afar is the intensity of the light inside over
    the area of the disk, without light that passes unscattered.
    """
    side, height = 48, 2.2
    camera = Camera.orthographic((0, 0, 4), (0, 0, 0), height=height)
    light, black = PointLight((0, 0, 0), (1.0, 1.0, 1.0)), Environment.constant((0, 0, 0))
    mesh = SphericalShell(1.0, 0.6).tessellate(48)
    for depth in (2.5, 10.0):
        shell = Object(mesh, Medium(scattering=depth / 0.4, ior=1.33))
        frame = checks.renderer.render(Scene([shell], camera, [light], black), (side, side), scattering=Diffusion())
        rendered = float(frame.radiance[..., 0].sum()) * (height / side) ** 2
        checks.error(f"wall of {depth:g} mean free paths: power", rendered / (1.0 - np.exp(-depth)) - 1.0)
        checks.holds("no pixel marked", frame.valid.all())


@hard(
    "H31",
    "a part thinner than a cell of the diffusion, of low albedo",
    f"bounded: radiance within {UNRESOLVED:g} of the exact slab's in light of 1, never above 1; no pixel is marked",
    UNRESOLVED,
    unit="of the light around",
)
def _thin_part(checks: Checks) -> None:
    """Plate beside a ball in uniform light, with a known radiance along the normal of its middle."""
    ball, thickness = Sphere((1.0, 0.0, 0.0), 0.45).tessellate(48), 0.01
    plate = Box((-0.5, -0.5, -thickness / 2), (0.5, 0.5, thickness / 2)).tessellate()
    mesh = joined([(ball.vertices, ball.faces), (plate.vertices, plate.faces)], "ball and plate")
    diffusion = Diffusion(16)
    camera, white = Camera.orthographic((0, 0, 4), (0, 0, 0), height=0.3), Environment.constant((1, 1, 1))
    for albedo, depth in ((0.2, 1.0), (0.5, 4.0)):
        medium = Medium((1.0 - albedo) * depth / thickness, albedo * depth / thickness)
        body = Object(mesh, medium)
        frame = checks.renderer.render(Scene([body], camera, (), white), (8, 8), scattering=diffusion)
        cells = thickness / diffusion.cell_size(body)
        checks.error(
            f"albedo {albedo:g}, depth {depth:g}, {cells:.2f} cells thick", frame.radiance.mean() - _sent(albedo, depth)
        )
        checks.holds("no more light than there is", frame.radiance.max() <= 1.0 + 1e-5)
        checks.holds("no pixel marked", frame.valid.all())


def _sent(albedo: float, depth: float) -> float:
    """Radiance along the normal of a slab in uniform light of radiance 1, by adding and doubling."""
    mu, weight = slabs.cosines(1.0)
    back, on = slabs.bare(albedo, depth, mu, weight)
    steep = (back + on).sum(axis=1)[-4:]
    return float(np.polyval(np.polyfit(mu[-4:], steep, 2), 1.0))


@hard(
    "H32",
    f"{NODES:,} nodes, {BODIES} bodies, {MEDIA} media in one scene",
    "exact: 99.9 % of the pixels within a hundred roundings of the optical depth across the scene; more media than "
    "can be put in order are a clear error",
    2.0 * 30.0 * ROUNDING,
    unit="optical depth",
)
def _many(checks: Checks) -> None:
    """Balls of 60 media in rows, before a wall of opaque boxes."""
    ball, box = Sphere(radius=0.4).tessellate(8), Box((-0.3, -0.3, -0.1), (0.3, 0.3, 0.1)).tessellate()
    random = np.random.default_rng(7)
    media = [Medium(absorption=random.uniform(0.1, 2.0, 3)) for _ in range(MEDIA)]
    objects = []
    for number in range(NODES):
        if number < BODIES:
            place = number % 10, number // 10 % 10, 2.0 * (number // 100)
            objects.append(placed(ball, media[number % MEDIA], place))
        else:
            objects.append(placed(box, None, (number % 40 * 0.7 - 9.0, number // 40 * 0.7 - 14.0, -3.0)))
    scene = Scene(objects, Camera.look_at((7.0, 6.0, 22.0), (4.5, 4.5, 2.0), fov_y=38.0))
    # What is opaque is behind all bodies: without it the reference is quick.
    bodies = Scene(scene.bodies, scene.camera)
    frame, truth = checks.render(scene), reference.render(bodies, SIZE)
    found = checks.compared(frame, truth, bodies, "optical_depth")
    checks.error(f"{len(objects)} nodes, {BODIES} bodies, {MEDIA} media: optical depth", found.p999)
    checks.holds("no pixel marked", frame.valid.all())
    glowing = [
        Object(ball, Medium(medium.absorption, emission=1.0), body.matrix)
        for medium, body in zip(media, objects, strict=False)
    ]
    crowd = Scene(glowing, scene.camera)
    checks.refused("60 media that emit, whose order counts,", lambda: checks.renderer.plan(crowd), "groups of bodies")


#: Largest error of transmittance in the rays of texels, as the report claims it.
EXACT_SHADOW = 1e-5

#: Texels along a side of the maps whose texels are looked at, and of pictures.
TEXELS, PIXELS = 96, 64


def _shadow(checks: Checks, what: str, scene: Scene) -> None:
    """Note errors in the rays of texels, and of the median point of the ground."""
    texels = error_statistics(texel_errors(checks.renderer, scene, TEXELS))
    ground = Ground(checks.renderer, scene, PIXELS)
    found = error_statistics((ground.shown() - ground.truth)[ground.away])
    checks.error(f"{what}: in rays of texels", texels.p999)
    checks.error(f"{what}: in the median of the ground", found.median)


def _ring(unit: float = 1.0, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Object:
    ring = Torus().tessellate(64)
    return placed(Mesh(unit * ring.vertices, ring.faces), Medium(absorption=np.array((0.5, 2.0, 1.0)) / unit), place)


@hard("H33", "H07 from the light's side: a point light 10,000 diameters away", _EXACTLY, EXACT_SHADOW, unit="of 1")
def _far_light(checks: Checks) -> None:
    near = over_ground([_ring()], "sun")
    towards = -np.asarray(near.lights[0].direction)  # type: ignore[union-attr]
    for diameters in (1e2, 1e4):
        away = diameters * float(np.linalg.norm(np.ptp(near.objects[0].bounds, axis=0)))
        light = PointLight(away * towards, np.pi * away**2)
        _shadow(checks, f"{diameters:g} diameters", dataclasses.replace(near, lights=[light]))


@hard("H34", "H09 from the light's side: a shadow 1e6 m from the origin", _EXACTLY, EXACT_SHADOW, unit="of 1")
def _shadow_elsewhere(checks: Checks) -> None:
    for light in ("sun", "point light"):
        _shadow(checks, light, over_ground([_ring(place=(-1e6, 1e6, 1e6))], light))


@hard("H35", "H10 from the light's side: units of 1e-6 m and 1e6 m", _EXACTLY, EXACT_SHADOW, unit="of 1")
def _shadow_units(checks: Checks) -> None:
    for unit, light in ((1e-6, "sun"), (1e6, "point light")):
        _shadow(checks, f"{unit:g} m, {light}", over_ground([_ring(unit)], light))


@hard(
    "H36",
    "H19 from the light's side: opaque object before, inside, beneath, coincident",
    "exact: no light in shadows of opaque objects, none lost elsewhere, transmittance within 1e-5 in the median",
    EXACT_SHADOW,
    unit="of 1",
)
def _shadow_opaque(checks: Checks) -> None:
    """Opaque objects between a body and its light, in it, beneath it, and in its place."""
    ball, plate = Sphere().tessellate(64), Box((-0.45, -0.05, -0.45), (0.45, 0.05, 0.45)).tessellate()
    body = Object(ball, WINE)
    for name, height in (("before", 1.6), ("inside", 0.1), ("beneath", -1.3), ("coincident", 0.0)):
        stone = Object(ball) if name == "coincident" else placed(plate, None, (0, height, 0))
        scene = over_ground([body, stone], "sun", gap=0.1)
        ground = Ground(checks.renderer, scene, PIXELS)
        found, dark = ground.shown(), ground.away & ~ground.truth.any(axis=-1)
        lit = ground.inside & (ground.truth == 1.0).all(axis=-1)
        checks.holds(f"{name}: no light in {int(dark.sum())} dark points", not found[dark].any())
        checks.error(f"{name}: in lit ones", np.abs(found[lit] - 1.0).max())
        checks.error(
            f"{name}: in the median of the shadow", error_statistics((found - ground.truth)[ground.away]).median
        )
    checks.error("on the lit side of a ball, of the brightest", _lost(checks, ball).max())


def _lost(checks: Checks, ball: Mesh) -> Array:
    """Self-shadowing error: light that is missing on the lit side of a ball, away from the terminator."""
    camera = Camera.look_at((3.0, 3.0, 3.0), (0.0, 0.0, 0.0), fov_y=25.0)
    sun = DirectionalLight((1.0, -1.5, -0.4), 1.0)
    scene = Scene([Object(ball, color=(1.0, 1.0, 1.0)), placed(ball, WINE, (0, -3.0, 0))], camera, [sun], DARK)
    frame, found = checks.both(scene, (PIXELS, PIXELS))
    truth = found.radiance
    lit = truth.max(axis=-1) > 0.25 * truth.max()
    return np.asarray((truth - frame.radiance).max(axis=-1)[lit] / truth.max())


#: All hard cases, in their order.
HARD_CASES: tuple[HardCheck, ...] = tuple(sorted(DEFINED, key=lambda case: case.name))


@dataclass(frozen=True)
class HardCases(Experiment[HardCheck]):
    """All hard cases."""

    part: ClassVar[Part] = "hard-cases"
    label: ClassVar[str] = "hard case "
    into: ClassVar[str] = "hard_cases"
    claims: ClassVar[tuple[Judge, ...]] = (hard_claim([case.name for case in HARD_CASES]),)

    shown: Sequence[HardCheck] = HARD_CASES

    def measure(self, bench: BenchContext, case: HardCheck) -> HardCase:
        """Measure one of them."""
        return case.measure(bench.renderer)
