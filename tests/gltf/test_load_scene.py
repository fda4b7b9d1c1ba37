"""Scenes from glTF files: nodes and their transforms, units, filling, and files of other people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import translucent as tl
from tests.gltf.gltf_writer import COLOR, TURN, WINE, Writer, box_file, glass, load
from translucent.scene.scene import OPAQUE_COLOR
from translucent.scene.showcase import filled

# Nodes


def test_transforms_multiply_down_the_tree(tmp_path: Path) -> None:
    writer = box_file(tmp_path, name="Leaf", scale=[2.0, 3.0, -4.0], translation=[1.0, 0.0, 0.0])
    writer.add("nodes", rotation=TURN, translation=[0.0, 5.0, 0.0], children=[0])
    matrix = [[0.0, -1.0, 0.0, 7.0], [1.0, 0.0, 0.0, 8.0], [0.0, 0.0, 1.0, 9.0], [0.0, 0.0, 0.0, 1.0]]
    writer.add("nodes", matrix=np.array(matrix).T.ravel().tolist(), children=[1])
    writer.add("scenes", nodes=[2])
    (leaf,) = load(writer, tmp_path).objects
    turn = np.array([[0, 0, 1, 0], [0, 1, 0, 5], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
    local = np.array([[2, 0, 0, 1], [0, 3, 0, 0], [0, 0, -4, 0], [0, 0, 0, 1]], dtype=np.float64)
    np.testing.assert_allclose(leaf.matrix, np.array(matrix) @ turn @ local, atol=1e-14)
    assert leaf.mirrored
    assert leaf.mesh.name == "Leaf"


def test_only_the_default_scene_is_read_and_others_are_told(tmp_path: Path) -> None:
    writer = box_file(tmp_path, name="A")
    writer.add("nodes", mesh=0, name="B")
    writer.add("scenes", nodes=[0], name="First")
    writer.add("scenes", nodes=[1])
    writer.tree["scene"] = 1
    with pytest.warns(tl.TranslucentWarning, match=r"scene 'model.glb': left out: other scenes \('First'\)$"):
        scene = load(writer, tmp_path)
    assert [item.mesh.name for item in scene.objects] == ["B"]
    assert scene.left_out == ("other scenes ('First')",)


def test_without_scenes_all_nodes_are_read(tmp_path: Path) -> None:
    writer = box_file(tmp_path, name="A", children=[1])
    writer.add("nodes", mesh=0, translation=[1.0, 0.0, 0.0])
    assert len(load(writer, tmp_path).objects) == 2


def test_nodes_that_instance_a_mesh_share_its_value(tmp_path: Path) -> None:
    writer = Writer()
    shared, own = writer.mesh(name="Block"), writer.mesh(name="Other")
    for name, mesh in (("Left", shared), ("Right", shared), ("Single", own)):
        writer.add("nodes", mesh=mesh, name=name, scale=[1.0, 1.0, 2.0])
    left, right, single = load(writer, tmp_path).objects
    assert left.mesh is right.mesh
    assert left.mesh is not single.mesh
    assert (left.mesh.name, single.mesh.name) == ("Block", "Single")


def test_primitives_are_objects_and_materials_of_one_name_stay_apart(tmp_path: Path) -> None:
    writer = Writer()
    green = writer.material(name="Material", pbrMetallicRoughness={"baseColorFactor": [0.1, 0.7, 0.2, 1.0]})
    wine = writer.material(name="Material", extensions=WINE)
    writer.mesh(writer.primitive(material=wine), writer.primitive(material=green), writer.primitive())
    writer.add("nodes", mesh=0, name="Cup")
    body, rock, bare = load(writer, tmp_path).objects
    assert [item.mesh.name for item in (body, rock, bare)] == ["Cup[0]", "Cup[1]", "Cup[2]"]
    assert body.medium is not None
    assert (rock.medium, bare.medium) == (None, None)
    assert np.asarray(rock.color).tolist() == [0.1, 0.7, 0.2]
    assert np.asarray(bare.color).tolist() == list(OPAQUE_COLOR)


def test_what_a_scale_of_0_hides_is_left_out(tmp_path: Path) -> None:
    writer = box_file(tmp_path, name="Seen")
    writer.add("nodes", mesh=0, name="Hidden", scale=[0.0, 0.0, 0.0])
    with pytest.warns(tl.TranslucentWarning, match=r"objects with a scale of 0 \('Hidden'\)"):
        assert len(load(writer, tmp_path).objects) == 1


# Units


def test_a_unit_scales_all_lengths_so_that_light_fares_the_same(tmp_path: Path) -> None:
    writer = Writer()
    writer.mesh(writer.primitive(material=writer.material(extensions=WINE)))
    writer.add("nodes", mesh=0, translation=[10.0, 0.0, 0.0])
    writer.add("cameras", type="orthographic", orthographic={"xmag": 1, "ymag": 4, "znear": 0, "zfar": 1})
    writer.add("nodes", camera=0, translation=[10.0, 0.0, 20.0])
    writer.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 5.0}]}}
    writer.add("nodes", translation=[0.0, 30.0, 0.0], extensions={"KHR_lights_punctual": {"light": 0}})
    metre, centimetre = (load(writer, tmp_path, unit=unit) for unit in ("m", "cm"))
    np.testing.assert_allclose(centimetre.bounds, 0.01 * metre.bounds, rtol=1e-14)
    np.testing.assert_allclose(centimetre.camera.eye, [0.1, 0.0, 0.2], rtol=1e-14)
    assert centimetre.camera.height == pytest.approx(0.08, rel=1e-14)
    views = [tl.reference.render(scene, (5, 5)) for scene in (metre, centimetre)]
    assert views[0].coverage.any()
    np.testing.assert_allclose(views[1].transmittance, views[0].transmittance, rtol=1e-12)
    normal = (0.0, 1.0, 0.0)
    lit = [scene.lights[0].irradiance_on((0.0, 0.0, 0.0), normal) for scene in (metre, centimetre)]
    np.testing.assert_allclose(lit[1], lit[0], rtol=1e-14)


# Filling


def test_a_medium_fills_the_translucent_objects_or_else_all(tmp_path: Path) -> None:
    writer = Writer()
    for material in ({"extensions": WINE}, {"extensions": glass(1.0, None)}, {}):
        writer.add("nodes", mesh=writer.mesh(writer.primitive(material=writer.material(**material))))
    medium = tl.Medium(absorption=(1.0, 2.0, 3.0))
    scene = load(writer, tmp_path)
    changed = filled(scene, medium)
    assert [item.medium for item in changed.objects] == [medium, medium, None]
    assert [item.sheet_thickness for item in changed.objects] == [None, None, None]
    assert type(changed) is type(scene)
    opaque = tl.Scene([scene.objects[2]], scene.camera)
    assert [item.medium for item in filled(opaque, medium).objects] == [medium]


# Third-party files


@pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")
@pytest.mark.parametrize(
    "name", ["AttenuationTest", "TransmissionRoughnessTest", "IridescenceSuzanne", "GlassHurricaneCandleHolder"]
)
def test_another_reader_has_all_triangles_in_the_same_places(assets: Path, name: str) -> None:
    path = assets / "gltf" / f"{name}.glb"
    scene = tl.load_scene(path)
    found = np.concatenate(
        [centers(i.mesh.vertices, i.mesh.faces) @ i.matrix[:3, :3].T + i.matrix[:3, 3] for i in scene.objects]
    )
    others = trimesh.load_scene(path, process=False).dump()
    expected = np.concatenate([centers(mesh.vertices, mesh.faces) for mesh in others])
    assert (len(others), len(expected)) == (len(scene.objects), len(found))
    # Welding moves a vertex by 1e-6 of the diagonal of its mesh at most.
    for one, two in ((found, expected), (expected, found)):
        assert cKDTree(one).query(two)[0].max() <= 1e-6 * scene.diagonal


def centers(vertices: Any, faces: Any) -> Any:
    """(m, 3): the middle of each face."""
    return np.asarray(vertices, dtype=np.float64)[faces].mean(axis=1)


def test_the_attenuation_test_has_the_same_shade_in_every_column(assets: Path) -> None:
    """Rows: tinted thin walls, thickness modelled, a row of one mesh, scaled nodes, and attenuation distances."""
    scene = tl.load_scene(assets / "gltf" / "AttenuationTest.glb")
    assert scene.left_out == ()
    assert len(scene.objects) == 23
    assert [item.mesh.name for item in scene.objects if item.medium is None] == ["Labels", "MeterGrid"]
    assert sum(item.sheet_thickness is not None for item in scene.objects) == 5
    columns = {-3.5: 0.25, -2.0: 0.5, 0.0: 1.0, 2.5: 1.5, 6.0: 2.0}
    for x, metres in columns.items():
        for y in (6.0, 3.0, 0.0, -3.0, -6.0):
            view = tl.Camera.orthographic((x, y, 9.0), (x, y, 0.0), height=0.01)
            frame = tl.reference.render(tl.Scene(scene.bodies, view), (1, 1), refraction=False)
            # The file's numbers have 9 digits or more, its lengths 24 bits.
            np.testing.assert_allclose(frame.transmittance[0, 0], np.power(COLOR, metres), rtol=2e-6)


def test_the_transmission_test_has_clear_bodies_of_five_indices(assets: Path) -> None:
    scene = tl.load_scene(assets / "gltf" / "TransmissionRoughnessTest.glb")
    assert scene.left_out == ()
    bodies = {body.mesh.name: body for body in scene.bodies}
    assert {name: body.medium.ior for name, body in bodies.items()} == {
        f"IOR_{ior}": float(ior) for ior in ("1.0", "1.33", "1.50", "1.76", "2.42")
    }
    assert all((body.medium.transmittance(1e9) == 1).all() and body.mesh.diagnosis.solid for body in bodies.values())
    # Below a node at x = 0.2.
    assert bodies["IOR_1.50"].matrix[0, 3] == pytest.approx(0.2, abs=1e-7)


def test_transmission_0_keeps_a_volume_opaque(assets: Path) -> None:
    with pytest.warns(tl.TranslucentWarning, match=r"left out: textures of iridescence \(.*'\)$"):
        scene = tl.load_scene(assets / "gltf" / "IridescenceSuzanne.glb")
    assert [item.medium for item in scene.objects] == [None, None, tl.Medium(ior=1.5)]
    assert np.asarray(scene.objects[0].color) == pytest.approx([0.4, 0.4, 0.4])
    films = [
        item.surface and (item.surface.iridescence_ior, item.surface.iridescence_thickness) for item in scene.objects
    ]
    # The thickness of one varies by a texture.
    assert films == [(ior, pytest.approx(400e-9)) for ior in (1.33, 1.33, 1.8)]
    (light,) = scene.lights
    assert np.asarray(light.irradiance).tolist() == [2.0, 2.0, 2.0]
    assert np.asarray(light.direction).tolist() == [0.0, 0.0, -1.0]
    # Its eyes are open: the body stays one, and the planner names its limits.
    assert "84 open edges" in str(tl.plan(tl.Scene(scene.bodies, scene.camera)).limits)


def test_the_candle_holder_is_of_dense_glass(assets: Path) -> None:
    scene = tl.load_scene(assets / "gltf" / "GlassHurricaneCandleHolder.glb")
    assert scene.left_out == ()
    (glass_body,) = scene.bodies
    assert glass_body.mesh.name == "GlassHurricaneCandleHolder-glass"
    np.testing.assert_allclose(glass_body.medium.transmittance(0.001), (0.8, 0.95, 1.0), rtol=1e-14)
