"""Hard cases of scattering bodies, and of many bodies: a lamp in a hollow, a part thinner than a cell, 2,000 nodes."""

from __future__ import annotations

import warnings

import numpy as np

from translucent import reference
from translucent.bench.hard.cases import EXACT, SIZE, Checks, Hard
from translucent.bench.shapes import joined
from translucent.errors import TranslucentWarning
from translucent.frames.frame import Frame
from translucent.geometry.solids import Box, Sphere, SphericalShell
from translucent.media.medium import Medium
from translucent.planning.scattering import Diffusion
from translucent.reference import slabs
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import PointLight
from translucent.scene.scene import Object, Scene

#: Share of the power of a lamp that may be lost or won on its way through a wall.
POWER = 0.1

#: Radiance of a part that cells do not resolve, in light of 1 from all sides, that diffusion may be off by.
UNRESOLVED = 0.2

NODES, BODIES, MEDIA = 2000, 300, 60


def _diffused(checks: Checks, scene: Scene, side: int, diffusion: Diffusion) -> Frame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TranslucentWarning)
        return checks.renderer.render(scene, (side, side), scattering=diffusion)


def _hollow(checks: Checks) -> None:
    """Balance of a lossless wall, which lets out all that the lamp inside sends, but for what passes unscattered: so
    seen from afar the mean radiance of the ball is its intensity over the area of the disk.
    """
    side, height = 48, 2.2
    camera = Camera.orthographic((0, 0, 4), (0, 0, 0), height=height)
    lamp, black = PointLight((0, 0, 0), (1.0, 1.0, 1.0)), Environment.constant((0, 0, 0))
    mesh = SphericalShell(1.0, 0.6).tessellate(48)
    for depth in (2.5, 10.0):
        shell = Object(mesh, Medium(scattering=depth / 0.4, ior=1.33))
        frame = _diffused(checks, Scene([shell], camera, [lamp], black), side, Diffusion())
        shown = float(frame.radiance[..., 0].sum()) * (height / side) ** 2
        checks.error(f"wall of {depth:g} mean free paths: power", shown / (1.0 - np.exp(-depth)) - 1.0)
        checks.holds("no pixel marked", frame.valid.all())


def _thin_part(checks: Checks) -> None:
    """A plate beside a ball, in light of 1 from all sides: what its middle sends along its normal is known."""
    ball, thickness = Sphere((1.0, 0.0, 0.0), 0.45).tessellate(48), 0.01
    plate = Box((-0.5, -0.5, -thickness / 2), (0.5, 0.5, thickness / 2)).tessellate()
    mesh = joined([(ball.vertices, ball.faces), (plate.vertices, plate.faces)], "ball and plate")
    diffusion = Diffusion(16)
    camera, white = Camera.orthographic((0, 0, 4), (0, 0, 0), height=0.3), Environment.constant((1, 1, 1))
    for albedo, depth in ((0.2, 1.0), (0.5, 4.0)):
        medium = Medium((1.0 - albedo) * depth / thickness, albedo * depth / thickness)
        body = Object(mesh, medium)
        frame = _diffused(checks, Scene([body], camera, (), white), 8, diffusion)
        cells = thickness / diffusion.cell_size(body)
        checks.error(
            f"albedo {albedo:g}, depth {depth:g}, {cells:.2f} cells thick", frame.radiance.mean() - _sent(albedo, depth)
        )
        checks.holds("no more light than there is", frame.radiance.max() <= 1.0 + 1e-5)
        checks.holds("no pixel marked", frame.valid.all())


def _sent(albedo: float, depth: float) -> float:
    """Radiance along the normal of a slab in light of 1 from all sides, by adding and doubling."""
    mu, weight = slabs.cosines(1.0)
    back, on = slabs.bare(albedo, depth, mu, weight)
    steep = (back + on).sum(axis=1)[-4:]
    return float(np.polyval(np.polyfit(mu[-4:], steep, 2), 1.0))


def _many(checks: Checks) -> None:
    """Bodies of 60 media in rows before a wall of opaque boxes."""
    ball, box = Sphere(radius=0.4).tessellate(8), Box((-0.3, -0.3, -0.1), (0.3, 0.3, 0.1)).tessellate()
    random = np.random.default_rng(7)
    media = [Medium(absorption=random.uniform(0.1, 2.0, 3)) for _ in range(MEDIA)]
    objects = []
    for number in range(NODES):
        place = np.eye(4)
        if number < BODIES:
            place[:3, 3] = number % 10, number // 10 % 10, 2.0 * (number // 100)
            objects.append(Object(ball, media[number % MEDIA], place))
        else:
            place[:3, 3] = number % 40 * 0.7 - 9.0, number // 40 * 0.7 - 14.0, -3.0
            objects.append(Object(box, None, place))
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
    checks.refused("60 media that emit, whose order counts,", lambda: checks.renderer.plan(crowd), "winding numbers")


CASES = (
    Hard(
        "H30",
        "a lamp inside a hollow of a scattering body",
        f"bounded: of the power of the lamp, what leaves a lossless wall is within {POWER:.0%}; no pixel is marked",
        _hollow,
        POWER,
        "of the power",
    ),
    Hard(
        "H31",
        "a part thinner than a cell of the diffusion, of low albedo",
        f"bounded: radiance within {UNRESOLVED:g} of the exact slab's in light of 1, never above 1; no pixel is marked",
        _thin_part,
        UNRESOLVED,
        "of the light around",
    ),
    Hard(
        "H32",
        f"{NODES:,} nodes, {BODIES} bodies, {MEDIA} media in one scene",
        "exact: 99.9 % of the pixels within a hundred roundings of the optical depth across the scene; more media than "
        "can be put in order are a clear error",
        _many,
        2.0 * 30.0 * EXACT,
        "optical depth",
    ),
)
