"""glTF files as containers: what was there stays, pieces become one, and broken ones are refused."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from tests.gltf.gltf_json import JADE, Json, gltf
from translucent.gltf.file import GltfFile, read_gltf, write_gltf
from translucent.gltf.materials import read_materials
from translucent.gltf.write import write_medium


def saved(path: Path, tree: Json) -> Path:
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


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
    with pytest.raises(tl.InputError, match="leads outside the folder of the model"):
        moved.resource(moved.tree["buffers"][0])
    trusted = read_gltf(tmp_path / "out" / "m.gltf", allow_outside=True)
    assert trusted.resource(trusted.tree["buffers"][0]) == b"1234"


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
    # Of each buffer as many bytes as it says, in steps of 4: 6, 40, 28; then the images.
    assert new[3]["byteOffset"] == 8 + 40 + 28
    assert buffer["byteLength"] == new[4]["byteOffset"] + new[4]["byteLength"]
    inside, beside = after.items("images")
    assert (inside["name"], inside["mimeType"], inside["bufferView"]) == ("inside", "image/png", 3)
    assert beside == {"mimeType": "image/png", "bufferView": 4}
    for index, image in enumerate((inside, beside)):
        assert after.resource(image) == before.resource(before.items("images")[index])
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
        ({"buffers": [{"uri": uri(b"123"), "byteLength": 9}]}, "buffer 0 has 3 bytes, but should have 9"),
        ({"buffers": [{"uri": uri(b"123")}]}, "buffer 0 has 3 bytes, but should have None"),
        ({"buffers": [{"uri": "none.bin", "byteLength": 9}]}, "'none.bin' cannot be read"),
        (
            {"buffers": [{"uri": uri(b"123"), "byteLength": 3}], "bufferViews": [{"buffer": 1}]},
            "view refers to buffer 1",
        ),
        (
            {"buffers": [{"uri": uri(b"123"), "byteLength": 3}], "bufferViews": [{"buffer": []}]},
            "view refers to buffer",
        ),
        ({"images": [{"uri": "data:image/png;base64,!"}]}, "cannot be read"),
    ],
)
def test_pieces_that_are_broken_are_refused(tmp_path: Path, change: Json, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        write_gltf(GltfFile(tmp_path / "a.gltf", gltf({}, **change)), tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_a_glb_holds_its_images_wherever_they_were(two_boxes: Path, tmp_path: Path) -> None:
    """Images of a .glb with links, too, whose other chunks stay behind; the same bytes without their folder."""
    for folder in ("deep/model", "textures"):
        (tmp_path / folder).mkdir(parents=True)
    Image.new("RGB", (2, 1), (9, 8, 7)).save(tmp_path / "textures" / "a b.jpg")
    linked = read_gltf(two_boxes)
    linked.tree["images"] = [{"uri": "../../textures/a%20b.jpg", "name": "kept"}]
    linked = GltfFile(tmp_path / "deep" / "model" / "boxes.glb", linked.tree, linked.chunks, allow_outside=True)
    write_gltf(linked, tmp_path / "out.glb")
    file = read_gltf(tmp_path / "out.glb")
    (image,) = file.items("images")
    assert (image["name"], image["mimeType"], "uri" in image) == ("kept", "image/jpeg", False)
    assert file.resource(image) == (tmp_path / "textures" / "a b.jpg").read_bytes()
    assert file.chunks.endswith(b"more")
    assert file.resource({"bufferView": 0}) == read_gltf(two_boxes).resource({"bufferView": 0})
    write_gltf(linked, tmp_path / "out.gltf")
    assert read_gltf(tmp_path / "out.gltf").tree["images"][0]["uri"] == "textures/a%20b.jpg"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("gone.png", None, "'gone.png' cannot be read.*; the image stays a link"),
        (
            "secret.txt",
            b"root:x:0",
            "glTF does not support the format of 'secret.txt'; it stays a link",
        ),
    ],
)
def test_what_is_no_picture_is_not_copied(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    tree = gltf({}, images=[{"uri": name}, {"uri": "https://example.org/a.png"}])
    with pytest.warns(tl.TranslucentWarning, match=message):
        write_gltf(GltfFile(tmp_path / "a.gltf", tree), tmp_path / "a.glb")
    assert read_gltf(tmp_path / "a.glb").tree == tree


def test_an_image_without_a_kind_stays_as_it_is(tmp_path: Path) -> None:
    tree = gltf({}, images=[{"uri": "data:;base64,AAAA"}])
    write_gltf(GltfFile(tmp_path / "a.gltf", tree), tmp_path / "a.glb")
    assert read_gltf(tmp_path / "a.glb").tree == tree


def test_broken_files_are_refused_in_one_line(two_boxes: Path, tmp_path: Path) -> None:
    whole = two_boxes.read_bytes()
    cases = {
        "cut.glb": (whole[:-10], "the file is cut off after"),
        "head.glb": (whole[:14], "the file is cut off after"),
        "json.glb": (whole.replace(b'"asset":', b'"asset";', 1), "the JSON of the file is broken ("),
        "old.glb": (whole[:4] + b"\1\0\0\0" + whole[8:], "GLB version 1"),
        "kind.glb": (whole[:16] + b"BIN\0" + whole[20:], "first chunk of the file is not JSON"),
        "nan.gltf": (b'{"asset": {}, "materials": [{"a": NaN}]}', "NaN is not a JSON number"),
        "long.gltf": (b'{"asset": {}, "a": 1' + b"0" * 999 + b"}", "whole number is too long"),
        "huge.gltf": (b'{"asset": {}, "a": 1e999}', "beyond the range"),
        "deep.gltf": (b"[" * 100000, "the JSON of the file is broken ("),
        "bytes.gltf": (b"\xff\xfe\xff", "the JSON of the file is broken ("),
        "list.gltf": (b"[]", "has no 'asset'"),
        "materials.gltf": (b'{"asset": {}, "materials": 3}', "materials is not a list"),
        "empty.gltf": (b"", "the file is empty"),
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
    with pytest.raises(tl.InputError, match="no file has this path"):
        read_materials(tmp_path / "missing.glb")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"meshes": 3}, "meshes is not a list"),
        ({"meshes": [{}]}, "no list of primitives"),
        ({"meshes": [{"primitives": [{}]}]}, "no attributes"),
        (
            {"meshes": [{"primitives": [{"attributes": {}, "material": []}]}]},
            "materials \\[\\] does not exist: the file has 2",
        ),
        (
            {"meshes": [{"primitives": [{"attributes": {}, "material": 0}]}]},
            "accessors None does not exist: the file has 1",
        ),
        ({"meshes": [{"primitives": [{"attributes": {}, "extensions": 3}]}]}, "KHR_materials_variants is malformed"),
        ({"accessors": [{"max": [1, 2, 3]}]}, "the positions have no min and max"),
        ({"extensionsUsed": 3}, "extensionsUsed is 3"),
        ({"meshes": []}, "the file has no mesh"),
    ],
)
def test_a_malformed_scene_is_refused(two_boxes: Path, tmp_path: Path, change: Json, message: str) -> None:
    file = read_gltf(two_boxes)
    write_gltf(GltfFile(file.path, {**file.tree, **change}, file.chunks), tmp_path / "bad.glb")
    with pytest.raises(tl.InputError, match=message):
        write_medium(tmp_path / "bad.glb", tmp_path / "out.glb", JADE)
    assert not (tmp_path / "out.glb").exists()


def test_the_validator_accepts_a_glb_made_of_pieces(validate: Any, in_pieces: Path, tmp_path: Path) -> None:
    write_gltf(read_gltf(in_pieces), tmp_path / "out.glb")
    before, after = validate(in_pieces), validate(tmp_path / "out.glb")
    assert (before["numErrors"], before["numWarnings"]) == (0, 0), before
    assert (after["numErrors"], after["numWarnings"]) == (0, 0), after
