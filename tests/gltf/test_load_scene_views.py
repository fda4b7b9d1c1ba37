"""Cameras and lights of glTF files, and transforms that they cannot have."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.gltf.gltf_writer import TURN, box_file, lit_scene, load
from translucent.scene.showcase import LIGHT_TABLE

# Cameras


PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.1, "aspectRatio": 2.0}}


def test_a_perspective_camera_looks_along_its_node_whatever_the_scale(tmp_path: Path) -> None:
    writer = box_file(tmp_path, name="Box")
    writer.add("cameras", **PERSPECTIVE)
    writer.add("nodes", camera=0, translation=[0.0, 1.0, 0.0], children=[0], scale=[3.0, 2.0, 5.0])
    writer.add("nodes", children=[1], rotation=TURN, translation=[20.0, 0.0, 0.0])
    scene = load(writer, tmp_path)
    assert scene.camera.fov_y == pytest.approx(math.degrees(0.6), rel=1e-15)
    np.testing.assert_allclose(scene.camera.eye, [20.0, 1.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(scene.camera.forward, [-1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(scene.camera.up, [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(scene.camera.right, [0.0, 0.0, -1.0], atol=1e-15)
    # What hangs below a camera is there, too, and scaled.
    assert np.ptp(scene.objects[0].bounds, axis=0) == pytest.approx([30.0, 8.0, 6.0], rel=1e-14)


def test_an_orthographic_camera_shows_twice_ymag(tmp_path: Path) -> None:
    writer = box_file(tmp_path)
    writer.add("cameras", type="orthographic", orthographic={"xmag": 9.0, "ymag": 1.5, "znear": 0.0, "zfar": 9.0})
    writer.add("nodes", camera=0, scale=[7.0, 7.0, 7.0])
    camera = load(writer, tmp_path).camera
    assert (camera.fov_y, camera.height) == (None, 3.0)


def test_a_mirroring_camera_is_told(tmp_path: Path) -> None:
    writer = box_file(tmp_path)
    writer.add("cameras", **PERSPECTIVE)
    writer.add("nodes", camera=0, name="Selfie", scale=[-1.0, 1.0, 1.0])
    with pytest.warns(tl.TranslucentWarning, match=r"mirroring cameras \('Selfie'\)"):
        camera = load(writer, tmp_path).camera
    assert camera.right.tolist() == [1.0, 0.0, 0.0]


def test_cameras_count_in_the_order_of_the_file(tmp_path: Path) -> None:
    writer = box_file(tmp_path)
    for name in ("Front", "Side"):
        writer.add("cameras", name=name, **PERSPECTIVE)
    writer.add("nodes", name="S", camera=1, translation=[20.0, 0.0, 0.0], rotation=TURN)
    writer.add("nodes", name="F", camera=0, translation=[0.0, 0.0, 30.0])
    eyes = [load(writer, tmp_path, camera=index).camera.eye.tolist() for index in (0, 1)]
    assert eyes == [[0.0, 0.0, 30.0], [20.0, 0.0, 0.0]]
    framed = load(writer, tmp_path, camera=None).camera
    assert framed.fov_y == 30.0
    for index in (2, -1, True, "Front", 1.0):
        with pytest.raises(
            tl.InputError, match="the file has 0 of node 'F', 1 of node 'S'; use one of these camera numbers"
        ):
            load(writer, tmp_path, camera=index)


def test_without_cameras_all_objects_are_framed(tmp_path: Path) -> None:
    writer = box_file(tmp_path, translation=[50.0, 0.0, 0.0])
    writer.add("nodes", mesh=0)
    scene = load(writer, tmp_path)
    for size in ((64, 64), (64, 36)):  # wider is fine, too
        half = scene.camera.half_extent(size)
        for item in scene.objects:
            points = item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3]
            local = (points - scene.camera.eye) @ scene.camera.pose[:3, :3]
            assert (np.abs(local[:, :2] / -local[:, 2:]) < half).all()
    narrow = load(writer, tmp_path, size=(10, 100)).camera
    assert np.linalg.norm(narrow.eye) > 2 * np.linalg.norm(scene.camera.eye)
    assert scene.environment is LIGHT_TABLE
    with pytest.raises(
        tl.InputError,
        match=r"camera 1 of '.*model.glb'; the file has no cameras; omit the camera: the view then shows all objects",
    ):
        load(writer, tmp_path, camera=1)


# Lights


def test_lights_have_position_direction_and_power(tmp_path: Path) -> None:
    sun = {"type": "directional", "intensity": 3.0, "color": [1.0, 0.5, 0.25]}
    scene = lit_scene(tmp_path, {"type": "point"}, sun, rotation=TURN, translation=[1.0, 2.0, 3.0], scale=[2, 3, 4])
    bulb, sun_light = scene.lights
    assert isinstance(bulb, tl.PointLight)
    assert np.asarray(bulb.position).tolist() == [1.0, 2.0, 3.0]
    assert np.asarray(bulb.intensity).tolist() == [1.0, 1.0, 1.0]
    assert isinstance(sun_light, tl.DirectionalLight)
    np.testing.assert_allclose(sun_light.direction, [-1.0, 0.0, 0.0], atol=1e-15)
    assert np.asarray(sun_light.irradiance).tolist() == [3.0, 1.5, 0.75]


def test_spots_have_cones(tmp_path: Path) -> None:
    angles = {"innerConeAngle": 0.25, "outerConeAngle": float(np.float32(np.pi / 2))}
    lamp = {"type": "spot", "intensity": 2.0, "color": [1.0, 0.5, 0.25], "spot": angles}
    scene = lit_scene(
        tmp_path, lamp, {"type": "spot", "spot": {}}, rotation=TURN, translation=[1, 2, 3], scale=[2, 3, 4]
    )
    wide, plain = scene.lights
    assert isinstance(wide, tl.SpotLight)
    assert np.asarray(wide.position).tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(wide.direction, [-1.0, 0.0, 0.0], atol=1e-15)
    assert np.asarray(wide.intensity).tolist() == [2.0, 1.0, 0.5]
    assert (wide.inner_cone, wide.outer_cone) == (pytest.approx(math.degrees(0.25)), 90.0)
    assert (plain.inner_cone, plain.outer_cone) == (0.0, pytest.approx(45.0))


def test_ranges_are_told(tmp_path: Path) -> None:
    with pytest.warns(tl.TranslucentWarning, match=r"ranges of lights \('Lamp 0', 'Lamp 1'\)"):
        scene = lit_scene(tmp_path, {"type": "spot", "range": 3.0}, {"type": "point", "range": 4.0})
    assert len(scene.lights) == 2


# Singular transforms


FLAT = [1.0, 0.0, 1.0]


@pytest.mark.parametrize("kind", ["directional", "point", "spot"])
@pytest.mark.parametrize("scale", [FLAT, [0.0, 0.0, 0.0]])
def test_a_light_with_a_singular_transform_is_refused(tmp_path: Path, kind: str, scale: list[float]) -> None:
    with pytest.raises(tl.InputError, match=r"light of node 'Lamp 0': the transform is singular .*; use a scale"):
        lit_scene(tmp_path, {"type": kind}, scale=scale)


@pytest.mark.parametrize("scale", [FLAT, [0.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
def test_a_camera_below_a_singular_transform_is_refused_unless_another_is_chosen(
    tmp_path: Path, scale: list[float]
) -> None:
    writer = box_file(tmp_path)
    writer.add("cameras", name="Lens", **PERSPECTIVE)
    writer.add("nodes", name="Crane", camera=0)
    writer.add("nodes", children=[1], scale=scale)
    with pytest.raises(tl.InputError, match=r"camera 'Lens' of node 'Crane': the transform is singular .*use a scale"):
        load(writer, tmp_path)
    assert load(writer, tmp_path, camera=None).camera.fov_y == 30.0


def test_an_object_with_a_singular_transform_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"transform of 'Sheet'; the transform flattens the mesh .*; use a scale"):
        load(box_file(tmp_path, name="Sheet", scale=FLAT), tmp_path)
