"""Shadows of lights on interfaces of bodies: opaque objects block highlights and paint, on the GPU and elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan

SIZE = (48, 36)
DARK = tl.Environment.constant((0, 0, 0))
SMALL = (32, 24)
CAMERA = tl.Camera.look_at((0, 1.5, 7), (0, 0, 0), fov_y=30)
LIGHTS = {
    "sun": tl.DirectionalLight((1, -1.5, -1), (2, 2, 2)),
    "lamp": tl.PointLight((-2, 3, 2), (20, 20, 20)),
    "spot": tl.SpotLight((-2, 3, 2), (2, -3, -2), (20, 20, 20), 40, 45),
}
# So dark that nothing behind their face is seen.
DENSE = tl.Medium(absorption=100, ior=1.5)
WINE, TEA = tl.Medium(absorption=(1, 2, 4)), tl.Medium(absorption=(3, 1, 0.5))
PARTS = {"highlight": tl.Surface(roughness=0.5), "paint": tl.Surface(transmission=0.0)}
BALL, CUBE = Sphere().tessellate(32), Box((-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)).tessellate()
_PARTS = [
    trimesh.creation.box((size,) * 3, trimesh.transformations.translation_matrix(at))
    for size, at in ((1.8, (0, 0, 0)), (0.6, (-0.8, 1.8, 1.0)))
]
WITH_A_WALL = tl.Mesh(*(getattr(trimesh.util.concatenate(_PARTS), name) for name in ("vertices", "faces")))
BEHIND, HALF, BESIDE = (-1.0, 1.5, 1.0), (-2.2, 0.7, 1.0), (-3.6, -1.6, -2.6)
AWAY = (3.0, -3.0, -3.0)  # from the lights and from the picture: a wall there spares shaders for bodies that are alone
NEAR_BEHIND = (-1.05, 1.55, 1.0)

Place = tuple[float, float, float]


def wall(place: Place, medium: tl.Medium | None = None) -> tl.Object:
    """A black block that stands across the ways of the lights, half as thick as it is far from them."""
    block = Box((-1.1, -1.4, -0.1), (1.1, 1.4, 0.1)).tessellate()
    turn = trimesh.geometry.align_vectors((0, 0, 1), (-1, 1.5, 1))
    return tl.Object(block, medium, trimesh.transformations.translation_matrix(place) @ turn, color=(0, 0, 0))


def scene(light: str, part: str, *others: tl.Object, mesh: tl.Mesh = BALL) -> tl.Scene:
    return tl.Scene([tl.Object(mesh, DENSE, surface=PARTS[part]), *others], CAMERA, [LIGHTS[light]], DARK)


WAYS = ("front", "screen", "traced", "cpu")


@pytest.fixture(params=WAYS)
def shown(request: pytest.FixtureRequest, renderer: tl.Renderer) -> Iterator[Any]:
    """Radiance of a scene by all that shade interfaces."""
    kinds = {
        "front": tl.FrontInterface(),
        "screen": tl.ScreenInterfaces(),
        "traced": tl.TracedInterfaces(),
        "cpu": None,
    }

    def radiance(drawn: tl.Scene, one: tl.Renderer) -> npt.NDArray[np.float32]:
        return one.render(drawn, SIZE, samples=1, interfaces=kinds[request.param]).radiance

    if request.param == "cpu":
        with tl.Renderer(backend="cpu") as cpu:
            yield lambda drawn: radiance(drawn, cpu)
    else:
        yield lambda drawn: radiance(drawn, renderer)


#: Paint where rays are traced is compared with the reference below, in shadows and beside them.
BEHIND_WALLS = [(way, part) for way in WAYS for part in PARTS if (way, part) != ("traced", "paint")]


@pytest.mark.parametrize(("shown", "part"), BEHIND_WALLS, indirect=["shown"])
@pytest.mark.parametrize("light", LIGHTS)
def test_no_light_reaches_a_ball_behind_a_wall(shown: Any, light: str, part: str) -> None:
    """And all of it reaches one beside it."""
    alone = shown(scene(light, part, wall(AWAY)))
    assert alone.max() > 0.05
    assert shown(scene(light, part, wall(BEHIND))).max() <= 1e-6 * alone.max()
    np.testing.assert_allclose(shown(scene(light, part, wall(BESIDE))), alone, rtol=1e-4, atol=1e-5 * alone.max())


def test_nor_does_it_reach_paint_on_paths_and_bodies_dim_it(renderer: tl.Renderer) -> None:
    """A scene in which nothing is left to chance: the paint has no interface over it."""
    ball = tl.Object(BALL, tl.Medium(absorption=100), surface=PARTS["paint"])

    def shown(stone: Place, wine: Place) -> tl.Scene:
        return tl.Scene([ball, wall(stone), wall(wine, WINE)], CAMERA, [LIGHTS["sun"]], DARK)

    def radiance(drawn: tl.Scene) -> npt.NDArray[np.float32]:
        return renderer.render(drawn, SMALL, tl.PathTraced(2)).radiance

    dimmed = shown(BESIDE, BEHIND)
    truth = tl.reference.render(dimmed, SMALL, refraction=True, paths=2).radiance
    assert truth.max() > 0.05
    # Rays know normals to 6.5e-5.
    assert np.quantile(np.abs(radiance(dimmed) - truth), 0.99) < 5e-5 * truth.max()
    assert radiance(shown(BEHIND, BESIDE)).max() <= 1e-6 * truth.max()


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("light", ["sun", "lamp"])
def test_a_shadow_on_a_body_is_the_reference_s(shown: Any, light: str, part: str) -> None:
    """On flat faces, where a pixel's normals make no highlight rougher, and but for a texel at its edge."""
    drawn = scene(light, part, wall(HALF), mesh=CUBE)
    truth = tl.reference.render(drawn, SIZE, refraction=True, paths=2).radiance
    alone = shown(scene(light, part, wall(AWAY), mesh=CUBE))
    least = 1e-3 * alone.max()
    share = (truth > least).sum() / (alone > least).sum()
    assert 0.1 < share < 0.9
    error = (np.abs(shown(drawn) - truth).max(axis=-1) / truth.max())[alone.max(axis=-1) > least]
    print(f"lit {share:.2f}, of {error.size} pixels median {np.median(error):.1e}, p95 {np.quantile(error, 0.95):.1e}")
    assert np.quantile(error, 0.95) < 1e-5


