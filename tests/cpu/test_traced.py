"""Ray trees: those of the reference where they are deep enough, and the truth where they are not."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.textured import TEXTURED
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.cpu import ray_tree
from translucent.cpu.hits import ExactRayCaster
from translucent.cpu.interactions import MicrofacetSamples
from translucent.cpu.ray_tree import DiffusionFields, RayTree, TracedLight
from translucent.cpu.renderer import CpuRenderer
from translucent.formulas.interface import slab_reflectance, slab_transmittance
from translucent.geometry.solids import Box, Sphere
from translucent.planning.passes import NoteKind
from translucent.planning.plan import plan_scene
from translucent.planning.rendered import Treatment
from translucent.planning.request import RenderRequest
from translucent.reference import pixel_rays
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.render import scene_hits
from translucent.reference.surfaces import sheet_thicknesses

SIZE = (16, 16)
BALL = Sphere().tessellate(24)
BOX = Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate()
GLASS = tl.Medium(absorption=(1.0, 0.5, 0.2), ior=1.5)
WINE = tl.Medium(absorption=(0.2, 1.0, 2.0), emission=(0.3, 0.1, 0.0), ior=1.33)
DYE = tl.Medium(absorption=(2.0, 0.2, 0.2))
DYE_GLASS = tl.Medium(absorption=(3.0, 3.0, 2.0), ior=1.5)
CLEAR = tl.Medium(ior=1.5)
CAMERA = tl.Camera.look_at((1.5, 1.2, 2.0), (0.0, 0.1, 0.0))
SKY = tl.Environment.gradient((0.9, 0.5, 0.2), (0.1, 0.3, 0.8))
LAMP = tl.PointLight((2.0, 3.0, 1.0), (5.0, 5.0, 5.0))


def moved(x: float, scale: float = 1.0) -> Array:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[0, 3] = x
    return matrix


def tree_of(scene: tl.Scene, size: tuple[int, int], depth: int, forks: int) -> RayTree:
    caster = ExactRayCaster(scene.objects)
    light = SurfaceLight(LightPaths(scene, sheet_thicknesses(scene)))
    return RayTree(light, caster, size[0] / size[1], depth, forks, DiffusionFields({}))


def traced_light(
    scene: tl.Scene,
    size: tuple[int, int] = SIZE,
    depth: int = 8,
    forks: int = 2,
    spread: MicrofacetSamples | None = None,
) -> TracedLight:
    rays = pixel_rays(scene.camera, size)
    return tree_of(scene, size, depth, forks).see(rays, scene_hits(scene, size), np.arange(len(rays)), spread)


def glass(mesh: tl.Mesh = BALL, medium: tl.Medium = GLASS, x: float = 0.0, **more: object) -> tl.Object:
    return tl.Object(mesh, medium, moved(x), **more)  # type: ignore[arg-type]


def scene_of(*objects: tl.Object, **more: object) -> tl.Scene:
    return tl.Scene(objects, more.pop("camera", CAMERA), environment=more.pop("environment", SKY), **more)  # type: ignore[arg-type]


def goblet() -> tl.Scene:
    crystal, wine = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    red = tl.Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    grey = tl.Medium(absorption=(20.0, 20.0, 20.0), ior=1.52)
    objects = [tl.Object(crystal, grey, priority=1), tl.Object(wine, red)]
    camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    return tl.Scene(objects, camera, environment=SKY, overlap="priority")


def knot() -> tl.Object:
    mesh = tl.load_mesh(mesh_path("knot"))
    return tl.Object(mesh, tl.Medium.from_color((0.18, 0.62, 0.35), 0.15 * mesh.diagonal, ior=1.5))


def around(body: tl.Object) -> tl.Camera:
    return tl.Camera.framing(body.mesh.vertices, (1, 1), direction=(-0.35, -0.3, -1.0), fov_y=28.0)


SCENES = {
    "ball": lambda: scene_of(glass()),
    "knot": lambda: scene_of(knot(), camera=around(knot())),
    "goblet with wine": goblet,
    "straight matter in glass": lambda: scene_of(glass(), glass(medium=DYE, x=0.5)),
    "media add": lambda: scene_of(glass(), glass(medium=WINE, x=0.5)),
    "media unite": lambda: scene_of(glass(), glass(medium=WINE, x=0.5), overlap="union"),
    "priorities": lambda: scene_of(glass(priority=1), glass(medium=WINE, x=0.5), overlap="priority"),
    "coincident walls": lambda: scene_of(glass(BOX), glass(BOX, WINE, 1.0)),
    "opaque behind": lambda: scene_of(glass(), tl.Object(BOX, None, moved(0.9), color=(0.9, 0.5, 0.1)), lights=[LAMP]),
    "opaque inside": lambda: scene_of(glass(), tl.Object(BOX, None, moved(0.2, 0.5)), lights=[LAMP]),
    "sheet without interface": lambda: scene_of(glass(), glass(medium=DYE, x=0.5, sheet_thickness=0.2)),
    "sheet": lambda: scene_of(glass(), glass(BOX, x=0.7, sheet_thickness=0.3)),
    "layer": lambda: scene_of(
        glass(), glass(BOX, tl.Medium(), 0.5, sheet_thickness=0.01, surface=tl.Surface(opacity=0.4, color="#e02020"))
    ),
    "paint": lambda: scene_of(
        glass(surface=tl.Surface(color=(0.9, 0.5, 0.3), transmission=0.6, diffuse_transmission=0.3)), lights=[LAMP]
    ),
    "dispersion": lambda: scene_of(glass(surface=tl.Surface(dispersion=3.0))),
    "checkerboard": lambda: scene_of(glass(), environment=SKY.with_background(tl.Environment.checkerboard())),
    "mirrored": lambda: scene_of(tl.Object(BALL, GLASS, np.diag([-1.0, 0.7, 1.2, 1.0]))),
    "eye inside": lambda: scene_of(
        glass(),
        tl.Object(BALL, WINE, moved(0.0, 0.5), priority=1),
        camera=tl.Camera.look_at((0.1, 0.1, 0.2), (0.0, 0.0, -1.0), fov_y=100.0),
        overlap="priority",
    ),
    "picture cuts": lambda: scene_of(
        glass(medium=DYE_GLASS), camera=tl.Camera.orthographic((0.2, 0.3, 0.4), (0.0, 0.1, 0.0), height=2.5)
    ),
    "density": lambda: scene_of(
        glass(medium=replace(GLASS, absorption=(9.0, 8.0, 7.0)), density=tl.DensityGrid(np.eye(3)[None] + 1.0))
    ),
    "ambient": lambda: scene_of(
        glass(medium=tl.Medium(absorption=(1, 1, 1), scattering=(1, 1, 1), ior=1.4)), ambient=(0.5, 0.5, 0.5)
    ),
    "painted cube in glass": lambda: TEXTURED["painted cube in glass"],
    "painted slab behind glass": lambda: TEXTURED["painted slab behind glass"],
    "painted pane": lambda: TEXTURED["painted pane before a painted cube"],
    "glass over a base in places": lambda: TEXTURED["glass over a base in places"],
    "far": lambda: scene_of(glass(), camera=tl.Camera.look_at((1.5e4, 1.2e4, 2e4), (0.0, 0.1, 0.0), fov_y=0.005)),
}


@pytest.mark.parametrize("name", SCENES)
def test_deep_trees_are_those_of_the_reference(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_tree, "FAINTEST", 1e-5)
    scene, bounces = SCENES[name](), 18
    light = traced_light(scene, depth=bounces + 1, forks=bounces + 1)
    truth = tl.reference.render(scene, SIZE, bounces=bounces)
    assert light.valid.all()
    assert truth.valid.all()
    error = np.abs(light.radiance - truth.radiance.reshape(-1, 3)).max(axis=1)
    assert np.median(error) < 2e-5
    # What the reference does not follow is dark there, and sees the environment here.
    assert (error > 1e-4).mean() < 0.06
    assert (error > 3e-3).mean() < 0.005


@pytest.mark.parametrize("roughness", [0.0, 0.4])
@pytest.mark.parametrize("depth", [1, 8, 64])
def test_lossless_bodies_vanish_in_a_furnace(depth: int, roughness: float) -> None:
    body = replace(knot(), medium=CLEAR, surface=tl.Surface(roughness=roughness))
    scene = scene_of(body, camera=around(body), environment=tl.Environment.constant((1.0, 1.0, 1.0)))
    for spread in (None, MicrofacetSamples(3, 16)):
        light = traced_light(scene, depth=depth, spread=spread)
        np.testing.assert_allclose(light.radiance, 1.0, atol=1e-12)


def test_a_slab_is_that_of_stokes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_tree, "FAINTEST", 1e-9)
    box, tau = Box((-9.0, -9.0, 0.0), (9.0, 9.0, 0.5)), np.array([0.5, 0.25, 0.1])
    backdrop, light = np.array([1.0, 2.0, 3.0]), np.array([0.7, 0.2, 0.4])
    environment = tl.Environment.constant(light).with_background(tl.Environment.constant(backdrop))
    camera = tl.Camera.orthographic((0.3, 0.2, 3.0), (0.3, 0.2, 0.0), height=1.0)
    scene = scene_of(glass(box.tessellate()), camera=camera, environment=environment)
    found = traced_light(scene, (3, 3), depth=20, forks=20).radiance
    reflectance = ((1.5 - 1.0) / (1.5 + 1.0)) ** 2
    once = (1.0 - reflectance) ** 2 * np.exp(-tau)
    mirrored = slab_reflectance(reflectance, tau) + slab_transmittance(reflectance, tau) - once
    np.testing.assert_allclose(found, np.tile(backdrop * once + light * mirrored, (9, 1)), rtol=1e-7)


def test_the_weaker_branch_uses_up_forks() -> None:
    scene = scene_of(knot(), camera=around(knot()), environment=tl.Environment.studio())
    deep = traced_light(scene, depth=24, forks=24).radiance
    errors = [
        np.sqrt(np.mean((traced_light(scene, depth=depth, forks=forks).radiance - deep) ** 2))
        for depth, forks in ((2, 2), (8, 0), (8, 1), (8, 2))
    ]
    assert errors[3] < errors[2] < errors[1]
    assert errors[3] < 0.25 * errors[0]


def test_paths_of_stronger_branches_keep_their_forks() -> None:
    shell = tl.Object(tl.load_mesh(mesh_path("shell")), tl.Medium.from_color((0.8, 0.95, 0.9), 0.02, ior=1.5))
    scene = scene_of(shell, camera=around(shell), environment=tl.Environment.studio())
    found, deep = (traced_light(scene, (14, 14), depth, forks).radiance for depth, forks in ((8, 2), (16, 16)))
    # Where both branches use up a fork, it is 0.05.
    assert np.sqrt(np.mean((found - deep) ** 2)) < 0.01 * deep.mean()


def test_exits_that_embree_misses_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(knot(), camera=around(knot()))
    expected, nearest = traced_light(scene), ExactRayCaster.nearest

    def forgetful(caster: ExactRayCaster, origins: Array, directions: Array, *more: Any) -> Any:
        face, distance = nearest(caster, origins, directions, *more)
        leaves = np.einsum("ki,ki->k", caster.faces.outward[face[:, 0]], directions) > 0
        lost = np.flatnonzero(leaves & (face[:, 0] >= 0))[::7]
        face[lost], distance[lost] = -1, np.inf
        return face, distance

    monkeypatch.setattr(ExactRayCaster, "nearest", forgetful)
    found = traced_light(scene)
    assert found.valid.all()
    np.testing.assert_allclose(found.radiance, expected.radiance, rtol=1e-6)


def test_open_bodies_and_full_records_are_told() -> None:
    front = (BOX.vertices[BOX.faces][..., 2] == 0.5).all(axis=1)
    # The hole is on the side, where no straight ray comes.
    scene = scene_of(glass(tl.Mesh(BOX.vertices, BOX.faces[~front])), camera=tl.Camera.look_at((0, 0, -3), (0, 0, 0)))
    tilted = replace(scene, camera=tl.Camera.look_at((1.0, 2.0, -2.0), (0.0, 0.0, 0.0)))
    assert not traced_light(tilted).valid.all()
    nested = [tl.Object(BALL, GLASS, moved(0.0, 1.0 - 0.05 * i)) for i in range(9)]
    assert not traced_light(scene_of(*nested)).valid.all()
    assert traced_light(scene_of(*nested[:8])).valid.all()


def test_rough_bodies_are_as_the_reference_has_them() -> None:
    scene = scene_of(glass(surface=tl.Surface(roughness=0.4)), environment=tl.Environment.studio())
    samples, size = 64, (10, 10)
    mean = np.mean(
        [traced_light(scene, size, spread=MicrofacetSamples(i, samples)).radiance for i in range(samples)], axis=0
    )
    truth = tl.reference.render(scene, size, paths=128).radiance.reshape(-1, 3)
    one = traced_light(scene, size).radiance
    assert abs(mean.mean() / truth.mean() - 1.0) < 0.03
    for found, most in ((mean, 0.11), (one, 0.25)):
        assert np.sqrt(np.mean((found - truth) ** 2)) < most * truth.mean()


def test_frames_show_the_tree_where_interfaces_are() -> None:
    scene = scene_of(glass(), glass(medium=DYE, x=-1.5), environment=tl.Environment.studio())
    frames = [CpuRenderer(threads).render(plan_scene(scene, RenderRequest(samples=2)), (32, 24)) for threads in (1, 3)]
    straight = replace(scene, objects=[replace(scene.objects[0], medium=replace(GLASS, ior=1.0)), scene.objects[1]])
    without = CpuRenderer().render(plan_scene(straight, RenderRequest(samples=2)), (32, 24))
    for name in ("radiance", "transmittance", "thickness", "valid", "coverage"):
        np.testing.assert_array_equal(getattr(frames[0], name), getattr(frames[1], name))
        assert np.array_equal(getattr(frames[0], name), getattr(without, name)) == (name != "radiance"), name
    plan = tl.plan(scene, capabilities=CpuRenderer().capabilities)
    assert not plan.says(NoteKind.REFRACTION)
    assert not plan.says(NoteKind.LATER_REFRACTION)


@pytest.mark.parametrize(("name", "samples", "most"), [("goblet_wine", 4, 0.10), ("sphere_rough", 8, 0.11)])
def test_pictures_are_near_full_light_transport(name: str, samples: int, most: float, transport: ModuleType) -> None:
    scene, side = transport.make(name)
    frame = CpuRenderer().render(plan_scene(scene, RenderRequest(samples=samples)), (side, side))
    assert transport.errors(frame.radiance, transport.load(name))["nrmse"] < most


def test_light_that_diffuses_is_that_of_opengl(renderer: tl.Renderer) -> None:
    """The same light at the surface, and the same formula: the rays alone differ, where they graze."""
    wax = tl.Medium(absorption=(0.2, 0.5, 1.0), scattering=20.0, ior=1.4)
    ball = tl.Object(Sphere().tessellate(32), wax)
    camera = tl.Camera.look_at((1, 0.8, 4), (0, 0, 0), fov_y=30.0)
    scene = tl.Scene([ball], camera, environment=tl.Environment.gradient((0, 0, 0), (1, 1, 1)))
    with tl.Renderer("cpu") as other:
        found, expected = (one.render(scene, (24, 24), scattering=tl.Diffusion(16)) for one in (other, renderer))
    assert found.plan.treated(Treatment.DIFFUSION) == (0,)
    seen = found.coverage & expected.coverage & (expected.thickness > 0.5)
    assert seen.sum() > 100
    np.testing.assert_allclose(found.radiance[seen], expected.radiance[seen], rtol=0.01, atol=2e-3)


def test_light_scattered_ahead_in_walls_is_that_of_opengl(renderer: tl.Renderer) -> None:
    """A lamp shines through a wall, where a black box does not block it; a faint interface changes nothing."""
    stop = tl.Object(Box((-0.03, -0.03, -0.02), (0.0, 0.03, -0.01)).tessellate(), color=(0, 0, 0))
    camera = tl.Camera.look_at((0.01, 0.01, 0.08), (0, 0, 0), fov_y=12.0)
    lamp = tl.DirectionalLight((-0.2, -0.1, 1.0), (3, 2, 1))
    lights = []
    with tl.Renderer("cpu") as other:
        for ior in (1.0, 1.001, 1.4):
            leaf = tl.Medium(absorption=300.0, scattering=5000.0, anisotropy=0.4, ior=ior)
            wall = tl.Object(Box.slab((0.04, 0.04)).tessellate(), leaf)
            scene = tl.Scene([wall, stop], camera, [lamp], tl.Environment.constant((0, 0, 0)))
            found, expected = (one.render(scene, (8, 8), scattering=tl.Diffusion(8)) for one in (other, renderer))
            light = np.asarray(expected.radiance)
            assert light.max() > 4 * np.median(light.max(axis=2)[:, :2])
            np.testing.assert_allclose(found.radiance, light, rtol=0.02, atol=2e-3)
            lights.append(light.mean())
    assert lights[1] == pytest.approx(lights[0], rel=0.03)
