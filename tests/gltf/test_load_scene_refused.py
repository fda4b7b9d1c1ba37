"""glTF files that are refused, in words that say what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.gltf.gltf_writer import BOX, Json, Writer, box_file, lit_scene, load, material_scene


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression.*without compression"),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "EXT_meshopt_compression.*without compression"),
        ({"extensionsRequired": ["VENDOR_magic"]}, "requires VENDOR_magic, which is not supported; export it without"),
        ({"extensionsRequired": "all"}, "extensionsRequired is 'all', not a list of names"),
        ({"nodes": []}, "the scene of the file has no triangles; give a file with a mesh"),
        ({"nodes": [{"mesh": 1}]}, "meshes 1 does not exist: the file has 1"),
        ({"nodes": [{"mesh": [0]}]}, r"meshes \[0\] does not exist: the file has 1"),
        ({"nodes": [{"mesh": 0, "camera": 0}]}, "cameras 0 does not exist: the file has 0"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "their own ancestors"),
        ({"nodes": [{"mesh": 0, "scale": [1e300, 1, 1]}]}, r"node number 0: the transform has values beyond 1e\+18"),
        (
            {"nodes": [{"mesh": 0, "rotation": [1e200, 0, 0, 1]}]},
            r"node number 0: the transform has values beyond 1e\+18",
        ),
        ({"nodes": [{"mesh": 0, "extensions": []}]}, r"extensions is \[\], not an object"),
        ({"scenes": [{"nodes": [7]}]}, "nodes 7 does not exist: the file has 1"),
        ({"scenes": [{"nodes": 0}]}, "scene 0: nodes is 0, not a list"),
        ({"scene": 3, "scenes": [{}]}, "scenes 3 does not exist: the file has 1"),
        ({"scenes": [{}]}, "the scene of the file has no triangles"),
        ({"meshes": [{}]}, "a mesh has no list of primitives"),
        ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "accessors None does not exist: the file has 2"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "mode": 9}]}]}, "mode 9 is not defined in glTF"),
        (
            {"meshes": [{"primitives": [{"attributes": {"POSITION": 1}}]}]},
            "has 8 corners, which is not a multiple of 3",
        ),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}, "the type is 'SCALAR', but must be VEC3"),
        (
            {"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 1}]}]},
            "the type is 'VEC3', but must be SCALAR",
        ),
        (
            {"meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "material": 4}]}]},
            "materials 4 does not exist: the file has 0",
        ),
        (
            {"buffers": [{"byteLength": 99, "uri": "gone.bin"}]},
            "'gone.bin' cannot be read.*keep all files of the model together",
        ),
        (
            {"buffers": [{"byteLength": 9, "uri": "data:;base64,AAAA"}]},
            "accessor 1 exceeds its buffer",
        ),
        ({"buffers": []}, "buffers 0 does not exist: the file has 0"),
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
        (0, {"count": 37}, "accessor 0 exceeds its buffer"),
        (0, {"count": 0}, "accessor 0 exceeds its buffer"),
        (0, {"count": 3.0}, "count is 3.0, not a whole number"),
        (0, {"count": 10**12}, "accessor 0 has 1000000000000 elements"),
        (0, {"componentType": 5122}, "indices are not unsigned integers"),
        (1, {"componentType": 5}, "componentType 5 is not defined in glTF"),
        (1, {"byteOffset": -4}, "byteOffset is -4, not a whole number"),
        (1, {"bufferView": 9}, "bufferViews 9 does not exist: the file has 2"),
        (1, {"count": 5}, r"the index 7 is beyond the last of 5 vertices"),
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
        ({"type": "area"}, "the type 'area' is not point, directional or spot"),
        ({"type": "point", "intensity": -1}, "below 0"),
        (
            {"type": "spot", "spot": {"innerConeAngle": 0.8}},
            "innerConeAngle 0.8 and outerConeAngle 0.785398 must satisfy 0 <= inn",
        ),
        (
            {"type": "spot", "spot": {"outerConeAngle": 1.6}},
            "innerConeAngle 0 and outerConeAngle 1.6 must satisfy 0 <= inner < ",
        ),
        ({"type": "spot", "spot": {"innerConeAngle": -0.1}}, "innerConeAngle -0.1 and outerConeAngle 0.7"),
        ({"type": "spot", "spot": []}, r"spot is \[\], not an object"),
        ({"type": "point", "intensity": "bright"}, "intensity is 'bright', not a number"),
        ({"type": "point", "color": [1, 1]}, r"color is \[1, 1\], not three numbers"),
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
    with pytest.raises(
        tl.InputError,
        match=r"light of node number 1: (light .* does not exist|the light index .* is not a whole number)",
    ):
        load(writer, tmp_path)


def test_a_bad_base_color_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"material 'Hot': baseColorFactor.* is not in 0..1"):
        material_scene(tmp_path, {"name": "Hot", "pbrMetallicRoughness": {"baseColorFactor": [2.0, 1.0, 1.0, 1.0]}})


@pytest.mark.parametrize("name", ["model.obj", "model", "missing.stl"])
def test_what_is_no_gltf_is_sent_to_load_mesh(tmp_path: Path, name: str) -> None:
    (tmp_path / "model.obj").write_text("v 0 0 0\n")
    with pytest.raises(tl.InputError, match=r"is not that of a glTF file; .*tl\.load_mesh"):
        tl.load_scene(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no file has this path"),
        (b"\x00\xff" * 200, r"the JSON of the file is broken \("),
        (b"glTF\x02\0\0\0\xff\xff\0\0", "the file is cut off after"),
        (b"{}", r"the JSON of the file has no 'asset', so the file is not glTF 2\.0"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "model.glb"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(tl.InputError, match=message):
        tl.load_scene(path)