@pytest.mark.parametrize("part", PARTS)
def test_other_bodies_dim_light_on_a_body_as_the_reference_has_it_or_the_plan_tells(
    renderer: tl.Renderer, part: str
) -> None:
    drawn = scene("lamp", part, wall(BEHIND, WINE), mesh=CUBE)
    truth = tl.reference.render(drawn, SIZE, refraction=True, paths=2).radiance
    with tl.Renderer(backend="cpu") as cpu:
        # Paint is seen on the GPU below.
        frames = [one.render(drawn, SIZE, samples=1) for one in (cpu, renderer)[: 1 if part == "paint" else 2]]
        alone = cpu.render(scene("lamp", part, mesh=CUBE), SIZE, samples=1).radiance
    for frame in frames:
        # Light that leaves the cube again next to its edges is found by two random paths.
        assert np.quantile(np.abs(frame.radiance - truth), 0.995) < 5e-6 * truth.max()
        assert not frame.plan.says(NoteKind.SHADOWS)
    share = truth.max(axis=(0, 1)) / alone.max(axis=(0, 1))
    assert (share > 0.05).all()
    assert (np.diff(share) < 0).all()
    assert share[0] < 0.9
    assert plan(drawn, interfaces=tl.FrontInterface()).says(NoteKind.SHADOWS)


#: What is between a lamp and a painted cube.
BETWEEN: dict[str, list[tl.Object]] = {
    "wine in tea": [wall(BEHIND, TEA), wall(NEAR_BEHIND, WINE)],
    "a sheet": [replace(wall(BEHIND, WINE), sheet_thickness=0.1)],
    "a body around the lamp": [tl.Object(BALL, WINE, trimesh.transformations.translation_matrix((-2, 3, 2)))],
    "a body behind the lamp": [wall((-3, 4.5, 3), WINE)],
    "a part of the body": [tl.Object(WITH_A_WALL, replace(WINE, ior=1.5), surface=PARTS["paint"])],
}


@pytest.mark.parametrize("name", BETWEEN)
def test_what_is_between_a_lamp_and_a_body_dims_it_as_in_the_reference(renderer: tl.Renderer, name: str) -> None:
    cube = tl.Object(CUBE, DENSE, surface=PARTS["paint"])
    objects = [wall(AWAY, WINE), *([] if name == "a part of the body" else [cube]), *BETWEEN[name]]
    ranked = [replace(item, priority=i) for i, item in enumerate(objects)]
    drawn = tl.Scene(ranked, CAMERA, [LIGHTS["lamp"]], DARK, overlap="priority")
    truth = tl.reference.render(drawn, SMALL, refraction=True, paths=2).radiance
    frame = renderer.render(drawn, SMALL, samples=1, interfaces=tl.TracedInterfaces(depth=1, forks=0))
    error = np.abs(frame.radiance - truth).max(axis=-1) / truth.max()
    print(f"of {(error > 0).sum()} pixels median {np.median(error[error > 0]):.1e}, p99 {np.quantile(error, 0.99):.1e}")
    assert np.quantile(error, 0.99) < 1e-5
