"""Hard cases of interfaces: rays that bend in and out again, bodies that touch, light that is trapped in a guide."""

from __future__ import annotations

import numpy as np

from translucent import reference
from translucent.bench.hard.cases import Checks, Hard, Size
from translucent.bench.shapes import joined
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.media.medium import Medium
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Overlap, Scene

#: Size of frames, smaller than those of straight rays: the reference follows each ray along all its branches.
BENT_SIZE: Size = (24, 24)

#: Interfaces that a ray of the reference may meet.
BOUNCES = 24

#: RMS error of radiance, of its mean, that branches left out may cause.
LEFT_OUT = 0.02

CRYSTAL = Medium(absorption=(0.5, 0.2, 0.9), ior=1.5)
WINE = Medium(absorption=(0.3, 1.5, 1.2), ior=1.34)
SKY = Environment.gradient((0.2, 0.3, 0.4), (1.4, 1.2, 1.0))
OBLIQUE = Camera.look_at((2.0, 1.5, 4.0), (0, 0, 0), fov_y=30.0)


def _compare(checks: Checks, what: str, objects: list[Object], camera: Camera, overlap: Overlap = "add") -> None:
    """Compare radiance with that of the ray tree in float64; no pixel may be marked."""
    scene = Scene(objects, camera, environment=SKY, overlap=overlap)
    frame, truth = checks.render(scene, BENT_SIZE), reference.render(scene, BENT_SIZE, bounces=BOUNCES)
    both = frame.coverage & truth.coverage
    off = (frame.radiance - truth.radiance)[both] / truth.radiance[both].mean()
    checks.error(what, np.sqrt(np.mean(off**2)))
    checks.holds(f"{what}: no pixel marked", frame.valid.all())


def _hollow(checks: Checks) -> None:
    outer = Sphere().tessellate(32)
    for inside in (0.8, 0.98):
        inner = Sphere(radius=inside).tessellate(32)
        mesh = joined([(outer.vertices, outer.faces), (inner.vertices, inner.faces[:, ::-1])], "hollow")
        _compare(checks, f"wall of {1 - inside:.2g} radii", [Object(mesh, CRYSTAL)], OBLIQUE)


def _boxes(gap: float) -> tuple[Mesh, Mesh]:
    return Box((-1, -1, -1), (0, 1, 1)).tessellate(), Box((gap, -0.9, -0.9), (1, 0.9, 0.9)).tessellate()


def _nested(checks: Checks) -> None:
    for what, gap in (("touching", 0.0), ("apart by 1e-4", 1e-4), ("overlapping by 1e-4", -1e-4)):
        one, other = _boxes(gap)
        objects = [Object(one, CRYSTAL, priority=1), Object(other, WINE)]
        _compare(checks, what, objects, OBLIQUE, "priority")
    ball, core = Sphere().tessellate(32), Sphere(radius=0.5).tessellate(32)
    nested = [Object(core, WINE), Object(ball, CRYSTAL)]
    for what, eye in (("eye in the outer one", (0.1, 0.2, 0.8)), ("eye in both", (0.0, 0.1, 0.2))):
        _compare(checks, what, nested, Camera.look_at(eye, (0.3, 0, -1), fov_y=60.0))


def _guide(checks: Checks) -> None:
    """A rod 40 times as long as it is wide: light that enters at its end leaves at the other one, or never."""
    rod = Box((-0.05, -0.05, -2), (0.05, 0.05, 2)).tessellate()
    camera = Camera.look_at((0.1, 0.2, 2.6), (0, 0, 1.5), fov_y=12.0)
    _compare(checks, "end of a rod", [Object(rod, Medium(absorption=0.2, ior=1.5))], camera)


_BOUNDED = "bounded: radiance within a RMS of {:.0%} of its mean, of branches that are not followed; no pixel is marked"

CASES = (
    Hard(
        "H27",
        "a hollow body whose interfaces bend rays in and out again",
        _BOUNDED.format(LEFT_OUT),
        _hollow,
        LEFT_OUT,
        "of the mean radiance",
    ),
    Hard(
        "H28",
        "nested dielectrics that touch or overlap a little, eye inside one",
        _BOUNDED.format(LEFT_OUT),
        _nested,
        LEFT_OUT,
        "of the mean radiance",
    ),
    Hard(
        "H29",
        "long chains of total internal reflection",
        _BOUNDED.format(3 * LEFT_OUT),
        _guide,
        3 * LEFT_OUT,
        "of the mean radiance",
    ),
)
