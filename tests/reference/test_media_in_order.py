"""Several media on a ray: overlap policies, emission in order, and sheets, against closed forms and plain loops."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.solids import Box, Sphere, SphericalShell
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.reference import render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Overlap, Scene

Array = npt.NDArray[np.float64]
Shade = Callable[..., dict[str, npt.NDArray[Any]]]

POLICIES: tuple[Overlap, ...] = ("add", "union", "priority")
RED = Medium(absorption=(0.5, 1.0, 0.0), emission=(0.7, 0.0, 0.1))
BLUE = Medium(absorption=(1.0, 0.2, 0.3), scattering=(0.5, 0.0, 0.0), emission=(0.0, 0.2, 0.9))
CLEAR = Medium(absorption=(0.1, 0.2, 0.3))
BACKDROP = Environment.constant((0.5, 0.75, 1.0))
A, B = Box((-1.0, -1.0, -1.0), (0.5, 1.0, 0.5)), Box((-0.5, -0.75, -0.25), (1.5, 0.5, 1.5))
DOWN = Camera.orthographic((0.1, 0.2, 6.0), (0.1, 0.2, 0.0), height=0.5)
SIZE = (24, 16)


@dataclass
class PlainRay:
    """One ray, as a list of solids (from, to, winding, object) and sheets (at, path, object); loops only."""

    scene: Scene
    solids: list[tuple[float, float, int, Object]]
    sheets: list[tuple[float, float, Object]] = field(default_factory=list)

    def pieces(self) -> list[tuple[float, Array, Array, int]]:
        """Length, extinction, emission and how often thickness counts them, from front to back."""
        distances = sorted({t for a, b, _, _ in self.solids for t in (a, b)} | {t for t, _, _ in self.sheets})
        found = []
        for begin, end in itertools.pairwise([*distances, np.inf]):
            for at, path, body in self.sheets:
                if at == begin:
                    found.append((path, *coefficients([body]), 1))
            there = [(w, body) for a, b, w, body in self.solids if a <= begin and b >= end and w]
            if there and end > begin:
                found.append((end - begin, *self.mixture(there)))
        return found

    def mixture(self, there: list[tuple[int, Object]]) -> tuple[Array, Array, int]:
        if self.scene.overlap == "add":
            counted = [body for w, body in there for _ in range(w)]
            return *coefficients(counted), len(counted)
        if self.scene.overlap == "union":
            return *coefficients(list({body.medium: body for _, body in there}.values())), 1
        return *coefficients([max((body for _, body in there), key=lambda body: body.priority)]), 1

    def back_to_front(self, behind: Array) -> dict[str, Any]:
        """L = L T + E, from the far end on (Max 1995, eq. 14)."""
        radiance, depth, thickness = np.array(behind), np.zeros(3), 0.0
        for length, extinction, emission, count in reversed(self.pieces()):
            clear = extinction == 0
            source = emission / np.where(clear, 1.0, extinction)
            own = np.where(clear, emission * length, source * -np.expm1(-extinction * length))
            radiance = radiance * np.exp(-extinction * length) + own
            depth += extinction * length
            thickness += count * length
        return {"radiance": radiance, "optical_depth": depth, "thickness": thickness}


def coefficients(bodies: list[Object]) -> tuple[Array, Array]:
    media = [body.medium for body in bodies if body.medium is not None]
    return sum((m.extinction for m in media), np.zeros(3)), sum((np.array(m.emission) for m in media), np.zeros(3))


def box_span(box: Box, origin: Array, direction: Array) -> tuple[float, float]:
    """Span of a ray, not parallel to an axis, in a box; empty if from >= to."""
    ends = np.sort((np.array([box.low, box.high]) - origin) / direction, axis=0)
    return max(float(ends[0].max()), 0.0), float(ends[1].min())


def assert_equal_to_plain_rays(
    found: dict[str, npt.NDArray[Any]], rays: dict[tuple[int, int], PlainRay], tolerance: float = 1e-13
) -> None:
    assert found["valid"].all()
    for pixel, ray in rays.items():
        expected = ray.back_to_front(np.array([0.5, 0.75, 1.0]))
        for name, value in expected.items():
            np.testing.assert_allclose(found[name][pixel], value, atol=tolerance, err_msg=name)
        assert found["coverage"][pixel] == (expected["thickness"] > 0)


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("highest", [0, 1])
@pytest.mark.parametrize(
    "eye", [(3.0, 2.0, 2.5), (0.1, 0.2, 0.15), (-0.8, 0.9, -0.7)], ids=["outside", "in both", "in one"]
)
@pytest.mark.parametrize("perspective", [True, False])
def test_two_boxes(
    shade: Shade, policy: Overlap, highest: int, eye: tuple[float, float, float], perspective: bool
) -> None:
    target = (0.21, 0.12, 0.05)
    camera = Camera.look_at(eye, target, fov_y=80) if perspective else Camera.orthographic(eye, target, height=2.5)
    bodies = [
        Object(box.tessellate(), medium, priority=int(i == highest))
        for i, (box, medium) in enumerate(((A, RED), (B, BLUE)))
    ]
    scene = Scene(bodies, camera, environment=BACKDROP, overlap=policy)
    origins, directions = camera.rays(SIZE)
    rays = {}
    for pixel in np.ndindex(SIZE[::-1]):
        ends = [box_span(box, origins[pixel], directions[pixel]) for box in (A, B)]
        spans = [(*end, 1, body) for end, body in zip(ends, bodies, strict=True)]
        rays[pixel] = PlainRay(scene, [span for span in spans if span[0] < span[1]])
    found = shade(scene, SIZE)
    assert (found["optical_depth"] > 0).any()
    assert_equal_to_plain_rays(found, rays)


def test_the_three_policies_by_hand(shade: Shade) -> None:
    """Red from 6 to 3, blue from 5 to 1 m above the ground: alone 1 m, both 2 m, alone 2 m."""
    red = Object(Box((-4, -4, 3), (4, 4, 6)).tessellate(), RED, priority=2)
    blue = Object(Box((-4, -4, 1), (4, 4, 5)).tessellate(), BLUE, priority=1)
    camera = Camera.orthographic((0.1, 0.2, 9.0), (0.1, 0.2, 0.0), height=0.5)

    def pixel(policy: Overlap, *bodies: Object) -> tuple[float, ...]:
        found = shade(Scene(bodies, camera, environment=BACKDROP, overlap=policy), (1, 1))
        depth = found["optical_depth"][0, 0]
        np.testing.assert_allclose(found["transmittance"][0, 0], np.exp(-depth), rtol=1e-15)
        return found["thickness"][0, 0], *depth, found["radiance"][0, 0, 2]

    T = np.exp(-0.3)  # of one metre of blue in its blue channel, in which red absorbs nothing
    glow = 0.9 / 0.3  # and its source
    alone = 1.0 * T**4 + glow * (1 - T**4)
    both = (0.9 + 0.1) / 0.3
    mixed = 0.1 + both * (1 - T**2) + T**2 * (glow * (1 - T**2) + T**2)
    red_only = 0.1 * 3 + glow * (1 - T**2) + T**2
    for bodies in ((red, blue), (blue, red)):
        assert pixel("add", *bodies) == pytest.approx((7, 1.5 + 6, 3 + 0.8, 1.2, mixed), rel=1e-14)
        assert pixel("union", *bodies) == pytest.approx((5, 1.5 + 6, 3 + 0.8, 1.2, mixed), rel=1e-14)
        assert pixel("priority", *bodies) == pytest.approx((5, 1.5 + 3, 3 + 0.4, 0.6, red_only), rel=1e-14)
    assert pixel("priority", replace(red, priority=0), blue) == pytest.approx(
        (5, 0.5 + 6, 1 + 0.8, 1.2, 0.1 + alone), rel=1e-14
    )


@pytest.mark.parametrize("policy", POLICIES)
def test_two_balls(shade: Shade, policy: Overlap) -> None:
    """Rays near the middle: each end of a chord is nearer than the sphere by what the sagitta makes of it."""
    segments, radius, reach = 128, 1.0, 0.4
    camera = Camera.orthographic((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), height=2 * reach)
    bodies = []
    for (x, z), medium, priority in zip(((0.1, 0.5), (-0.1, -0.5)), (RED, BLUE), (1, 2), strict=True):
        bodies.append(Object(Sphere((x, 0.0, z), radius).tessellate(segments), medium, priority=priority))
    scene = Scene(bodies, camera, environment=BACKDROP, overlap=policy)
    rays = {}
    for pixel in np.ndindex(8, 8):
        x, y, _ = camera.rays((8, 8))[0][pixel]
        solids = []
        for center, z, body in ((0.1, 0.5, bodies[0]), (-0.1, -0.5, bodies[1])):
            half = np.sqrt(radius**2 - (x - center) ** 2 - y**2)
            solids.append((4.0 - z - half, 4.0 - z + half, 1, body))
        rays[pixel] = PlainRay(scene, solids)
    off = (reach * np.sqrt(2) + 0.1) ** 2
    moved = np.sqrt(radius**2 - off) - np.sqrt((radius - Sphere().sagitta(segments)) ** 2 - off)
    # Four ends; a metre changes depth by up to 2, radiance by up to emission 1 plus depth times radiance 1.
    assert_equal_to_plain_rays(shade(scene, (8, 8)), rays, tolerance=4 * moved * 3)


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("inside_out", [False, True])
def test_a_hundred_nested_boxes(shade: Shade, policy: Overlap, inside_out: bool) -> None:
    """All of them around the middle: 200 surfaces. With priorities, the inner or the outer ones win."""
    bodies, solids = [], []
    for i in range(100):
        half = 1.0 + i / 50
        medium = Medium(absorption=(0.01 * (i % 3), 0.02, 0.0), emission=(0.01 * (i % 5), 0.0, 0.03))
        box = Box((-half, -half, -half), (half, half, half))
        bodies.append(Object(box.tessellate(), medium, priority=i if inside_out else -i))
        solids.append((6.0 - half, 6.0 + half, 1, bodies[-1]))
    scene = Scene(bodies[::-1], DOWN, environment=BACKDROP, overlap=policy)
    rays = dict.fromkeys(np.ndindex(2, 2), PlainRay(scene, solids))
    assert_equal_to_plain_rays(shade(scene, (2, 2)), rays, tolerance=1e-11)  # sums of 200 terms up to 300


def test_shells_in_one_mesh(shade: Shade) -> None:
    """50 hollow boxes: a gap after every wall, so nothing overlaps, and all policies agree."""
    parts = [Box((-h, -h, -h), (h, h, h)).tessellate() for h in 1 + np.arange(100) / 50]
    faces = np.concatenate([part.faces[:, :: 1 if i % 2 else -1] + 8 * i for i, part in enumerate(parts)])
    body = Object(Mesh(np.concatenate([part.vertices for part in parts]), faces), RED)
    for policy in POLICIES:
        scene = Scene([body], DOWN, environment=BACKDROP, overlap=policy)
        walls = [(1 + i / 50, 1 + (i + 1) / 50) for i in range(0, 100, 2)]
        solids = [
            (6 + s * (a if s > 0 else b), 6 + s * (b if s > 0 else a), 1, body) for a, b in walls for s in (-1, 1)
        ]
        rays = dict.fromkeys(np.ndindex(2, 2), PlainRay(scene, solids))
        assert_equal_to_plain_rays(shade(scene, (2, 2)), rays, tolerance=1e-12)


@pytest.mark.parametrize("policy", POLICIES)
def test_a_mesh_that_overlaps_itself(shade: Shade, policy: Overlap) -> None:
    a, b = A.tessellate(), B.tessellate()
    body = Object(Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.faces, b.faces + 8])), RED)
    scene = Scene([body], DOWN, environment=BACKDROP, overlap=policy)
    # A is 5.5 to 7 m away, B 4.5 to 6.25 m.
    ray = PlainRay(scene, [(4.5, 5.5, 1, body), (5.5, 6.25, 2, body), (6.25, 7.0, 1, body)])
    found = shade(scene, (2, 2))
    assert_equal_to_plain_rays(found, dict.fromkeys(np.ndindex(2, 2), ray))
    assert found["thickness"] == pytest.approx(np.full((2, 2), 3.25 if policy == "add" else 2.5), rel=1e-14)


@pytest.mark.parametrize("policy", POLICIES)
def test_coincident_bodies(shade: Shade, policy: Overlap) -> None:
    """The same box three times: twice in one medium of equal values, once in another."""
    twin = Medium(absorption=RED.absorption, emission=RED.emission, ior=1.3, anisotropy=0.5)
    bodies = [
        Object(A.tessellate(), medium, priority=priority) for medium, priority in ((RED, 1), (BLUE, 2), (twin, 1))
    ]
    camera = Camera.look_at((3.0, 2.0, 2.5), (0, 0, 0), fov_y=40)
    found = shade(Scene(bodies, camera, overlap=policy), SIZE)
    metres = A.chord(*camera.rays(SIZE))
    assert found["valid"].all()
    np.testing.assert_allclose(found["thickness"], metres * (3 if policy == "add" else 1), atol=1e-14)
    extinction = {
        "add": 2 * RED.extinction + BLUE.extinction,
        "union": RED.extinction + BLUE.extinction,
        "priority": BLUE.extinction,
    }[policy]
    np.testing.assert_allclose(found["optical_depth"], metres[..., None] * extinction, atol=1e-13)


def glass_and_wine(overlap: float, turn: Array) -> tuple[Object, Object]:
    """A shell of glass from 1 to 1.2 m, and wine in it, which goes into the glass by `overlap` metres."""
    glass = Object(SphericalShell(outer=1.2, inner=1.0).tessellate(48), CLEAR, turn, priority=1)
    return glass, Object(Sphere(radius=1.0 + overlap).tessellate(48), RED, turn)


@pytest.mark.parametrize("overlap", [0.0, 1e-12, 1e-3])
@pytest.mark.parametrize("turned", [False, True])
def test_wine_in_a_glass_neither_leaks_nor_flickers(shade: Shade, overlap: float, turned: bool) -> None:
    turn = np.eye(4)
    if turned:
        turn[:3, :3] = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
        turn[:3, 3] = (0.1, 0.2, 0.3)
    bodies = glass_and_wine(overlap, turn)
    camera = Camera.look_at((1.0, 2.0, 5.0), turn[:3, 3], fov_y=35)
    found, glass, cup = (
        shade(Scene(objects, camera, overlap="priority"), SIZE)
        for objects in (bodies, bodies[:1], [Object(Sphere(radius=1.2).tessellate(48), CLEAR, turn)])
    )
    assert found["valid"].all()
    assert found["coverage"].any()
    # Glass and what is in it fill the cup, and the glass keeps all of its own.
    np.testing.assert_allclose(found["thickness"], cup["thickness"], atol=1e-13)
    wine = cup["thickness"] - glass["thickness"]
    expected = glass["optical_depth"] + wine[..., None] * RED.extinction
    np.testing.assert_allclose(found["optical_depth"], expected, atol=1e-12)
    if overlap == 0:
        for policy in ("add", "union"):
            touching = shade(Scene(bodies, camera, overlap=policy), SIZE)
            for name in ("thickness", "optical_depth", "radiance"):
                np.testing.assert_allclose(touching[name], found[name], atol=1e-12)


def sheet(z: float, medium: Medium, path: float) -> Object:
    square = Mesh([(-4, -4, z), (4, -4, z), (4, 4, z), (-4, 4, z)], [(0, 1, 2), (0, 2, 3)], name="sheet")
    return Object(square, medium, sheet_thickness=path, priority=-1)


@pytest.mark.parametrize("policy", POLICIES)
def test_sheets_between_and_within_emitters(shade: Shade, policy: Overlap) -> None:
    """Before, in, on the surface of, and behind two slabs; none of them loses to a solid. One is behind the eye."""
    slabs = [
        Object(Box((-4, -4, low), (4, 4, high)).tessellate(), medium, priority=i)
        for i, (low, high, medium) in enumerate(((1, 3, RED), (2, 4, BLUE)))
    ]
    heights = (5.0, 3.5, 3.0, 2.5, 1.0, 0.5)
    sheets = [sheet(z, m, 0.1 * (i + 1)) for i, (z, m) in enumerate(zip(heights, [BLUE, RED, CLEAR] * 2, strict=True))]
    scene = Scene([*sheets, *slabs, sheet(6.5, RED, 1.0)], DOWN, environment=BACKDROP, overlap=policy)
    solids = [(3.0, 5.0, 1, slabs[0]), (2.0, 4.0, 1, slabs[1])]
    ray = PlainRay(
        scene, solids, [(6.0 - z, s.sheet_thickness or 0.0, s) for z, s in zip(heights, sheets, strict=True)]
    )
    assert_equal_to_plain_rays(shade(scene, (2, 2)), dict.fromkeys(np.ndindex(2, 2), ray))


def test_extreme_media_do_not_break_the_sums(shade: Shade) -> None:
    thick, thin = Medium(absorption=1e300, emission=1e18), Medium(absorption=1e-300, emission=1e-300)
    objects = [Object(A.tessellate(), thick), Object(B.tessellate(), thin), sheet(-3.0, thick, 1e10)]
    for policy in POLICIES:
        found = shade(Scene(objects, DOWN, overlap=policy), (2, 2))
        assert not found["valid"].any(), "an optical depth of 1e310 is no number"
        assert np.isfinite(found["radiance"]).all()
        assert (found["transmittance"] == 0).all()
        assert (found["optical_depth"] == np.inf).all()


def test_what_shines_from_behind_a_thick_medium_vanishes_silently(shade: Shade) -> None:
    front, back = Medium(absorption=400.0), Medium(emission=1e-10)
    objects = [Object(Box((-4, -4, z), (4, 4, z + 2)).tessellate(), m) for z, m in ((2, front), (-3, back))]
    seen = shade(Scene(objects, DOWN, environment=Environment.constant(1e-20)), (1, 1))
    assert seen["valid"].all()
    assert seen["optical_depth"][0, 0, 0] == 800.0
    assert (seen["radiance"] == 0).all()
    nearly = shade(Scene([*objects[1:], Object(objects[0].mesh, Medium(absorption=355.0))], DOWN), (1, 1))
    assert 0 < nearly["radiance"][0, 0, 0] < 1e-307


def test_render_tells_the_same(shade: Shade) -> None:
    bodies = [Object(A.tessellate(), RED, priority=1), Object(B.tessellate(), BLUE)]
    for policy in POLICIES:
        scene = Scene(bodies, Camera.look_at((3.0, 2.0, 2.5), (0, 0, 0)), environment=BACKDROP, overlap=policy)
        frame, found = render(scene, SIZE), shade(scene, SIZE)
        for name, array in found.items():
            np.testing.assert_array_equal(getattr(frame, name), array)
