"""Shadows of bodies on a picture drawn elsewhere: as on the same opaque objects where we draw them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from tests.values.plan_scenes import plan_over_backdrop
from translucent.geometry.solids import Box, Sphere

Array = npt.NDArray[Any]

SIZE = (96, 72)
WINE = tl.Medium(absorption=(0.5, 2.0, 1.0))
BALL = Sphere(center=(0.0, 0.2, 0.0), radius=0.5).tessellate(32)
CORNERS = np.array([(-4.0, -0.5, -4.0), (4.0, -0.5, -4.0), (4.0, -0.5, 4.0), (-4.0, -0.5, 4.0)])
FLOOR = tl.Object(tl.Mesh(CORNERS, [(0, 2, 1), (0, 3, 2)], name="floor"), color="white")
# Behind the ball, so that there is an edge where the floor meets what is steep.
WALL = tl.Object(tl.Mesh(CORNERS[:, [0, 2, 1]] + (0.0, 3.0, -0.6), [(0, 2, 1), (0, 3, 2)], name="wall"), color="white")
CAMERAS = {
    "perspective": tl.Camera.look_at((1.0, 2.6, 4.0), (0.2, -0.2, 0.0), fov_y=40),
    "orthographic": tl.Camera.orthographic((1.0, 2.6, 4.0), (0.2, -0.2, 0.0), height=3.2),
}
SUN = tl.DirectionalLight((0.9, -1.5, -0.5), (2.5, 2.0, 1.5))
LAMP = tl.PointLight((-1.0, 1.6, 0.8), (4.0, 4.0, 5.0))
SPOT = tl.SpotLight((-1.0, 2.0, 1.0), (1.0, -2.2, -1.0), (9.0, 8.0, 7.0), 15, 25)
EVEN = tl.Environment.constant((0.1, 0.2, 0.3))
SKY = tl.Environment.gradient((0.1, 0.1, 0.1), (1.0, 0.8, 0.6))
DARK = tl.Environment.constant(0.0)


def scene(lights: list[tl.Light], environment: tl.Environment, camera: str, **options: Any) -> tl.Scene:
    return tl.Scene([tl.Object(BALL, WINE)], CAMERAS[camera], lights, environment, **options)


def metres(camera: tl.Camera, objects: list[tl.Object]) -> Array:
    """(h, w): along the forward axis, to the nearest of some planes."""
    origins, rays = (np.broadcast_to(array, (*SIZE[::-1], 3)) for array in camera.rays(SIZE))
    found = np.full(SIZE[::-1], np.inf)
    for item in objects:
        normal, low, high = item.mesh.face_normals[0], *item.bounds
        with np.errstate(divide="ignore"):
            path = (item.mesh.vertices[0] - origins) @ normal / (rays @ normal)
        points = origins + path[..., None] * rays
        inside = ((points >= low - 1e-9) & (points <= high + 1e-9)).all(axis=-1) & (path > 0)
        found = np.where(inside, np.minimum(found, ((points - camera.eye) @ camera.forward)), found)
    return found


def shares(renderer: tl.Renderer, shown: tl.Scene, planes: list[tl.Object]) -> tuple[Array, Array, Array]:
    """Radiance with shadows over that without: on a picture, and on opaque objects of ours; where the two are seen."""
    full = dataclasses.replace(shown, objects=[*shown.objects, *planes])
    clear = dataclasses.replace(full, objects=[tl.Object(BALL, tl.Medium()), *planes])
    depth = metres(shown.camera, planes)
    picture = renderer.render(clear, SIZE).radiance
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(picture, depth))
    ours = renderer.render(full, SIZE)
    beside = ~frame.coverage & np.isfinite(depth) & (picture > 0).all(axis=-1)
    divisor = np.where(beside[..., None], picture, 1.0)
    return frame.radiance / divisor, ours.radiance / divisor, beside


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(
    ("lights", "environment", "directions"),
    [([SUN], DARK, 0), ([SUN, LAMP], EVEN, 0), ([SPOT, LAMP], SKY, 0), ([SUN], SKY, 16), ([], SKY, 8)],
    ids=["sun", "lamp", "spot", "sky and sun", "sky"],
)
def test_a_picture_of_a_floor_is_shadowed_as_the_floor(
    renderer: tl.Renderer, camera: str, lights: list[tl.Light], environment: tl.Environment, directions: int
) -> None:
    shown = scene(lights, environment, camera, environment_shadows=directions)
    # A wall keeps the sky from the floor, which nobody tells of a picture.
    found, expected, beside = shares(renderer, shown, [FLOOR] if directions else [FLOOR, WALL])
    assert expected[beside].min() < 0.8  # in a shadow
    assert expected[beside].min(axis=0).std() > 0.02  # which has a color
    error = np.abs(found - expected)[beside].max(axis=-1)
    # Maps are those of other cameras here than with opaque objects: next to outlines of shadows, where half a texel
    # matters, the two differ; and so they do along the edge between the two planes, where pixels have no one normal.
    assert np.median(error) < 1e-6
    assert np.quantile(error, 0.97) < 3e-4


@pytest.mark.parametrize("camera", CAMERAS)
def test_at_edges_of_depth_a_surface_has_its_own_normal(renderer: tl.Renderer, camera: str) -> None:
    """A slab above all dims a sun overhead alike on a floor and on a shelf, up to the very pixels at its edge."""
    slab = tl.Object(Box((-9, 5, -9), (9, 5.5, 9)).tessellate(), WINE)
    sun = tl.DirectionalLight((0, -1, 0), (2.5, 2.0, 1.5))
    shown = dataclasses.replace(scene([sun], EVEN, camera), objects=[slab])
    shelf = tl.Object(tl.Mesh(CORNERS * (0.1, 1.0, 0.2) + (0.0, 0.4, 0.0), [(0, 2, 1), (0, 3, 2)]))
    depth = metres(shown.camera, [FLOOR, shelf])
    on_shelf = depth < metres(shown.camera, [FLOOR])
    assert 100 < on_shelf.sum() < 3000
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(np.ones((*SIZE[::-1], 3)), depth))
    even, sent = np.pi * np.array(EVEN.first), np.asarray(sun.irradiance)
    expected = (even + sent * np.exp(-0.5 * WINE.extinction)) / (even + sent)
    seen = np.isfinite(depth) & ~frame.coverage
    assert seen.mean() > 0.8
    # Normals are quotients of differences between points 4 m from the eye, a few cm apart in float32. Corners that are
    # one pixel wide along both axes have none.
    wrong = np.abs(frame.radiance / expected - 1.0).max(axis=-1)[seen] > 1e-4
    assert np.count_nonzero(wrong) <= 4


def test_no_light_on_the_lights_far_side_changes_nothing(renderer: tl.Renderer) -> None:
    """A sun from below: what it does not reach has no share to lose."""
    shown = scene([tl.DirectionalLight((0.2, 1.0, 0.1), 3.0)], DARK, "perspective")
    depth = metres(shown.camera, [FLOOR])
    picture = np.full((*SIZE[::-1], 3), 0.6, dtype=np.float32)
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(picture, depth))
    np.testing.assert_array_equal(frame.radiance[~frame.coverage], picture[~frame.coverage])


def test_what_is_far_behind_gets_no_shadow(renderer: tl.Renderer) -> None:
    shown = scene([SUN], DARK, "perspective")
    picture = np.random.default_rng(3).uniform(0.1, 2.0, (*SIZE[::-1], 3)).astype(np.float32)
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(picture, np.full(SIZE[::-1], np.inf)))
    np.testing.assert_array_equal(frame.radiance[~frame.coverage], picture[~frame.coverage])


def test_without_lights_nothing_is_planned_and_nothing_changes(renderer: tl.Renderer) -> None:
    shown = scene([], SKY, "perspective")
    depth = metres(shown.camera, [FLOOR])
    picture = np.random.default_rng(4).uniform(0.1, 2.0, (*SIZE[::-1], 3)).astype(np.float32)
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(picture, depth))
    assert [step.name for step in frame.plan.passes] == ["backdrop", "signed_depth", "transmittance"]
    np.testing.assert_array_equal(frame.radiance[~frame.coverage], picture[~frame.coverage])


def test_light_from_all_around_may_be_another_than_the_environment_s(renderer: tl.Renderer) -> None:
    """Shadows are as deep as if the scene had this environment."""
    shown = scene([SUN], SKY, "perspective")
    depth, picture = metres(shown.camera, [FLOOR]), np.ones((*SIZE[::-1], 3))
    frame = renderer.render(shown, SIZE, backdrop=tl.Backdrop(picture, depth, ambient=(0.1, 0.2, 0.3)))
    other = dataclasses.replace(shown, environment=EVEN)
    expected = renderer.render(other, SIZE, backdrop=tl.Backdrop(picture, depth))
    beside = ~frame.coverage
    assert expected.radiance[beside].min() < 0.5
    np.testing.assert_allclose(frame.radiance[beside], expected.radiance[beside], rtol=1e-6)
    with pytest.raises(tl.InputError, match="ambient radiance of a backdrop"):
        tl.Backdrop(picture, depth, ambient=-1.0)


def test_the_plan_counts_the_views_from_lights() -> None:
    shown = scene([SUN, LAMP], SKY, "perspective", environment_shadows=4)
    step = plan_over_backdrop(shown).passes[0]
    assert (step.name, step.geometry_passes) == ("shadow_maps", 6)
    assert "2 lights and 4 directions of the environment on the backdrop" in step.reason
