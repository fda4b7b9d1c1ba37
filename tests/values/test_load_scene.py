"""Scenes from glTF files: transforms, every way to store triangles, materials, cameras, lights, and bad files."""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import translucent as tl
from translucent.gltf.objects import WALL_SHARE
from translucent.scene import OPAQUE_COLOR
from translucent.showcase import LIGHT_TABLE, filled

Json = dict[str, Any]

COLOR = [0.1, 0.5, 0.9]
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
BOX = trimesh.creation.box((2.0, 4.0, 6.0))
# 90 degrees about y: x goes to -z.
TURN = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]


class Writer:
    """A glTF file in the making."""

    def __init__(self) -> None:
        self.tree: Json = {"asset": {"version": "2.0"}}
        self.data = b""

    def add(self, key: str, **item: Any) -> int:
        self.tree.setdefault(key, []).append(item)
        return len(self.tree[key]) - 1

    def view(self, data: bytes, **fields: Any) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        index = self.add("bufferViews", buffer=0, byteOffset=len(self.data), byteLength=len(data), **fields)
        self.data += data
        return index

    def accessor(self, values: Any, dtype: str = "f4", **fields: Any) -> int:
        array = np.asarray(values).astype(f"<{dtype}")
        width = array.shape[1] if array.ndim == 2 else 1
        view = self.view(array.tobytes())
        fields = {"bufferView": view, "componentType": TYPES[dtype], "count": len(array), "type": KINDS[width]} | fields
        return self.add("accessors", **fields)

    def primitive(self, mesh: trimesh.Trimesh = BOX, **fields: Any) -> Json:
        indices = self.accessor(mesh.faces.ravel(), "u2")
        return {"attributes": {"POSITION": self.accessor(mesh.vertices)}, "indices": indices} | fields

    def mesh(self, *primitives: Json, **fields: Any) -> int:
        return self.add("meshes", primitives=list(primitives or [self.primitive()]), **fields)

    def material(self, **fields: Any) -> int:
        return self.add("materials", **fields)

    def save(self, path: Path) -> Path:
        tree = dict(self.tree)
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            tree.setdefault("buffers", [{"byteLength": len(self.data), "uri": uri}])
            path.write_text(json.dumps(tree))
            return path
        tree.setdefault("buffers", [{"byteLength": len(self.data)}])
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        binary = self.data + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path


def glass(transmission: float = 1.0, thickness: float | None = 1.0, ior: float | None = None, **volume: Any) -> Json:
    """Extensions of a material that light passes."""
    found: Json = {"KHR_materials_transmission": {"transmissionFactor": transmission}}
    if thickness is not None:
        found["KHR_materials_volume"] = {"thicknessFactor": thickness, **volume}
    if ior is not None:
        found["KHR_materials_ior"] = {"ior": ior}
    return found


BLENDED = "blending by alphaMode BLEND, drawn as holes where a texture's opacity is below 0.5"
WINE = glass(ior=1.33, attenuationColor=COLOR, attenuationDistance=0.5)


def box_file(path: Path, **node: Any) -> Writer:
    """A box on one node, in the file as yet unsaved."""
    writer = Writer()
    writer.add("nodes", mesh=writer.mesh(), **node)
    return writer


def load(writer: Writer, tmp_path: Path, suffix: str = ".glb", **options: Any) -> Any:
    return tl.load_scene(writer.save(tmp_path / f"model{suffix}"), **options)


def triangles(mesh: tl.Mesh) -> set[tuple[tuple[float, ...], ...]]:
    """The faces of a mesh by the positions of their corners, each from its smallest corner on."""
    found = set()
    for corners in mesh.vertices[mesh.faces].round(6).tolist():
        points = [tuple(corner) for corner in corners]
        first = points.index(min(points))
        found.add(tuple(points[first:] + points[:first]))
    return found


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
    with pytest.warns(tl.TranslucentWarning, match=r"objects hidden by a scale of 0 \('Hidden'\)"):
        assert len(load(writer, tmp_path).objects) == 1


