"""glTF files written: what was there stays, what is written is read back, and the Khronos validator accepts it."""

from __future__ import annotations

import base64
import copy
import io
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from translucent.materials.color_distance import BLACKEST
from translucent.materials.gltf import materials_of, read_materials
from translucent.materials.gltf_file import GltfFile, read_gltf, write_gltf
from translucent.materials.gltf_scene import material_uses
from translucent.materials.gltf_write import write_medium

JADE = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02, ior=1.5)

Json = dict[str, Any]


def gltf(*materials: Json, **more: Any) -> Json:
    return {"asset": {"version": "2.0"}, "materials": list(materials), **more}


def saved(path: Path, tree: Json) -> Path:
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


@pytest.fixture
def two_boxes(tmp_path: Path) -> Path:
    """Two meshes and three nodes that share one material; a second material is used by nobody."""
    positions = np.array(trimesh.creation.box((1, 2, 3)).triangles.reshape(-1, 3), dtype="<f4")
    data = positions.tobytes()
    primitive = {"attributes": {"POSITION": 0}, "material": 0}
    tree = gltf(
        {"name": "Glass", "doubleSided": True, "emissiveFactor": [0, 0.5, 0], "extras": {"kept": [1, 2]}},
        {"name": "Unused", "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}}},
        extensionsUsed=["KHR_materials_clearcoat"],
        scene=0,
        scenes=[{"nodes": [0, 1, 2]}],
        nodes=[
            {"name": "Left", "mesh": 0, "translation": [1, 2, 3]},
            {"name": "Right", "mesh": 0},
            {"name": "Other", "mesh": 1},
        ],
        meshes=[{"name": "Box", "primitives": [primitive]}, {"name": "Box2", "primitives": [dict(primitive)]}],
        accessors=[
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            }
        ],
        bufferViews=[{"buffer": 0, "byteLength": len(data), "target": 34962}],
        buffers=[{"byteLength": len(data)}],
    )
    path = tmp_path / "boxes.glb"
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    # An unknown chunk at the end has to survive, too.
    chunks = struct.pack("<II", len(data), 0x004E4942) + data + struct.pack("<II4s", 4, 0x12345678, b"more")
    header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(chunks))
    path.write_bytes(header + struct.pack("<II", len(text), 0x4E4F534A) + text + chunks)
    return path


# Files


def test_a_file_written_as_it_was_read_is_the_same(two_boxes: Path, tmp_path: Path) -> None:
    file = read_gltf(two_boxes)
    write_gltf(file, tmp_path / "again.glb")
    again = read_gltf(tmp_path / "again.glb")
    assert (again.tree, again.chunks) == (file.tree, file.chunks)
    assert file.chunks.endswith(b"more")


def test_the_containers_turn_into_each_other(two_boxes: Path, tmp_path: Path) -> None:
    glb = read_gltf(two_boxes)
    write_gltf(glb, tmp_path / "boxes.gltf")
    text = read_gltf(tmp_path / "boxes.gltf")
    assert text.chunks == b""
    assert text.resource(text.tree["buffers"][0]) == glb.resource(glb.tree["buffers"][0])
    write_gltf(text, tmp_path / "back.glb")
    back = read_gltf(tmp_path / "back.glb")
    assert back.tree == glb.tree
    assert back.resource(back.tree["buffers"][0]) == glb.resource(glb.tree["buffers"][0])


def test_links_hold_from_another_folder(tmp_path: Path) -> None:
    (tmp_path / "in" / "a b").mkdir(parents=True)
    (tmp_path / "in" / "a b" / "mesh.bin").write_bytes(b"1234")
    tree = gltf({}, buffers=[{"uri": "a%20b/mesh.bin", "byteLength": 4}])
    (tmp_path / "out").mkdir()
    write_gltf(read_gltf(saved(tmp_path / "in" / "m.gltf", tree)), tmp_path / "out" / "m.gltf")
    moved = read_gltf(tmp_path / "out" / "m.gltf")
    assert moved.tree["buffers"][0]["uri"] == "../in/a%20b/mesh.bin"
    assert moved.resource(moved.tree["buffers"][0]) == b"1234"


def uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


