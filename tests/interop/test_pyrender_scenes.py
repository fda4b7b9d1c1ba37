"""Scenes of pyrender as scenes of the toolkit and back: objects, cameras, lights and their units, and bad input."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.geometry.solids import Sphere
from translucent.interop.pyrender import backdrop_from_pyrender, scene_from_pyrender, to_pyrender

SIZE = (80, 60)
GREEN = tl.Medium(absorption=(3.0, 0.5, 2.0))
EPS = float(np.finfo(np.float32).eps)


def test_the_named_node_becomes_a_body_that_is_closed_again(studio: Any) -> None:
    scene = scene_from_pyrender(studio.scene(), {"ball": GREEN}, SIZE)
    (body,) = scene.objects
    assert body.medium is GREEN
    # Every face had corners of its own.
    assert body.mesh.diagnosis.solid
    assert len(body.mesh.vertices) == len(studio.ball.vertices)
    np.testing.assert_allclose(body.bounds, studio.ball.bounds, atol=EPS)
    np.testing.assert_allclose(scene.environment.first, np.array([0.5, 0.6, 0.9]) ** 2.2, rtol=4 * EPS)


def test_nodes_are_placed_by_all_above_them_and_meshes_are_shared(pyrender: ModuleType, studio: Any) -> None:
    scene = studio.scene()
    mesh = studio.mesh(studio.ball, (1, 1, 1))
    mesh.name = "pearl"
    above = scene.add(studio.mesh(studio.box, (1, 1, 1)), name="string", pose=_moved((0.0, 1.0, 0.0)))
    mirrored = np.diag((-1.0, 2.0, 0.5, 1.0))
    low = scene.add(mesh, name="low", pose=_moved((0.0, 0.0, 2.0)), parent_node=above)
    high = scene.add(mesh, name="high", parent_node=above)
    scene.set_pose(high, mirrored)  # which pyrender draws as it is, unlike a matrix that a node is made with
    found = scene_from_pyrender(scene, {"pearl": GREEN, "low": tl.Medium(absorption=1.0)}, SIZE).objects
    assert [item.medium is GREEN for item in found] == [True, False]
    assert found[0].mesh is found[1].mesh
    np.testing.assert_array_equal(found[0].matrix, _moved((0.0, 1.0, 0.0)) @ mirrored)
    np.testing.assert_array_equal(found[1].matrix, scene.get_pose(low))
    assert found[1].matrix[:3, 3].tolist() == [0.0, 1.0, 2.0]
    again = scene_from_pyrender(scene, {"pearl": GREEN}, SIZE).objects
    assert again[0].mesh is found[0].mesh
    mesh.primitives[0].positions = 2.0 * mesh.primitives[0].positions
    assert scene_from_pyrender(scene, {"pearl": GREEN}, SIZE).objects[0].mesh is not found[0].mesh


def test_parts_of_a_mesh_are_one_body_and_instances_are_several(pyrender: ModuleType, studio: Any) -> None:
    ball = Sphere().tessellate(16)
    half = len(ball.faces) // 2
    parts = [pyrender.Primitive(ball.vertices, indices=ball.faces[rows]) for rows in (slice(half), slice(half, None))]
    scene = studio.scene()
    scene.add(pyrender.Mesh(parts), name="parts")
    poses = np.stack([_moved((3.0, 0.0, 0.0)), _moved((-3.0, 0.0, 0.0))])
    scene.add(pyrender.Mesh([pyrender.Primitive(ball.vertices, indices=ball.faces, poses=poses)]), name="instances")
    bodies = scene_from_pyrender(scene, {"parts": GREEN, "instances": GREEN}, SIZE).objects
    assert [body.mesh.name for body in bodies] == ["instances", "instances", "parts"]
    assert [body.matrix[0, 3] for body in bodies] == [3.0, -3.0, 0.0]
    assert all(body.mesh.diagnosis.solid for body in bodies)
    assert bodies[2].mesh.volume == pytest.approx(ball.volume, rel=1e-5)


def _moved(offset: tuple[float, float, float]) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def test_cameras(pyrender: ModuleType, studio: Any) -> None:
    focal = SIZE[1] / 2 / np.tan(np.radians(20.0))
    for camera, fov_y, height in (
        (pyrender.PerspectiveCamera(np.radians(40.0)), 40.0, None),
        (pyrender.PerspectiveCamera(np.radians(40.0), aspectRatio=4 / 3), 40.0, None),
        (pyrender.IntrinsicsCamera(focal, focal, 40.0, 30.0), 40.0, None),
        (pyrender.OrthographicCamera(7.0, 0.8), None, 1.6),
    ):
        scene = pyrender.Scene()
        scene.add(studio.mesh(studio.ball, (1, 1, 1)), name="ball")
        scene.add(camera, pose=studio.pose)
        found = scene_from_pyrender(scene, {"ball": GREEN}, SIZE).camera
        assert (found.fov_y, found.height) == (pytest.approx(fov_y), pytest.approx(height))
        np.testing.assert_allclose(found.pose, studio.pose, atol=1e-14)
        # What is to the right and above of the middle is so by the projection of pyrender, too.
        projection = camera.get_projection_matrix(*SIZE)
        half = found.half_extent(SIZE)
        np.testing.assert_allclose((1 / projection[0, 0], 1 / projection[1, 1]), half, rtol=1e-12)


def test_lights_keep_their_units(pyrender: ModuleType, studio: Any) -> None:
    scene = scene_from_pyrender(studio.scene(), {"ball": GREEN}, SIZE)
    (point,) = (light for light in scene.lights if isinstance(light, tl.PointLight))
    (sun,) = (light for light in scene.lights if isinstance(light, tl.DirectionalLight))
    np.testing.assert_array_equal(point.position, (-1.0, 2.5, 1.0))
    np.testing.assert_array_equal(point.intensity, 6.0)
    np.testing.assert_allclose(sun.direction, -np.array([1.0, 3.0, 0.5]) / np.linalg.norm([1.0, 3.0, 0.5]), atol=1e-12)
    np.testing.assert_allclose(sun.irradiance, [1.5, 1.35, 1.2], rtol=EPS)


def _radiance(f0: float, color: float, irradiance: float) -> float:
    """Radiance that pyrender's rough dielectric reflects back the way that light came, at right angles.

    Its shaders/mesh.frag: diffuse (1 - F) c / pi with c = 0.96 of the base color, and F G D / (4 + 0.001) with
    D = 1 / pi and G = 1 at a roughness of 1.
    """
    return irradiance * ((1.0 - f0) * (1.0 - f0) * color / np.pi + f0 / np.pi / 4.001)


@pytest.mark.parametrize("kind", ["point", "spot", "directional", "ambient"])
def test_units_of_light_are_those_that_pyrender_draws_with(pyrender: ModuleType, studio: Any, kind: str) -> None:
    """A wall at right angles to the view, lit from the camera."""
    scene = pyrender.Scene(ambient_light=[0.4 * (kind == "ambient")] * 3)
    wall = tl.Mesh([(-9, -9, -3), (9, -9, -3), (0, 9, -3)], [(0, 1, 2)])
    scene.add(studio.mesh(wall, (0.8, 0.8, 0.8)))
    scene.add(studio.mesh(studio.ball, (1, 1, 1)), name="ball", pose=_moved((0.0, 0.0, 9.0)))
    scene.add(pyrender.PerspectiveCamera(0.1))
    if kind == "point":
        scene.add(pyrender.PointLight(color=np.ones(3), intensity=13.5))
    if kind == "spot":
        # At an angle from its middle at which half of the cosines' difference, squared, is a quarter.
        middle = math.acos(0.5 + 0.5 * math.cos(math.radians(50)))
        lamp = pyrender.SpotLight(color=np.ones(3), intensity=54.0, outerConeAngle=math.radians(50))
        scene.add(lamp, pose=trimesh.transformations.rotation_matrix(middle, (0.6, 0.8, 0)))
    if kind == "directional":
        scene.add(pyrender.DirectionalLight(color=np.ones(3), intensity=1.5))
    seen = backdrop_from_pyrender(scene, ["ball"], (3, 3)).radiance[1, 1]
    # 13.5 W/sr at 3 m are 1.5 W/m^2.
    expected = 0.8 * 0.4 if kind == "ambient" else _radiance(0.04, 0.8, 1.5)
    # Half a step of 8 bits, in what is linear to the power of 1 / 2.2.
    assert seen == pytest.approx(expected, abs=0.5 / 255 * 2.2 * expected ** (1 - 1 / 2.2) + 1e-5)
    ours = scene_from_pyrender(scene, {"ball": GREEN}, (3, 3)).lights
    if ours:
        irradiance = ours[0].irradiance_on((0.0, 0.0, -3.0), (0.0, 0.0, 1.0))
        np.testing.assert_allclose(irradiance, 1.5, rtol=8 * EPS)


def test_spot_lights_keep_their_cones(pyrender: ModuleType, studio: Any) -> None:
    scene = studio.scene()
    scene.add(pyrender.SpotLight(np.ones(3), 2.0, None, 0.25, 0.5), pose=_moved((1.0, 2.0, 3.0)))
    scene.add(pyrender.SpotLight(np.ones(3), 1.0, None, 0.5, 0.5))
    spots = [
        light for light in scene_from_pyrender(scene, {"ball": GREEN}, SIZE).lights if isinstance(light, tl.SpotLight)
    ]
    found, edged = sorted(spots, key=lambda light: light.inner_cone)
    np.testing.assert_array_equal(found.position, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(found.direction, (0.0, 0.0, -1.0))
    np.testing.assert_array_equal(found.intensity, 2.0)
    assert (found.inner_cone, found.outer_cone) == (pytest.approx(math.degrees(0.25)), pytest.approx(math.degrees(0.5)))
    assert edged.inner_cone == pytest.approx(edged.outer_cone, rel=EPS)


def test_unknown_names_are_told_with_those_there_are(studio: Any) -> None:
    scene = studio.scene()
    (ball,) = scene.get_nodes(name="ball")
    ball.mesh.name = "glass"
    with pytest.raises(
        tl.InputError, match=r"media for 'bowl', 'lamp'; .*; the scene has 'ball', 'box', 'floor', 'glass'; use"
    ):
        scene_from_pyrender(scene, {"bowl": GREEN, "ball": GREEN, "lamp": GREEN}, SIZE)
    with pytest.raises(tl.InputError, match="media for 'bowl'"):
        backdrop_from_pyrender(scene, ["bowl"], SIZE)
    ball.mesh.is_visible = False
    with pytest.raises(tl.InputError, match=r"no visible node or mesh .* the scene has 'box', 'floor'; "):
        scene_from_pyrender(scene, {"ball": GREEN}, SIZE)
    with pytest.raises(tl.InputError, match="no medium is given for any node; give media="):
        scene_from_pyrender(scene, {}, SIZE)


def test_nameless_nodes_are_told(pyrender: ModuleType, studio: Any) -> None:
    scene = pyrender.Scene()
    scene.add(studio.mesh(studio.ball, (1, 1, 1)))
    with pytest.raises(tl.InputError, match=r"the scene has no names: use scene.add\(mesh, name=\.\.\.\)"):
        scene_from_pyrender(scene, {"ball": GREEN}, SIZE)


def test_bad_cameras_are_refused(pyrender: ModuleType, studio: Any) -> None:
    tilted = studio.pose @ np.diag((2.0, 2.0, 2.0, 1.0))
    for camera, pose, message in (
        (pyrender.PerspectiveCamera(0.7, aspectRatio=1.0), np.eye(4), "aspectRatio 1 would stretch a picture of 80x60"),
        (
            pyrender.IntrinsicsCamera(90.0, 90.0, 41.0, 30.0),
            np.eye(4),
            "cx 41, cy 30 do not describe square pixels and a view through the middle of",
        ),
        (
            pyrender.IntrinsicsCamera(90.0, 91.0, 40.0, 30.0),
            np.eye(4),
            "fx 90, fy 91, .* do not describe square pixels and a view through the middle of",
        ),
        (pyrender.PerspectiveCamera(0.7), tilted, "camera pose; the pose scales, shears or mirrors"),
        (
            pyrender.PerspectiveCamera(0.7),
            np.diag((0.0, 1.0, 1.0, 1.0)),
            "camera pose; the pose scales, shears or mirrors",
        ),
    ):
        scene = pyrender.Scene()
        scene.add(studio.mesh(studio.ball, (1, 1, 1)), name="ball")
        scene.set_pose(scene.add(camera), pose)
        with pytest.raises(tl.InputError, match=message):
            scene_from_pyrender(scene, {"ball": GREEN}, SIZE)
    scene = pyrender.Scene()
    scene.add(studio.mesh(studio.ball, (1, 1, 1)), name="ball")
    with pytest.raises(
        tl.InputError, match=r"the scene has no camera; add a camera: scene\.add\(camera, pose=\.\.\.\)"
    ):
        scene_from_pyrender(scene, {"ball": GREEN}, SIZE)


def test_singular_lights_and_points_are_refused(pyrender: ModuleType, studio: Any) -> None:
    scene = studio.scene()
    flat = scene.add(pyrender.DirectionalLight(color=np.ones(3), intensity=1.0), name="flat")
    scene.set_pose(flat, np.diag((1.0, 0.0, 1.0, 1.0)))
    with pytest.raises(
        tl.InputError,
        match="light 'flat' of the pyrender scene; the transform of the light's node is singular: it, or a node",
    ):
        scene_from_pyrender(scene, {"ball": GREEN}, SIZE)
    scene = studio.scene()
    scene.add(pyrender.Mesh.from_points(studio.ball.vertices), name="cloud")
    with pytest.raises(
        tl.InputError, match="the medium of 'cloud'; the mesh has a primitive of mode 0; use a mesh of triangles"
    ):
        scene_from_pyrender(scene, {"cloud": GREEN}, SIZE)


def test_what_is_no_scene_or_no_picture_is_refused(pyrender: ModuleType, studio: Any) -> None:
    with pytest.raises(tl.InputError, match=r"of type str; give an object of type pyrender\.Scene"):
        backdrop_from_pyrender("scene.glb", ["ball"], SIZE)
    with pytest.raises(tl.InputError, match=r"of type NoneType; give an object of type pyrender\.Scene"):
        scene_from_pyrender(None, {"ball": GREEN}, SIZE)
    for flags in (pyrender.RenderFlags.SEG, pyrender.RenderFlags.DEPTH_ONLY, pyrender.RenderFlags.SHADOWS_ALL):
        with pytest.raises(
            tl.InputError, match="do not concern shadows of directional or spot lights, culling or wireframes"
        ):
            backdrop_from_pyrender(studio.scene(), ["ball"], SIZE, flags=flags)


def test_opaque_objects_and_lights_become_a_scene_of_pyrender(studio: Any) -> None:
    lights = [
        tl.PointLight((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
        tl.SpotLight((1.0, 2.0, 3.0), (-0.5, -2.5, -2.0), (4.0, 5.0, 6.0), 10.0, 30.0),
        tl.DirectionalLight((0.0, -3.0, -4.0), 2.0),
    ]
    camera = tl.Camera(studio.pose, fov_y=35.0)
    objects = [tl.Object(studio.floor, color=(0.1, 0.2, 0.3)), tl.Object(studio.ball, medium=GREEN)]
    scene = tl.Scene(objects, camera, lights, tl.Environment.gradient(0.2, 0.6))
    made = to_pyrender(scene)
    (node,) = made.mesh_nodes
    (primitive,) = node.mesh.primitives
    np.testing.assert_allclose(
        primitive.positions.reshape(-1, 3, 3) + camera.eye, studio.floor.vertices[studio.floor.faces], atol=8 * EPS
    )
    np.testing.assert_allclose(primitive.material.baseColorFactor, (0.1, 0.2, 0.3, 1.0), rtol=EPS)
    np.testing.assert_allclose(made.ambient_light, 0.4, rtol=EPS)
    back = scene_from_pyrender(made, {"floor": GREEN}, SIZE)
    assert back.camera.fov_y == pytest.approx(35.0)
    np.testing.assert_array_equal(back.camera.pose[:3, :3], camera.pose[:3, :3])
    for found in back.lights:
        (light,) = (light for light in lights if type(light) is type(found))
        point = (0.3, -0.2, 0.5)
        for normal in np.eye(3):
            shifted = np.subtract(point, camera.eye)
            expected = light.irradiance_on(point, normal)
            np.testing.assert_allclose(found.irradiance_on(shifted, normal), expected, rtol=32 * EPS)


def test_scenes_that_pyrender_cannot_draw_are_refused(pyrender: ModuleType, studio: Any) -> None:
    camera = tl.Camera(studio.pose)
    with pytest.raises(
        tl.InputError, match="all nodes have a medium, so no opaque node is left: 'sphere'; render without pyrender"
    ):
        to_pyrender(tl.Scene([tl.Object(studio.ball, medium=GREEN)], camera))
    many = [tl.PointLight((0, 0, 1), 1.0)] * 5
    with pytest.raises(
        tl.InputError,
        match="drawing with pyrender; the scene has 5 lights of type PointLight; use at most 4 lights of each type",
    ):
        to_pyrender(tl.Scene([tl.Object(studio.floor)], camera, many))