# Triangles


def test_seams_are_welded_so_that_a_box_is_closed(tmp_path: Path) -> None:
    writer = Writer()
    split = trimesh.Trimesh(BOX.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    writer.mesh(writer.primitive(split))
    writer.add("nodes", mesh=0, name="Box")
    mesh = load(writer, tmp_path).objects[0].mesh
    assert mesh.diagnosis.solid
    assert (len(mesh.vertices), mesh.volume) == (8, pytest.approx(48.0, rel=1e-12))
    assert mesh.repairs == ("welded 28 of 36 vertices (within 1e-06 of the diagonal)",)


def test_a_repair_is_a_warning_as_it_is_of_load_mesh(tmp_path: Path) -> None:
    writer = Writer()
    inverted = trimesh.Trimesh(BOX.vertices, BOX.faces[:, ::-1], process=False)
    writer.mesh(writer.primitive(inverted))
    writer.add("nodes", mesh=0, name="Box")
    with pytest.warns(tl.TranslucentWarning, match=r"mesh 'Box': turned 1 closed part outwards"):
        assert load(writer, tmp_path).objects[0].mesh.volume > 0


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize(
    "stored", ["u1", "u2", "u4", "plain", "shared", "strided", "sparse", "sparse from zeros", "i2", "i2 normalized"]
)
def test_every_way_to_store_a_box_gives_the_box(tmp_path: Path, stored: str, suffix: str) -> None:
    writer, expected = Writer(), triangles(tl.Mesh(BOX.vertices, BOX.faces))
    corners, scale, fields = BOX.vertices, 1.0, {}
    positions = None
    if stored in TYPES and stored != "i2":
        fields["indices"] = writer.accessor(BOX.faces.ravel(), stored)
    elif stored == "plain":
        corners = BOX.triangles.reshape(-1, 3)
    else:
        fields["indices"] = writer.accessor(BOX.faces.ravel(), "u2")
    if stored == "shared":  # with the vertices of another primitive, and offsets into one view
        data = np.vstack([corners + 100, corners]).astype("<f4").tobytes()
        view = writer.view(data)
        positions = writer.add("accessors", bufferView=view, byteOffset=96, componentType=5126, count=8, type="VEC3")
    elif stored == "strided":
        rows = np.hstack([corners, np.full((8, 2), 7.0)]).astype("<f4").tobytes()
        view = writer.view(rows[:-8], byteStride=20)  # the last element need not fill its stride
        positions = writer.add("accessors", bufferView=view, componentType=5126, count=8, type="VEC3")
    elif stored.startswith("sparse"):
        zeros = stored.endswith("zeros")
        changed = np.arange(8) if zeros else np.array([1, 6])
        wrong = corners.copy()
        wrong[changed] = 55.0
        sparse = {
            "count": len(changed),
            "indices": {"bufferView": writer.view(changed.astype("u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": writer.view(corners[changed].astype("<f4").tobytes())},
        }
        positions = writer.accessor(wrong, sparse=sparse)
        if zeros:
            del writer.tree["accessors"][positions]["bufferView"]
    elif stored.startswith("i2"):
        # Halves of the sides are 1, 2 and 3: as integers, or as shares of the largest one.
        full = 32767 if stored.endswith("normalized") else 3
        positions = writer.accessor(np.rint(corners / 3 * full), "i2", normalized=stored.endswith("normalized"))
        scale = 3.0 if stored.endswith("normalized") else 1.0
    attributes = {"POSITION": writer.accessor(corners) if positions is None else positions}
    writer.mesh({"attributes": attributes, **fields})
    writer.add("nodes", mesh=0, scale=[scale] * 3)
    (box,) = load(writer, tmp_path, suffix).objects
    if scale == 1.0:
        assert triangles(box.mesh) == expected
    else:  # to half a step of 1/32767
        world = np.sort(box.mesh.vertices * scale, axis=0)
        np.testing.assert_allclose(world, np.sort(BOX.vertices, axis=0), atol=3 * 0.5 / 32767)
        assert box.mesh.diagnosis.solid


def test_buffers_may_be_several_and_lie_beside_the_file(tmp_path: Path) -> None:
    writer = box_file(tmp_path)
    (tmp_path / "two words.bin").write_bytes(writer.data)
    writer.tree["buffers"] = [
        {"byteLength": 3, "uri": "data:;base64,AAAA"},
        {"byteLength": len(writer.data), "uri": "two%20words.bin"},
    ]
    for view in writer.tree["bufferViews"]:
        view["buffer"] = 1
    (box,) = load(writer, tmp_path, ".gltf").objects
    assert box.mesh.volume == pytest.approx(48.0, rel=1e-12)


@pytest.mark.parametrize(
    ("mode", "corners", "faces"),
    [
        (4, [0, 1, 2, 2, 1, 3], [(0, 1, 2), (2, 1, 3)]),
        (5, [0, 1, 2, 3, 4], [(0, 1, 2), (1, 3, 2), (2, 3, 4)]),
        (5, [0, 1, 2, 2, 3, 3, 4, 0], [(0, 1, 2), (3, 0, 4)]),  # two strips, joined without area
        (6, [0, 1, 2, 3, 4], [(1, 2, 0), (2, 3, 0), (3, 4, 0)]),
    ],
)
def test_lists_strips_and_fans_have_the_winding_of_the_specification(
    tmp_path: Path, mode: int, corners: list[int], faces: list[tuple[int, ...]]
) -> None:
    # No faces share an edge twice the wrong way, so that nothing is turned on the way.
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [1.5, 1.5, 0.5], [-1, 2, 1]], dtype=np.float64)
    writer = Writer()
    writer.mesh(
        {"attributes": {"POSITION": writer.accessor(points)}, "indices": writer.accessor(corners, "u1")}
        | {"mode": mode}
    )
    writer.add("nodes", mesh=0)
    (item,) = load(writer, tmp_path).objects
    assert triangles(item.mesh) == triangles(tl.Mesh(points, faces))


def test_points_and_lines_are_left_out_and_texture_coordinates_count_upwards(tmp_path: Path) -> None:
    writer = Writer()
    box = writer.primitive()
    box["attributes"]["TEXCOORD_0"] = writer.accessor(np.tile([[0.25, 0.0]], (8, 1)))
    box["attributes"]["COLOR_0"] = writer.accessor(np.ones((8, 3)))
    writer.mesh(box, writer.primitive(mode=1))
    writer.add("nodes", mesh=0, name="Box")
    with pytest.warns(tl.TranslucentWarning, match=r"vertex colors \('Box\[0\]'\); points and lines \('Box\[1\]'\)"):
        (item,) = load(writer, tmp_path).objects
    assert item.mesh.uv is not None
    assert set(map(tuple, item.mesh.uv.tolist())) == {(0.25, 1.0)}


# Materials


def material_scene(tmp_path: Path, material: Json, **options: Any) -> Any:
    writer = Writer()
    writer.mesh(writer.primitive(material=writer.material(**material)))
    writer.add("nodes", mesh=0, name="Thing", scale=[3.0, 3.0, 3.0])
    return load(writer, tmp_path, **options)


def test_a_volume_is_a_body_whose_attenuation_no_scale_changes(tmp_path: Path) -> None:
    (body,) = material_scene(tmp_path, {"extensions": WINE}).objects
    assert body.sheet_thickness is None
    np.testing.assert_allclose(body.medium.transmittance(0.5), COLOR, rtol=1e-14)
    assert body.medium.ior == 1.33


@pytest.mark.parametrize("thickness", [None, 0.0])
def test_transmission_without_a_volume_is_a_thin_wall_with_its_tint(tmp_path: Path, thickness: float | None) -> None:
    base = {"baseColorFactor": [*COLOR, 1.0]}
    volume = {} if thickness is None else {"attenuationColor": [0.5] * 3, "attenuationDistance": 0.1}
    material = {"extensions": glass(1.0, thickness, **volume), "pbrMetallicRoughness": base}
    scene = material_scene(tmp_path, material)
    (wall,) = scene.objects
    assert wall.sheet_thickness == pytest.approx(WALL_SHARE * scene.diagonal, rel=1e-14)
    np.testing.assert_allclose(wall.medium.transmittance(wall.sheet_thickness), COLOR, rtol=1e-14)
    assert wall.medium.ior == 1.5
    assert scene.left_out == ()
    truth = tl.reference.render(scene, (3, 3))
    assert truth.coverage[1, 1]
    # Two faces, each at a slant: between the squares of the straight tint and of its 1.34th power.
    assert (truth.transmittance[1, 1] <= np.square(COLOR)).all()
    assert (truth.transmittance[1, 1] >= np.power(COLOR, 2 * 1.35)).all()


@pytest.mark.parametrize(
    "extensions",
    [
        {},
        glass(0.0, 2.0, attenuationColor=COLOR, attenuationDistance=1.0),
        {"KHR_materials_volume": {"thicknessFactor": 1.0}},
        glass(0.0, None),
        {"VENDOR_lacquer": {}},
        glass(0.0) | {"VENDOR_lacquer": {}},
        glass(0.0) | {"KHR_materials_diffuse_transmission": {}},
    ],
    ids=["plain", "volume with transmission 0", "volume alone", "transmission 0", "unknown", "its volume", "diffuse 0"],
)
def test_everything_else_is_opaque_in_its_base_color(tmp_path: Path, extensions: Json) -> None:
    material = {"extensions": extensions, "pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 0.5]}}
    (item,) = material_scene(tmp_path, material).objects
    assert (item.medium, item.sheet_thickness) == (None, None)
    assert np.asarray(item.color).tolist() == [0.25, 0.5, 0.75]


@pytest.mark.parametrize(
    ("material", "line"),
    [
        ({"alphaMode": "BLEND"}, f"{BLENDED} ('Stuff')"),
        ({"alphaMode": "MASK", "extensions": glass()}, "transparency by alphaMode MASK ('Stuff')"),
        (
            {"emissiveFactor": [0.0, 0.5, 0.0], "extensions": glass()},
            "glowing surfaces of translucent objects ('Stuff')",
        ),
        ({"occlusionTexture": {"index": 0}}, "occlusion textures ('Stuff')"),
        (
            {
                "extensions": {
                    "KHR_materials_diffuse_transmission": {
                        "diffuseTransmissionFactor": 1,
                        "diffuseTransmissionTexture": {"index": 0},
                    }
                }
            },
            "textures of diffuse transmission ('Stuff')",
        ),
        (
            {"extensions": glass() | {"KHR_materials_dispersion": {"dispersion": 11.0}}},
            "dispersion above 10 ('Stuff')",
        ),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_what_a_material_loses_is_told(tmp_path: Path, material: Json, line: str) -> None:
    with pytest.warns(tl.TranslucentWarning) as caught:
        scene = material_scene(tmp_path, {"name": "Stuff", **material})
    assert scene.left_out == (line,)
    assert [str(warning.message) for warning in caught] == [f"scene 'model.glb': left out: {line}"]


def test_losses_are_listed_once_and_shortly(tmp_path: Path) -> None:
    writer = Writer()
    for i in range(6):
        blend = writer.material(name=f"Blend {min(i, 4)}", alphaMode="BLEND")
        writer.add("nodes", mesh=writer.mesh(writer.primitive(material=blend)))
    writer.tree["extensionsUsed"] = ["KHR_materials_clearcoat", "KHR_materials_volume", "EXT_mesh_gpu_instancing"]
    writer.add("animations", channels=[])
    with pytest.warns(tl.TranslucentWarning):
        scene = load(writer, tmp_path)
    assert scene.left_out == (
        "extensions (KHR_materials_clearcoat, EXT_mesh_gpu_instancing)",
        f"{BLENDED} ('Blend 0', 'Blend 1', 'Blend 2' and 2 more)",
        "animations (1)",
    )


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
        with pytest.raises(tl.InputError, match=r"it has 0 of node 'F', 1 of node 'S'; give one of these numbers"):
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
    with pytest.raises(tl.InputError, match=r"camera 1 of '.*model.glb'; it has no cameras; leave the camera out"):
        load(writer, tmp_path, camera=1)


# Lights


def lit_scene(tmp_path: Path, *lights: Json, **node: Any) -> Any:
    writer = box_file(tmp_path)
    writer.tree["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
    for i in range(len(lights)):
        writer.add("nodes", name=f"Lamp {i}", extensions={"KHR_lights_punctual": {"light": i}}, **node)
    return load(writer, tmp_path)


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


def test_spots_and_ranges_are_told(tmp_path: Path) -> None:
    with pytest.warns(tl.TranslucentWarning, match=r"spot lights \('Lamp 0'\); ranges of lights \('Lamp 1'\)"):
        scene = lit_scene(tmp_path, {"type": "spot", "spot": {}}, {"type": "point", "range": 4.0})
    assert len(scene.lights) == 1


# Singular transforms

FLAT = [1.0, 0.0, 1.0]


@pytest.mark.parametrize("kind", ["directional", "point", "spot"])
@pytest.mark.parametrize("scale", [FLAT, [0.0, 0.0, 0.0]])
def test_a_light_with_a_singular_transform_is_refused(tmp_path: Path, kind: str, scale: list[float]) -> None:
    with pytest.raises(tl.InputError, match=r"light of node 'Lamp 0': its transform is singular .*; give every axis"):
        lit_scene(tmp_path, {"type": kind}, scale=scale)


@pytest.mark.parametrize("scale", [FLAT, [0.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
def test_a_camera_below_a_singular_transform_is_refused_unless_another_is_chosen(
    tmp_path: Path, scale: list[float]
) -> None:
    writer = box_file(tmp_path)
    writer.add("cameras", name="Lens", **PERSPECTIVE)
    writer.add("nodes", name="Crane", camera=0)
    writer.add("nodes", children=[1], scale=scale)
    with pytest.raises(
        tl.InputError, match=r"camera 'Lens' of node 'Crane': its transform is singular .*give every axis"
    ):
        load(writer, tmp_path)
    assert load(writer, tmp_path, camera=None).camera.fov_y == 30.0


def test_an_object_with_a_singular_transform_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"transform of 'Sheet'; it flattens the mesh .*; give every axis"):
        load(box_file(tmp_path, name="Sheet", scale=FLAT), tmp_path)


# Bad files


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression.*without compression"),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "EXT_meshopt_compression.*without compression"),
        ({"extensionsRequired": ["VENDOR_magic"]}, "requires VENDOR_magic, which is not supported; export it without"),
        ({"extensionsRequired": "all"}, "extensionsRequired is 'all', not a list of names"),
        ({"nodes": []}, "its scene has no triangles; give a file with a mesh"),
        ({"nodes": [{"mesh": 1}]}, "meshes 1 is not one of 1"),
        ({"nodes": [{"mesh": [0]}]}, r"meshes \[0\] is not one of 1"),
        ({"nodes": [{"mesh": 0, "camera": 0}]}, "cameras 0 is not one of 0"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "their own parents"),
        ({"nodes": [{"mesh": 0, "scale": [1e300, 1, 1]}]}, r"node number 0: its transform exceeds 1e\+18"),
        ({"nodes": [{"mesh": 0, "rotation": [1e200, 0, 0, 1]}]}, r"node number 0: its transform exceeds 1e\+18"),
        ({"nodes": [{"mesh": 0, "extensions": []}]}, r"extensions is \[\], not an object"),
        ({"scenes": [{"nodes": [7]}]}, "nodes 7 is not one of 1"),
        ({"scenes": [{"nodes": 0}]}, "scene 0: nodes is 0, not a list"),
        ({"scene": 3, "scenes": [{}]}, "scenes 3 is not one of 1"),
        ({"scenes": [{}]}, "its scene has no triangles"),
        ({"meshes": [{}]}, "a mesh has no list of primitives"),
        ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "accessors None is not one of 2"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "mode": 9}]}]}, "mode 9 is none of glTF"),
        (
            {"meshes": [{"primitives": [{"attributes": {"POSITION": 1}}]}]},
            "8 corners make no whole number of triangles",
        ),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}, "type 'SCALAR' where VEC3 belongs"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 1}]}]}, "'VEC3' where SCALAR belongs"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "material": 4}]}]}, "materials 4 is not one of 0"),
        ({"buffers": [{"byteLength": 99, "uri": "gone.bin"}]}, "'gone.bin' cannot be read.*keep its files together"),
        ({"buffers": [{"byteLength": 9, "uri": "data:;base64,AAAA"}]}, "accessor 1 leaves its buffer"),
        ({"buffers": []}, "buffers 0 is not one of 0"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_bad_file_is_refused_in_words(tmp_path: Path, change: Json, message: str) -> None:
    writer = box_file(tmp_path)
    writer.tree |= change
    with pytest.raises(tl.InputError, match=message) as caught:
        load(writer, tmp_path)
    assert "\n" not in str(caught.value)
    assert str(tmp_path / "model.glb") in str(caught.value)


@pytest.mark.parametrize(
    ("accessor", "change", "message"),
    [
        (0, {"count": 37}, "accessor 0 leaves its buffer"),
        (0, {"count": 0}, "accessor 0 leaves its buffer"),
        (0, {"count": 3.0}, "count is 3.0, not a whole number"),
        (0, {"count": 10**12}, "accessor 0 has 1000000000000 elements"),
        (0, {"componentType": 5122}, "indices are no unsigned integers"),
        (1, {"componentType": 5}, "componentType 5 is none of glTF"),
        (1, {"byteOffset": -4}, "byteOffset is -4, not a whole number"),
        (1, {"bufferView": 9}, "bufferViews 9 is not one of 2"),
        (1, {"count": 5}, r"index 7 points outside the 5 vertices"),
        (1, {"bufferView": None}, "accessor 1 has no data; export the file without compression"),
        (
            1,
            {"sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5123}, "values": {"bufferView": 1}}},
            "a sparse index is not one of 1",
        ),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_bad_accessor_is_refused_in_words(tmp_path: Path, accessor: int, change: Json, message: str) -> None:
    writer = box_file(tmp_path)
    entry = writer.tree["accessors"][accessor]
    entry |= change
    if entry["bufferView"] is None:
        del entry["bufferView"]
    if "sparse" in entry:
        entry["count"] = 1
        writer.tree["accessors"][0]["count"] = 3
    with pytest.raises(tl.InputError, match=message):
        load(writer, tmp_path)


def test_coordinates_that_are_not_finite_are_refused_by_name(tmp_path: Path) -> None:
    writer = Writer()
    points = BOX.vertices.copy()
    points[3, 1] = np.nan
    writer.mesh(writer.primitive(trimesh.Trimesh(points, BOX.faces, process=False)))
    writer.add("nodes", mesh=0, name="Broken")
    with pytest.raises(tl.InputError, match=r"mesh 'Broken'; 1 vertices are not finite \(first: 3\)"):
        load(writer, tmp_path)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"type": "perspective", "perspective": {}}, "yfov is None, not a number"),
        ({"type": "perspective", "perspective": {"yfov": 4.0}}, "yfov of 229.183 degrees is not between 0 and 180"),
        ({"type": "perspective"}, "yfov is None, not a number"),
        ({"type": "orthographic", "orthographic": {"ymag": 0}}, "ymag 0 is not above 0"),
        ({"type": "panoramic"}, "type 'panoramic' is neither perspective nor orthographic"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_bad_camera_is_refused_in_words(tmp_path: Path, camera: Json, message: str) -> None:
    writer = box_file(tmp_path)
    writer.add("cameras", **camera)
    writer.add("nodes", camera=0, name="Eye")
    with pytest.raises(tl.InputError, match=f"camera number 0 of node 'Eye': {message}"):
        load(writer, tmp_path)


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ({"type": "area"}, "type 'area' is neither point, directional nor spot"),
        ({"type": "point", "intensity": -1}, "below 0"),
        ({"type": "point", "intensity": "bright"}, "intensity is 'bright', not a number"),
        ({"type": "point", "color": [1, 1]}, r"color is \[1, 1\], not 3 numbers"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_bad_light_is_refused_in_words(tmp_path: Path, light: Json, message: str) -> None:
    with pytest.raises(tl.InputError, match=f"light of node 'Lamp 0': .*{message}"):
        lit_scene(tmp_path, light)


@pytest.mark.parametrize("index", [1, -1, None, True])
def test_a_light_that_is_not_there_is_refused(tmp_path: Path, index: object) -> None:
    writer = box_file(tmp_path)
    writer.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    writer.add("nodes", extensions={"KHR_lights_punctual": {"light": index}})
    with pytest.raises(tl.InputError, match=r"light of node number 1: light .* is not one of"):
        load(writer, tmp_path)


def test_a_bad_base_color_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"material 'Hot': baseColorFactor .* is not in 0..1"):
        material_scene(tmp_path, {"name": "Hot", "pbrMetallicRoughness": {"baseColorFactor": [2.0, 1.0, 1.0, 1.0]}})


@pytest.mark.parametrize("name", ["model.obj", "model", "missing.stl"])
def test_what_is_no_gltf_is_sent_to_load_mesh(tmp_path: Path, name: str) -> None:
    (tmp_path / "model.obj").write_text("v 0 0 0\n")
    with pytest.raises(tl.InputError, match=r"scenes are glTF files; .*tl\.load_mesh"):
        tl.load_scene(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"\x00\xff" * 200, "its JSON is broken"),
        (b"glTF\x02\0\0\0\xff\xff\0\0", "cut short"),
        (b"{}", "no asset, so it is not glTF 2.0"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "model.glb"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(tl.InputError, match=message):
        tl.load_scene(path)


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
    with pytest.warns(tl.TranslucentWarning, match=r"left out: extensions \(KHR_materials_iridescence\)$"):
        scene = tl.load_scene(assets / "gltf" / "IridescenceSuzanne.glb")
    assert [item.medium for item in scene.objects] == [None, None, tl.Medium(ior=1.5)]
    assert np.asarray(scene.objects[0].color) == pytest.approx([0.4, 0.4, 0.4])
    (light,) = scene.lights
    assert np.asarray(light.irradiance).tolist() == [2.0, 2.0, 2.0]
    assert np.asarray(light.direction).tolist() == [0.0, 0.0, -1.0]
    # Its eyes are open: the body stays one, and the planner names its limits.
    assert "84 open edges" in str(tl.plan(tl.Scene(scene.bodies, scene.camera)).limits)


def test_the_candle_holder_is_of_dense_glass(assets: Path) -> None:
    with pytest.warns(tl.TranslucentWarning, match=r"left out: occlusion textures \(.*'\)$"):
        scene = tl.load_scene(assets / "gltf" / "GlassHurricaneCandleHolder.glb")
    (glass_body,) = scene.bodies
    assert glass_body.mesh.name == "GlassHurricaneCandleHolder-glass"
    np.testing.assert_allclose(glass_body.medium.transmittance(0.001), (0.8, 0.95, 1.0), rtol=1e-14)
