"""Opaque objects: where they stop rays, what they reflect, and what is seen before them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.solids import Box, Sphere
from translucent.geometry.mesh import Mesh
from translucent.media.medium import Medium
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.planning.methods import ThinLayer
from translucent.reference import hit_counts, render
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight
from translucent.scene.scene import Object, Scene

Array = npt.NDArray[np.float64]
Shade = Callable[..., dict[str, npt.NDArray[Any]]]

MEDIUM = Medium(absorption=(1.0, 2.0, 0.0), emission=(0.3, 0.2, 0.1))
SLAB = Box((-4, -4, 0), (4, 4, 2))
#: Looks along -z from 6 m: what is at height z is 6 - z metres away.
DOWN = Camera.orthographic((0.1, 0.2, 6.0), (0.1, 0.2, 0.0), height=0.5)
GRAY = (0.5, 0.25, 0.125)
DARK = Environment.constant(0.0)


def wall(z: float) -> Mesh:
    """A square of 6 m at height z that looks up."""
    corners = np.array([(-3, -3, z), (3, -3, z), (3, 3, z), (-3, 3, z)])
    return Mesh(corners, [(0, 1, 2), (0, 2, 3)], name="wall")


def pixel(arrays: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """The one pixel of a picture."""
    return {name: array[0, 0] for name, array in arrays.items()}


@pytest.mark.parametrize(
    ("z", "metres"),
    [(5.0, 0.0), (2.0, 0.0), (1.5, 0.5), (0.25, 1.75), (0.0, 2.0), (-1.0, 2.0), (6.0, 0.0), (6.5, 2.0)],
    ids=["in front", "on the near face", "inside", "deep inside", "on the far face", "behind", "at the eye", "past it"],
)
def test_a_slab_is_seen_as_far_as_the_wall(shade: Shade, z: float, metres: float) -> None:
    bodies = [Object(SLAB.tessellate(), MEDIUM), Object(wall(z), color=GRAY)]
    seen = pixel(shade(Scene(bodies, DOWN, environment=Environment.constant(2.0)), (1, 1)))
    assert seen["thickness"] == pytest.approx(metres, abs=1e-14)
    assert seen["optical_depth"] == pytest.approx(np.array([1, 2, 0]) * metres, abs=1e-14)
    behind = np.full(3, 2.0) if z > 6 else 2.0 * np.array(GRAY)
    emitted = np.array([0.3 * -np.expm1(-metres), 0.1 * -np.expm1(-2 * metres), 0.1 * metres])
    assert seen["radiance"] == pytest.approx(behind * np.exp(-seen["optical_depth"]) + emitted, abs=1e-14)
    assert seen["coverage"] == (metres > 0)
    assert seen["valid"]


def test_the_nearest_surface_stops_the_ray_and_of_equal_ones_that_of_the_first_object(shade: Shade) -> None:
    far, near, same = (Object(wall(z), color=color) for z, color in ((1.0, "red"), (3.0, "lime"), (3.0, "blue")))
    for objects in ([far, near, same], [near, same, far], [near, far, same]):
        assert shade(Scene(objects, DOWN), (1, 1))["radiance"][0, 0].tolist() == [0, 1, 0]
    assert shade(Scene([same, near], DOWN), (1, 1))["radiance"][0, 0].tolist() == [0, 0, 1]


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("inverted", [False, True])
def test_both_sides_reflect_alike(shade: Shade, mirrored: bool, inverted: bool) -> None:
    """A gradient and lights tell the side that is seen from the other."""
    mesh = wall(0.0)
    if inverted:
        mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    matrix = np.diag((-1.0 if mirrored else 1.0, 2.0, 3.0, 1.0))
    lights = [
        DirectionalLight((0.0, -3.0, -4.0), (1.0, 2.0, 3.0)),  # at a cosine of 0.8
        DirectionalLight((0.0, 0.0, 1.0), 5.0),  # from below
        PointLight((0.1, 0.2, 2.0), 8.0),
        PointLight((0.1, 0.2, -2.0), 100.0),
    ]
    environment = Environment.gradient(0.0, (0.6, 0.6, 1.2))
    scene = Scene([Object(mesh, None, matrix, color=GRAY)], DOWN, lights, environment)
    # At the center of the picture the first point light stands 2 m straight above: 8 / 2^2.
    irradiance = np.pi * np.array([0.3, 0.3, 0.6]) + 0.8 * np.array([1.0, 2.0, 3.0]) + 2.0
    assert shade(scene, (1, 1))["radiance"][0, 0] == pytest.approx(np.array(GRAY) / np.pi * irradiance, rel=1e-14)


def test_normals_go_through_the_inverse_transpose(shade: Shade) -> None:
    """A 45 degree slope, stretched to twice its height, leans by atan 2 against the light."""
    slope = Mesh([(-1, -1, -1), (1, -1, 1), (1, 1, 1), (-1, 1, -1)], [(0, 1, 2), (0, 2, 3)])
    body = Object(slope, None, np.diag((1.0, 1.0, 2.0, 1.0)), color=1.0 * np.ones(3))
    scene = Scene([body], DOWN, [DirectionalLight((0, 0, -1), np.pi)], DARK)
    assert shade(scene, (2, 2))["radiance"] == pytest.approx(np.full((2, 2, 3), 1 / np.sqrt(5)), rel=1e-14)


def test_a_ball_is_lit_by_the_inverse_square_and_the_cosine(shade: Shade) -> None:
    position, eye = np.array([1.0, 2.0, 3.0]), (0.3, -0.2, 4.0)
    camera = Camera.look_at(eye, (0, 0, 0), fov_y=10.0)
    scene = Scene(
        [Object(Sphere().tessellate(256), color=(1, 1, 1))],
        camera,
        [PointLight(position, np.pi)],
        Environment.gradient(0.0, 0.3),
    )
    origins, directions = camera.rays((16, 16))
    along = -np.einsum("...i,...i", origins, directions)
    nearest = origins + along[..., None] * directions
    point = nearest - np.sqrt(1 - (nearest**2).sum(axis=-1))[..., None] * directions
    towards = position - point
    squared = (towards**2).sum(axis=-1)
    expected = np.einsum("...i,...i", towards, point) / squared**1.5 + 0.3 * (0.5 + point[..., 1] / 3)
    # A face of 256 around leans by up to pi / 256 against the sphere in each of two directions.
    lean = np.pi / 256 * (1 / squared.min() + 0.1)
    np.testing.assert_allclose(shade(scene, (16, 16))["radiance"][..., 0], expected, atol=lean)


def test_orthographic_rays_meet_a_lit_wall_each_at_its_place(shade: Shade) -> None:
    camera = Camera.orthographic((0.1, 0.2, 6.0), (0.1, 0.2, 0.0), height=4.0)
    scene = Scene([Object(wall(1.0), color=(1, 1, 1))], camera, [PointLight((0.5, 0.25, 3.0), np.pi)], DARK)
    x, y, _ = np.moveaxis(camera.rays((7, 5))[0], -1, 0)
    squared = (x - 0.5) ** 2 + (y - 0.25) ** 2 + 4.0
    np.testing.assert_allclose(shade(scene, (7, 5))["radiance"][..., 0], 2.0 / squared**1.5, rtol=1e-14)


def test_a_lit_wall_far_from_the_world_origin(shade: Shade) -> None:
    shift = np.array([3e6, -1e6, 2e6])
    matrix = np.eye(4)
    matrix[:3, 3] = shift

    def scene(matrix: Array, at: Array) -> Scene:
        light = PointLight(np.array((0.25, 0.5, 0.125)) + at, 0.01)
        eye = np.array((0.0, 0.0, 6.0)) + at
        return Scene([Object(wall(0.0), None, matrix)], Camera.look_at(eye, at, fov_y=30), [light])

    near, far = (shade(scene(m, at), (8, 8))["radiance"] for m, at in ((np.eye(4), np.zeros(3)), (matrix, shift)))
    np.testing.assert_array_equal(far, near)


def test_the_eye_in_an_opaque_box_sees_its_walls_only(shade: Shade) -> None:
    inside, outside = Box((-1, -1, 5), (1, 1, 7)).tessellate(), Object(SLAB.tessellate(), MEDIUM)
    camera = Camera.look_at((0.1, 0.2, 6.0), (0.0, 0.0, 0.0), fov_y=120.0)
    seen = shade(Scene([Object(inside, color=GRAY), outside], camera), (16, 16))
    assert not seen["coverage"].any()
    assert (seen["thickness"] == 0).all()
    np.testing.assert_allclose(seen["radiance"], np.broadcast_to(GRAY, (16, 16, 3)), rtol=1e-14)


def test_from_within_a_body_to_a_wall_in_it(shade: Shade) -> None:
    body, screen = Object(SLAB.tessellate(), MEDIUM), Object(wall(0.5))
    for camera in (
        Camera.orthographic((0.1, 0.2, 1.75), (0.1, 0.2, 0.0), height=0.1),
        Camera.look_at((0.1, 0.2, 1.75), (0.1, 0.2, 0.0), fov_y=1e-9),
    ):
        seen = pixel(shade(Scene([body, screen], camera), (1, 1)))
        assert seen["thickness"] == pytest.approx(1.25, abs=1e-14)
        assert seen["valid"]


def opened(side: int) -> Mesh:
    """The slab without its lower (0) or upper (1) side."""
    mesh = SLAB.tessellate()
    keep = ~(mesh.vertices[mesh.faces][..., 2] == SLAB.high[2] * side).all(axis=1)
    return Mesh(mesh.vertices, mesh.faces[keep], name="open")


def test_a_hole_matters_only_before_the_wall(shade: Shade) -> None:
    def seen(side: int, z: float | None) -> dict[str, Any]:
        objects = [Object(opened(side), MEDIUM)] + ([] if z is None else [Object(wall(z))])
        return pixel(shade(Scene(objects, DOWN), (1, 1)))

    assert not seen(0, None)["valid"]
    assert not seen(1, None)["valid"]
    behind = seen(0, 0.5)
    assert behind["valid"]
    assert behind["thickness"] == pytest.approx(1.5, abs=1e-14)
    # Such as a ground below a body without a bottom: the ray is not in the body any more when it ends.
    assert not seen(0, -1.0)["valid"]
    # A ray that leaves without having entered gives the hole away, also behind the wall.
    assert not seen(1, -1.0)["valid"]
    assert not seen(1, 0.5)["valid"]
    in_front = seen(1, 5.0)
    assert in_front["valid"]
    assert not in_front["coverage"]


@pytest.mark.parametrize(("below", "counts"), [(-0.5, True), (0.0, True), (0.9, True), (1.1, False)])
@pytest.mark.parametrize("declared", [True, False])
def test_a_sheet_on_an_opaque_surface_is_seen(shade: Shade, below: float, counts: bool, declared: bool) -> None:
    diagonal = 3.0 * np.sqrt(8.0)
    sheet = wall(-below * SHEET_ON_OPAQUE * diagonal)
    objects = [Object(wall(0.0), color=GRAY), Object(sheet, MEDIUM, sheet_thickness=0.25 if declared else None)]
    seen = pixel(shade(Scene(objects, DOWN), (1, 1), ThinLayer(0.25)))
    metres = 0.25 if counts else 0.0
    assert seen["thickness"] == pytest.approx(metres, abs=1e-15)
    assert seen["coverage"] == counts
    emitted = np.array([0.3 * -np.expm1(-metres), 0.1 * -np.expm1(-2 * metres), 0.1 * metres])
    assert seen["radiance"] == pytest.approx(GRAY * np.exp([-metres, -2 * metres, 0.0]) + emitted, abs=1e-14)


def test_opaque_objects_are_never_sheets() -> None:
    objects = [Object(SLAB.tessellate(), MEDIUM), Object(wall(1.0), sheet_thickness=0.5)]
    frame = render(Scene(objects, DOWN), (1, 1), ThinLayer(0.125))
    assert frame.thickness[0, 0] == 0.125
    assert (frame.radiance[0, 0] < 0.6).any()


def test_surfaces_behind_the_wall_do_not_count() -> None:
    sheet = Object(wall(1.0), MEDIUM, sheet_thickness=0.1)
    slabs = [Object(SLAB.tessellate(), MEDIUM), Object(Box((-4, -4, -3), (4, 4, -2)).tessellate(), MEDIUM)]
    for z, count in ((3.0, 0), (1.5, 1), (1.0, 2), (0.5, 2), (-0.5, 3), (-2.5, 4), (-4.0, 5)):
        scene = Scene([sheet, Object(wall(z)), *slabs], DOWN)
        assert (hit_counts(scene, (2, 2)) == count).all()


def test_silhouettes_of_opaque_objects_are_where_the_mesh_is() -> None:
    """A box in a ball, without a gap or an overlap of pixels: the frame of each alone, put together."""
    camera = Camera.look_at((1.0, 2.0, 4.0), (0, 0, 0), fov_y=35.0)
    ball, core = Object(Sphere().tessellate(48), MEDIUM), Box((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3))
    together = render(Scene([ball, Object(core.tessellate())], camera), (48, 32))
    alone = render(Scene([ball], camera), (48, 32))
    hit = core.chord(*camera.rays((48, 32))) > 0
    assert hit.any()
    np.testing.assert_array_equal(together.thickness < alone.thickness, hit)
    for name in ("radiance", "transmittance", "thickness"):
        np.testing.assert_array_equal(getattr(together, name)[~hit], getattr(alone, name)[~hit])
