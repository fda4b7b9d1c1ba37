"""Trees of rays by generations, with hits by Embree: against the tree in one shader, and the same each time."""

from __future__ import annotations

import dataclasses
import sys
import warnings
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError
from typing import Any

import moderngl
import numpy as np
import pytest

import translucent as tl
from tests.ray_probe import embree_hits, scene_center
from tests.rays import agreeing, embree_nearest, random_rays
from translucent.assets import mesh_path
from translucent.geometry.ray_caster import embree_refusal
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.gpu import embree_hits as module
from translucent.gpu.embree_hits import EmbreeHits, mesh_scene
from translucent.gpu.hierarchies import packed_mesh
from translucent.gpu.passes import ray_generations, traced_interfaces
from translucent.planning.render_plan import Capabilities

SIZE = (40, 30)
SKY = tl.Environment.gradient((0.2, 0.3, 0.4), (1.4, 1.2, 1.0))
CAMERA = tl.Camera.look_at((2.0, 1.5, 4.0), (0, 0, 0), fov_y=30.0)
GLASS, RED = tl.Medium(absorption=(0.5, 0.1, 0.9), ior=1.5), tl.Medium(absorption=(0.1, 0.8, 1.2), ior=1.33)
FILM = tl.Medium(absorption=(300.0, 50.0, 100.0))
BALL, CORE, RING = Sphere().tessellate(24), Sphere(radius=0.5).tessellate(24), Torus().tessellate(32)
OPEN = tl.Mesh(BALL.vertices, BALL.faces[: len(BALL.faces) // 2])


@pytest.fixture(autouse=True)
def _embree(renderer: tl.Renderer) -> None:
    if embree_refusal() or not renderer.gpu.capabilities.shader_storage:
        pytest.skip("no Embree, or no compute shaders")


def at(*position: float, by: float = 1.0) -> Any:
    matrix = np.diag([by, by, by, 1.0])
    matrix[:3, 3] = position
    return matrix


def seen(*objects: tl.Object, **rest: Any) -> tl.Scene:
    return tl.Scene(list(objects), **{"camera": CAMERA, "environment": SKY, **rest})


def drink() -> tl.Scene:
    """Wine in a glass: their surfaces coincide, the glass displaces the wine."""
    cup, fill = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    glass = tl.Object(cup, tl.Medium(absorption=5.0, ior=1.54), priority=1)
    wine = tl.Object(fill, tl.Medium(absorption=80.0, ior=1.34))
    return seen(glass, wine, camera=camera, overlap="priority")


def knot() -> tl.Scene:
    return tl.showcase(tl.load_mesh(mesh_path("knot")), tl.Medium(absorption=9.0, ior=1.5), SIZE, environment=SKY)


SCENES: dict[str, Callable[[], tl.Scene]] = {
    "ball": lambda: seen(tl.Object(BALL, GLASS)),
    "knot": lambda: dataclasses.replace(knot(), environment=SKY),
    "drink": drink,
    "film on a ball": lambda: seen(tl.Object(BALL, GLASS), tl.Object(BALL, FILM, sheet_thickness=1e-3)),
    "open ball": lambda: seen(tl.Object(OPEN, GLASS), tl.Object(CORE, RED)),
    "dispersion": lambda: seen(tl.Object(BALL, GLASS, surface=tl.Surface(dispersion=0.5))),
    "rough, from inside": lambda: seen(
        tl.Object(BALL, GLASS, surface=tl.Surface(roughness=0.3)),
        tl.Object(RING, RED, at(0.2, 0, -3.0)),
        camera=tl.Camera.look_at((0.0, 0.1, 0.2), (0.3, 0, -1), fov_y=60.0),
    ),
    "stage that mirrors": lambda: tl.showcase(BALL, tl.Medium(ior=1.5), SIZE),
    "tiny and far": lambda: seen(
        *(tl.Object(BALL, GLASS, at(40.0 * i, -30.0, 5.0 * i, by=10.0**-i)) for i in range(4)),
        camera=tl.Camera.look_at((80.0, -30.0, 10.1), (80.0, -30.0, 10.0), fov_y=20.0),
    ),
}


def rendered(renderer: tl.Renderer, scene: tl.Scene, hits: str, samples: int = 1) -> tl.Frame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.TranslucentWarning)  # of pixels that are not valid
        return renderer.render(scene, SIZE, samples=samples, interfaces=tl.TracedInterfaces(12, 2, hits=hits))


@pytest.mark.parametrize("name", SCENES)
def test_embree_makes_the_picture_of_opengl(renderer: tl.Renderer, name: str) -> None:
    """Both round to float32: a path differs by 1e-7 of the body or so, and a ray at an edge may hit its neighbor."""
    scene = SCENES[name]()
    ours, theirs = (rendered(renderer, scene, hits) for hits in ("embree", "gl"))
    assert (ours.plan.hits, theirs.plan.hits) == ("embree", "gl")
    assert ours.provenance["hits"].startswith("Embree ")
    assert theirs.provenance["hits"] == "OpenGL"
    off = np.abs(ours.radiance - theirs.radiance).max(axis=2)[theirs.coverage]
    assert off.size >= 100
    assert off.mean() <= 1e-4
    assert (off > 1e-2).mean() <= 2e-3
    assert (ours.valid != theirs.valid).mean() <= 2e-3
    assert theirs.valid.all() == (name != "open ball")


@pytest.mark.parametrize("name", ["drink", "dispersion", "stage that mirrors"])
def test_pictures_are_the_same_to_the_last_bit_in_any_portions(
    renderer: tl.Renderer, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, made = SCENES[name](), []
    for most in (ray_generations.MOST_BYTES, ray_generations.MOST_BYTES, 200_000):
        monkeypatch.setattr(ray_generations, "MOST_BYTES", most)
        made.append(rendered(renderer, scene, "embree", samples=5))
    for again in made[1:]:
        np.testing.assert_array_equal(again.radiance, made[0].radiance)
        np.testing.assert_array_equal(again.valid, made[0].valid)


def test_portions_are_divided_where_rays_have_no_room(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = SCENES["dispersion"]()
    whole, divided = rendered(renderer, scene, "embree"), []
    made = ray_generations._parts
    monkeypatch.setattr(
        ray_generations, "_parts", lambda portion, count: divided.append(portion) or made(portion, count)
    )
    monkeypatch.setattr(traced_interfaces, "MOST_LIGHT", 7 * SIZE[0])
    monkeypatch.setattr(ray_generations, "PLACES", 1)
    monkeypatch.setattr(ray_generations, "MORE_PLACES", 2)
    monkeypatch.setattr(ray_generations, "LEAST_PLACES", 1)
    np.testing.assert_array_equal(rendered(renderer, scene, "embree").radiance, whole.radiance)
    assert divided


def horizons_of(renderer: tl.Renderer, scene: tl.Scene) -> Any:
    gpu = renderer.gpu
    buffer = gpu._resources.hierarchies.of(scene).horizons
    with gpu.context.current():
        return None if buffer is None else np.frombuffer(buffer.read(), np.float32)


@pytest.mark.parametrize("inverted", [False, True])
def test_rays_above_the_horizon_of_a_triangle_hit_nothing(
    renderer: tl.Renderer, inverted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a ring, whose triangles near the hole look at others; pictures stay the same but for rounding."""
    mesh = tl.Mesh(RING.vertices, RING.faces[:, ::-1] if inverted else RING.faces)
    uneven = np.diag([1.0, 1.2, 1.0, 1.0])
    scenes = [seen(tl.Object(mesh, GLASS, matrix)) for matrix in (at(0.1, 0, 0, by=0.8), uneven)]
    rays, made = list[int](), EmbreeHits.nearest
    monkeypatch.setattr(EmbreeHits, "nearest", lambda hits, *ray: rays.append(len(ray[0])) or made(hits, *ray))

    def drawn(scene: tl.Scene) -> tuple[Any, int]:
        rays.clear()
        return rendered(renderer, scene, "embree").radiance, sum(rays)

    before = [drawn(scene) for scene in scenes]
    assert horizons_of(renderer, scenes[1]) is None
    monkeypatch.setattr(ray_generations, "RAYS_BEFORE_HORIZONS", 0)
    monkeypatch.setattr(ray_generations, "FOR_EACH_TRIANGLE", 0)
    after = [drawn(scene) for scene in scenes]
    for (one, _), (other, _) in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    assert after[0][1] < 0.85 * before[0][1]
    assert after[1][1] == before[1][1]  # angles in the mesh are not those in the world
    sines = horizons_of(renderer, scenes[0])
    packed = packed_mesh(mesh)
    corners = packed.triangles.view(np.float32).reshape(-1, 3, 4)[..., :3].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * (-1.0 if inverted else 1.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rng = np.random.default_rng(3)
    number = np.repeat(np.arange(len(sines)), 40)
    weights = rng.dirichlet((0.3, 0.3, 0.3), len(number))
    directions = rng.normal(size=(len(number), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= np.sign(np.einsum("ij,ij->i", directions, normals[number]))[:, None]
    above = np.einsum("ij,ij->i", directions, normals[number]) > sines[number]
    origins = np.einsum("ij,ijk->ik", weights, corners[number]) + 3e-6 * normals[number]
    hit = mesh_scene(mesh).run(origins.astype(np.float32), directions.astype(np.float32)) >= 0
    assert not (hit & above).any()
    assert above[~hit].mean() > 0.6


def test_one_pixel_has_room_for_all_its_rays(renderer: tl.Renderer) -> None:
    """More of them are alive at once than there are places to a pixel on average."""
    plates = [tl.Object(Box((-1, -1, -z - 0.4), (1, 1, -z)).tessellate(1), tl.Medium(ior=2.0)) for z in (0, 0.5, 1)]
    camera = tl.Camera.look_at((0.3, 0.1, 5), (0.2, 0.1, 0), fov_y=0.01)
    scene = tl.Scene(plates, camera, environment=tl.Environment.constant((1, 1, 1)))
    ours = renderer.render(scene, (1, 1), interfaces=tl.TracedInterfaces(forks=4, hits="embree"))
    np.testing.assert_allclose(ours.radiance, 1.0, rtol=1e-5)


def test_a_body_that_moves_is_hit_where_it_is(renderer: tl.Renderer) -> None:
    for place in ((0.0, 0.0, 0.0), (0.4, -0.2, 0.3)):
        scene = seen(tl.Object(BALL, GLASS, at(*place)), tl.Object(CORE, RED))
        ours, theirs = (rendered(renderer, scene, hits) for hits in ("embree", "gl"))
        assert np.abs(ours.radiance - theirs.radiance).mean() < 1e-4


@pytest.fixture
def crowd(monkeypatch: pytest.MonkeyPatch) -> Iterator[tl.Scene]:
    """Large and small bodies, moved, rotated and mirrored; the large ones have their own Embree scenes."""
    monkeypatch.setattr(module, "OWN_SCENE", len(RING.faces))
    monkeypatch.setattr(module, "MOST_OWN", 3)
    rng = np.random.default_rng(5)
    objects = []
    for number in range(9):
        turned = np.eye(4)
        turned[:3, :3] = 10.0 ** rng.uniform(-2, 0) * np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag((1, -1, 0.6))
        turned[:3, 3] = 3.0 * rng.normal(size=3)
        objects.append(tl.Object((RING, BALL)[number % 2], GLASS, turned))
    return seen(*objects)


def test_random_rays_hit_what_they_hit_in_each_mesh(crowd: tl.Scene) -> None:
    hits = EmbreeHits(crowd, scene_center(crowd))
    origins, directions = random_rays(crowd, 40_000, np.random.default_rng(7))
    away = np.arange(len(origins)) % 5 == 0
    origins[away] -= 1e4 * directions[away]
    ours = embree_hits(crowd, hits, origins, directions)
    near = ~away
    alike = agreeing(crowd, ours, embree_nearest(crowd, origins, directions))
    assert (ours.object >= 0).mean() > 0.3
    assert (~alike[near]).mean() <= 1e-4
    assert (~alike[away]).mean() <= 1e-2  # float32 has no finer origins so far away


def test_what_cannot_be_had_is_refused_or_told(renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, software = SCENES["ball"](), Capabilities(software=True)
    assert tl.plan(scene, capabilities=software).hits == "embree"
    assert tl.plan(scene, capabilities=Capabilities()).hits == "gl"
    assert tl.plan(scene, capabilities=dataclasses.replace(software, shader_storage=False)).hits == "gl"
    assert tl.plan(scene, interfaces=tl.ScreenInterfaces()).hits == ""
    with pytest.raises(tl.InputError, match=r"no compute shaders, which need version 4\.3; leave hits out"):
        tl.plan(scene, capabilities=Capabilities(shader_storage=False), interfaces=tl.TracedInterfaces(hits="embree"))
    with pytest.raises(tl.InputError, match="this renderer does not use OpenGL; omit hits"):
        tl.plan(scene, capabilities=Capabilities(opengl=False), interfaces=tl.TracedInterfaces(hits="gl"))
    with pytest.raises(
        tl.InputError, match="TracedInterfaces hits 'cuda'; no ray caster has this name; use 'embree' or 'gl'"
    ):
        tl.TracedInterfaces(hits="cuda")
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    told = tl.plan(scene, capabilities=software)
    assert told.hits == "gl"
    assert "embreex cannot be imported" in str(told)
    assert "OpenGL finds the hits, in about twice the time" in str(told)
    with pytest.raises(tl.InputError, match=r"embreex cannot be imported .*; pip install -U embreex, or omit"):
        rendered(renderer, scene, "embree")
    monkeypatch.undo()
    monkeypatch.setattr("translucent.geometry.ray_caster._embreex_version", lambda: "2.17.7")
    assert "embreex has version 2.17.7, older than 4.4" in str(tl.plan(scene, capabilities=software))
    monkeypatch.setattr("translucent.geometry.ray_caster._embreex_version", lambda: "4.4rc1")
    assert tl.plan(scene, capabilities=software).hits == "embree"

    def no_metadata() -> str:
        raise PackageNotFoundError("embreex")

    monkeypatch.setattr("translucent.geometry.ray_caster._embreex_version", no_metadata)
    assert "embreex cannot be imported" in str(tl.plan(scene, capabilities=software))


def test_a_shader_that_fails_in_mid_frame_leaves_the_renderer_usable(
    renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = SCENES["ball"]()
    whole = rendered(renderer, scene, "embree")
    made, calls = EmbreeHits.nearest, []

    def fail(hits: EmbreeHits, *rays: Any) -> Any:
        calls.append(rays)
        if len(calls) in (3, 6):
            raise moderngl.Error("lost" if len(calls) == 3 else "the context was released")
        return made(hits, *rays)

    monkeypatch.setattr(EmbreeHits, "nearest", fail)
    with pytest.raises(moderngl.Error, match="lost"):
        rendered(renderer, scene, "embree")
    with pytest.raises(tl.RenderError, match="context was released during the frame; create a new renderer"):
        rendered(renderer, scene, "embree")
    np.testing.assert_array_equal(rendered(renderer, scene, "embree").radiance, whole.radiance)