@pytest.fixture
def in_pieces(tmp_path: Path) -> Path:
    """A .gltf in all kinds of pieces: embedded and linked buffers and images, a view with an offset."""
    positions, indices = np.eye(3, dtype="<f4").tobytes(), np.array([0, 1, 2], dtype="<u2").tobytes()
    image = io.BytesIO()
    Image.new("RGB", (2, 1), (9, 8, 7)).save(image, format="PNG")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "mesh.bin").write_bytes(b"skip" + positions + b"more than it says")
    (tmp_path / "in" / "beside.png").write_bytes(image.getvalue())
    tree = gltf(
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "emissiveTexture": {"index": 1}},
        scene=0,
        scenes=[{"nodes": [0]}],
        nodes=[{"mesh": 0}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 1, "TEXCOORD_0": 2}, "indices": 0, "material": 0}]}],
        accessors=[
            {"bufferView": 0, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {
                "bufferView": 1,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 1],
            },
            {"bufferView": 2, "byteOffset": 4, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        bufferViews=[
            {"buffer": 0, "byteLength": 6, "target": 34963},
            {"buffer": 1, "byteOffset": 4, "byteLength": 36, "target": 34962},
            {"buffer": 2, "byteLength": 28, "target": 34962},
        ],
        buffers=[
            {"uri": uri(indices), "byteLength": 6, "name": "first"},
            {"uri": "mesh.bin", "byteLength": 40},
            {"uri": uri(positions), "byteLength": 28},
        ],
        textures=[{"source": 0}, {"source": 1}],
        images=[{"uri": uri(image.getvalue(), "image/png"), "name": "inside"}, {"uri": "beside.png"}],
    )
    return saved(tmp_path / "in" / "pieces.gltf", tree)


def test_the_pieces_of_a_gltf_become_one_chunk(in_pieces: Path, tmp_path: Path) -> None:
    before = read_gltf(in_pieces)
    write_gltf(before, tmp_path / "out.glb")
    after = read_gltf(tmp_path / "out.glb")
    old, new = before.items("bufferViews"), after.items("bufferViews")
    assert [after.resource({"bufferView": i}) for i in range(3)] == [
        before.resource({"bufferView": i}) for i in range(3)
    ]
    assert [{**view, "buffer": 0, "byteOffset": 0} for view in new[:3]] == [
        {**view, "buffer": 0, "byteOffset": 0} for view in old
    ]
    assert all(view["byteOffset"] % 4 == 0 for view in new[1:])
    (buffer,) = after.items("buffers")
    assert (buffer["name"], set(buffer)) == ("first", {"name", "byteLength"})
    # Of each buffer as many bytes as it says, in steps of 4: 6, 40, 28; then the image.
    assert (new[3]["byteOffset"], buffer["byteLength"]) == (8 + 40 + 28, 76 + new[3]["byteLength"])
    inside, beside = after.items("images")
    assert (inside["name"], inside["mimeType"], inside["bufferView"]) == ("inside", "image/png", 3)
    assert after.resource(inside) == before.resource(before.items("images")[0])
    assert beside == {"uri": "in/beside.png"}
    kept = ("materials", "meshes", "accessors", "textures", "nodes")
    assert [after.tree[key] for key in kept] == [before.tree[key] for key in kept]
    loaded = [next(iter(trimesh.load_scene(path).geometry.values())) for path in (in_pieces, tmp_path / "out.glb")]
    np.testing.assert_array_equal(loaded[0].triangles, loaded[1].triangles)


def test_compressed_views_and_their_empty_fallback_move_along(tmp_path: Path) -> None:
    compressed = {"EXT_meshopt_compression": {"buffer": 2, "byteOffset": 4, "byteLength": 4}}
    tree = gltf(
        {},
        bufferViews=[{"buffer": 1, "byteLength": 90, "extensions": compressed}, {"buffer": 2, "byteLength": 4}],
        buffers=[
            {"uri": uri(b"12345"), "byteLength": 5},
            {"byteLength": 90, "extensions": {"EXT_meshopt_compression": {"fallback": True}}},
            {"uri": uri(b"abcdefgh"), "byteLength": 8},
        ],
    )
    write_gltf(GltfFile(tmp_path / "a.gltf", tree), tmp_path / "a.glb")
    file = read_gltf(tmp_path / "a.glb")
    packed, plain = file.items("bufferViews")
    assert (packed["buffer"], packed.get("byteOffset", 0)) == (1, 0)
    assert file.items("buffers")[1] == tree["buffers"][1]
    assert file.resource(file.items("buffers")[0]) == b"12345\0\0\0abcdefgh"
    moved = packed["extensions"]["EXT_meshopt_compression"]
    assert (moved["buffer"], moved["byteOffset"], plain["buffer"], plain["byteOffset"]) == (0, 12, 0, 8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"buffers": [{"uri": uri(b"123"), "byteLength": 9}]}, "buffer 0 should have 9 bytes and has 3"),
        ({"buffers": [{"uri": uri(b"123")}]}, "buffer 0 should have None bytes"),
        ({"buffers": [{"uri": "none.bin", "byteLength": 9}]}, "'none.bin' cannot be read"),
        ({"buffers": [{"uri": uri(b"123"), "byteLength": 3}], "bufferViews": [{"buffer": 1}]}, "view of buffer 1"),
        ({"buffers": [{"uri": uri(b"123"), "byteLength": 3}], "bufferViews": [{"buffer": []}]}, "view of buffer"),
        ({"images": [{"uri": "data:image/png;base64,!"}]}, "cannot be read"),
    ],
)
def test_pieces_that_are_broken_are_refused(tmp_path: Path, change: Json, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        write_gltf(GltfFile(tmp_path / "a.gltf", gltf({}, **change)), tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_an_image_without_a_kind_stays_as_it_is(tmp_path: Path) -> None:
    tree = gltf({}, images=[{"uri": "data:;base64,AAAA"}])
    write_gltf(GltfFile(tmp_path / "a.gltf", tree), tmp_path / "a.glb")
    assert read_gltf(tmp_path / "a.glb").tree == tree


def test_broken_files_are_refused_in_one_line(two_boxes: Path, tmp_path: Path) -> None:
    whole = two_boxes.read_bytes()
    cases = {
        "cut.glb": (whole[:-10], "cut short"),
        "head.glb": (whole[:14], "cut short"),
        "json.glb": (whole.replace(b'"asset":', b'"asset";', 1), "its JSON is broken"),
        "old.glb": (whole[:4] + b"\1\0\0\0" + whole[8:], "GLB version 1"),
        "kind.glb": (whole[:16] + b"BIN\0" + whole[20:], "first chunk is not JSON"),
        "nan.gltf": (b'{"asset": {}, "materials": [{"a": NaN}]}', "NaN is no JSON number"),
        "long.gltf": (b'{"asset": {}, "a": 1' + b"0" * 999 + b"}", "whole number is too long"),
        "huge.gltf": (b'{"asset": {}, "a": 1e999}', "beyond the range"),
        "deep.gltf": (b"[" * 100000, "its JSON is broken"),
        "bytes.gltf": (b"\xff\xfe\xff", "its JSON is broken"),
        "list.gltf": (b"[]", "no asset"),
        "materials.gltf": (b'{"asset": {}, "materials": 3}', "materials is not a list"),
        "empty.gltf": (b"", "its JSON is broken"),
        "model.obj": (b"v 0 0 0", "suffix '.obj'"),
    }
    for name, (content, message) in cases.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(tl.InputError) as caught:
            read_materials(path)
        assert message in str(caught.value)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(tl.InputError, match="no such file"):
        read_materials(tmp_path / "missing.glb")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"meshes": 3}, "meshes is not a list"),
        ({"meshes": [{}]}, "no list of primitives"),
        ({"meshes": [{"primitives": [{}]}]}, "no attributes"),
        ({"meshes": [{"primitives": [{"attributes": {}, "material": []}]}]}, "materials \\[\\] is not one of 2"),
        ({"meshes": [{"primitives": [{"attributes": {}, "material": 0}]}]}, "accessors None is not one of 1"),
        ({"meshes": [{"primitives": [{"attributes": {}, "extensions": 3}]}]}, "KHR_materials_variants is malformed"),
        ({"accessors": [{"max": [1, 2, 3]}]}, "positions without min and max"),
        ({"extensionsUsed": 3}, "extensionsUsed is 3"),
        ({"meshes": []}, "it has no mesh"),
    ],
)
def test_a_malformed_scene_is_refused(two_boxes: Path, tmp_path: Path, change: Json, message: str) -> None:
    file = read_gltf(two_boxes)
    write_gltf(GltfFile(file.path, {**file.tree, **change}, file.chunks), tmp_path / "bad.glb")
    with pytest.raises(tl.InputError, match=message):
        write_medium(tmp_path / "bad.glb", tmp_path / "out.glb", JADE)
    assert not (tmp_path / "out.glb").exists()


# Writing


def test_a_written_medium_is_read_back(two_boxes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.glb"
    assert write_medium(two_boxes, out, JADE, distance=0.02, thickness=0.5) == [0]
    (found, unused) = read_materials(out)
    assert found.attenuation_color == (0.18, 0.62, 0.35)
    assert (found.attenuation_distance, found.thickness, found.ior) == (0.02, 0.5, 1.5)
    assert found.warnings == unused.warnings == ()
    np.testing.assert_allclose(found.medium().extinction, JADE.extinction, rtol=1e-14)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("distance", [None, 1e-9, 1.0, 1e9])
def test_every_extinction_is_read_back(two_boxes: Path, tmp_path: Path, scale: float, distance: float | None) -> None:
    medium = tl.Medium(absorption=np.array([0.0, 0.1, 3.0]) * scale, ior=1.25)
    write_medium(two_boxes, tmp_path / "out.glb", medium, distance=distance)
    found = read_materials(tmp_path / "out.glb")[0]
    assert min(found.attenuation_color) >= BLACKEST
    # A color near white, of a distance far below the mean free path, has few digits left of the extinction.
    tolerance = max(1e-14, 1e-15 / (3.0 * scale * found.attenuation_distance))
    np.testing.assert_allclose(found.medium().extinction, medium.extinction, atol=3 * scale * tolerance * 4)


def test_a_clear_medium_has_no_distance(two_boxes: Path, tmp_path: Path) -> None:
    write_medium(two_boxes, tmp_path / "out.glb", tl.Medium(ior=1.3))
    entry = read_gltf(tmp_path / "out.glb").tree["materials"][0]["extensions"]
    assert entry["KHR_materials_volume"] == {"thicknessFactor": 1.0}
    assert read_materials(tmp_path / "out.glb")[0].medium() == tl.Medium(ior=1.3)


def test_everything_else_stays(two_boxes: Path, tmp_path: Path) -> None:
    write_medium(two_boxes, tmp_path / "out.glb", JADE)
    before, after = read_gltf(two_boxes), read_gltf(tmp_path / "out.glb")
    assert after.chunks == before.chunks
    expected = copy.deepcopy(before.tree)
    material = expected["materials"][0]
    material["extensions"] = after.tree["materials"][0]["extensions"]
    material["pbrMetallicRoughness"] = {"metallicFactor": 0}
    del material["doubleSided"]
    expected["extensionsUsed"] += ["KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior"]
    assert after.tree == expected


@pytest.mark.parametrize(("name", "nodes", "materials"), [("Left", 1, [2]), ("Other", 1, [2]), ("Box", 2, [2])])
def test_only_the_named_object_is_changed(
    two_boxes: Path, tmp_path: Path, name: str, nodes: int, materials: list[int]
) -> None:
    out = tmp_path / "out.glb"
    assert write_medium(two_boxes, out, JADE, object_name=name) == materials
    before, after = read_gltf(two_boxes), read_gltf(out)
    assert after.tree["materials"][:2] == before.tree["materials"]
    assert after.tree["materials"][2]["name"] == f"Glass ({name})"
    found = materials_of(after)
    filled = [use.name for use in material_uses(after) if found[use.material].medium() is not None]
    assert len(filled) == nodes
    assert filled == (["Left", "Right"] if name == "Box" else [name])
    assert after.chunks == before.chunks


def test_a_material_of_its_own_is_not_duplicated(two_boxes: Path, tmp_path: Path) -> None:
    write_medium(two_boxes, tmp_path / "1.glb", JADE, object_name="Other")
    again = tl.Medium.from_color((0.5, 0.5, 0.5), 1.0, ior=1.2)
    assert write_medium(tmp_path / "1.glb", tmp_path / "1.glb", again, object_name="Other") == [2]
    found = read_materials(tmp_path / "1.glb")
    assert len(found) == 3
    np.testing.assert_allclose(found[2].medium().extinction, again.extinction, rtol=1e-14)
    assert read_gltf(tmp_path / "1.glb").tree["extensionsUsed"].count("KHR_materials_volume") == 1


def test_the_thickness_is_kept_given_or_that_of_the_box(two_boxes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.glb"
    for given, expected in ((None, 1.0), (0.25, 0.25), (None, 0.25)):
        write_medium(two_boxes if not out.exists() else out, out, JADE, thickness=given)
        assert read_materials(out)[0].thickness == expected


def test_the_index_of_refraction_can_stay(two_boxes: Path, tmp_path: Path) -> None:
    write_medium(two_boxes, tmp_path / "a.glb", tl.Medium(absorption=1.0, ior=1.1))
    write_medium(tmp_path / "a.glb", tmp_path / "a.glb", tl.Medium(absorption=2.0), keep_ior=True)
    medium = read_materials(tmp_path / "a.glb")[0].medium()
    assert medium.ior == 1.1
    np.testing.assert_allclose(medium.extinction, 2.0, rtol=1e-14)


def test_a_mesh_without_a_material_gets_one(two_boxes: Path, tmp_path: Path) -> None:
    file = read_gltf(two_boxes)
    tree = copy.deepcopy(file.tree)
    del tree["materials"]
    for mesh in tree["meshes"]:
        del mesh["primitives"][0]["material"]
    write_gltf(GltfFile(file.path, tree, file.chunks), tmp_path / "bare.glb")
    assert write_medium(tmp_path / "bare.glb", tmp_path / "out.glb", JADE) == [0]
    assert {use.material for use in material_uses(read_gltf(tmp_path / "out.glb"))} == {0}


def test_what_gltf_cannot_hold_is_a_warning(two_boxes: Path, tmp_path: Path) -> None:
    milk = tl.Medium(absorption=1.0, scattering=2.0)
    with pytest.warns(tl.TranslucentWarning, match="scattering is written as extinction"):
        write_medium(two_boxes, tmp_path / "out.glb", milk)
    np.testing.assert_allclose(read_materials(tmp_path / "out.glb")[0].medium().extinction, 3.0, rtol=1e-14)


def test_a_bad_request_writes_nothing(two_boxes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.glb"
    out.write_bytes(b"precious")
    unlit = read_gltf(two_boxes)
    unlit.tree["materials"][0]["extensions"] = {"KHR_materials_unlit": {}}
    write_gltf(unlit, tmp_path / "unlit.glb")
    before = sorted(tmp_path.iterdir())
    for model, options, message in (
        (two_boxes, {"object_name": "Nobody"}, "object 'Nobody'.*use one of Left, Other, Right"),
        (two_boxes, {"thickness": 0.0}, "thickness 0.0; not above 0"),
        (two_boxes, {"thickness": math.inf}, "not above 0 and finite"),
        (two_boxes, {"distance": -1.0}, "distance -1.0; not above 0"),
        (tmp_path / "unlit.glb", {}, "KHR_materials_unlit excludes a volume"),
        (tmp_path / "missing.glb", {}, "no such file"),
    ):
        with pytest.raises(tl.InputError, match=message):
            write_medium(model, out, JADE, **options)
    assert out.read_bytes() == b"precious"
    assert sorted(tmp_path.iterdir()) == before
    for name, message in (("out.obj", "suffix '.obj'"), ("none/out.glb", "no folder")):
        with pytest.raises(tl.InputError, match=message):
            write_medium(two_boxes, tmp_path / name, JADE)


def test_a_failure_while_writing_leaves_the_old_file(
    two_boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out.glb"
    out.write_bytes(b"precious")

    def full(path: Path, content: bytes) -> int:
        with path.open("wb") as half:
            half.write(content[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(tl.RenderError, match="No space left"):
        write_medium(two_boxes, out, JADE)
    assert out.read_bytes() == b"precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["boxes.glb", "out.glb"]


# The Khronos validator


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", [None, "Left"])
def test_the_validator_accepts_what_is_written(
    validate: Any, two_boxes: Path, tmp_path: Path, suffix: str, name: str | None
) -> None:
    out = tmp_path / f"out{suffix}"
    write_medium(two_boxes, out, JADE, object_name=name)
    before, after = validate(two_boxes), validate(out)
    # The fixture's unknown chunk, which only a .glb can hold, is a warning before and after.
    assert before["numErrors"] == after["numErrors"] == 0, after
    assert after["numWarnings"] == (before["numWarnings"] if suffix == ".glb" else 0), after


def test_the_validator_accepts_a_glb_made_of_pieces(validate: Any, in_pieces: Path, tmp_path: Path) -> None:
    write_gltf(read_gltf(in_pieces), tmp_path / "out.glb")
    before, after = validate(in_pieces), validate(tmp_path / "out.glb")
    assert (before["numErrors"], before["numWarnings"]) == (0, 0), before
    assert (after["numErrors"], after["numWarnings"]) == (0, 0), after


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", ["R4_Block_2.0", "R3_Block_Row", None])
def test_the_validator_accepts_a_third_party_file_that_is_changed(
    validate: Any, assets: Path, tmp_path: Path, suffix: str, name: str | None
) -> None:
    source, out = assets / "gltf" / "AttenuationTest.glb", tmp_path / f"out{suffix}"
    before = validate(source)
    assert (before["numErrors"], before["numWarnings"]) == (0, 0)
    changed = write_medium(source, out, JADE, object_name=name, thickness=1.0)
    after = validate(out)
    assert (after["numErrors"], after["numWarnings"]) == (0, 0), after
    found = read_materials(out)
    for index in changed:
        np.testing.assert_allclose(found[index].medium().extinction, JADE.extinction, rtol=1e-13)
    if name is not None:
        # The blocks that share the material of R4_Block_2.0 keep it.
        assert found[:18] == read_materials(source)[:18] if name.startswith("R4") else changed == [6]
