"""Maps in glTF files: read back as a viewer would, valid for the Khronos validator, and nothing else touched."""

from __future__ import annotations

import copy
import dataclasses
import io
import json
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from translucent.bake.gltf_builder import INDICES, GlbBuilder
from translucent.bake.gltf_targets import find_targets
from translucent.bake.thickness_map import save_map, save_vertices, write_maps
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile, read_gltf, write_gltf
from translucent.gltf.materials import read_materials
from translucent.gltf.nodes import thickness_at, thickness_map

MapMaker = Callable[..., Any]
Json = dict[str, Any]
GLASS = {"KHR_materials_transmission": {"transmissionFactor": 1}}


def png(color: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(color).save(stream, format="PNG")
    return stream.getvalue()


def write_scene(make_ball: MapMaker, path: Path, count: int = 2, **material: Any) -> GltfFile:
    """A .glb of balls with UVs that share one material, with what else a file may have; an unknown chunk at its end."""
    balls = trimesh.Scene()
    for i in range(count):
        shift = trimesh.transformations.translation_matrix((3 * i, 0, 0))
        balls.add_geometry(make_ball(1), f"Ball {i}", f"Ball {i}", transform=shift)
    path.write_bytes(balls.export(file_type="glb"))
    builder = GlbBuilder(read_gltf(path))
    tree = builder.tree
    for key in ("materials", "textures", "images", "samplers"):
        tree.pop(key, None)
    image = builder.add(
        "images", {"bufferView": builder.add_view(png(np.full((4, 4, 3), 99, np.uint8))), "mimeType": "image/png"}
    )
    builder.add("textures", {"source": image})
    tree["materials"] = [{"name": "Glass", "extras": {"kept": [1]}, **material}]
    for mesh in tree["meshes"]:
        mesh["primitives"][0]["material"] = 0
    tree["extensionsUsed"] = sorted({name for one in tree["materials"] for name in one.get("extensions", {})}) or [
        "KHR_xmp"
    ]
    tree["extras"] = {"owner": "me"}
    file = builder.file()
    file = GltfFile(file.path, file.tree, file.chunks + struct.pack("<II4s", 4, 0x12345678, b"more"))
    write_gltf(file, path)
    return read_gltf(path)


@pytest.fixture
def scene(make_ball: MapMaker) -> MapMaker:
    return partial(write_scene, make_ball)


def vertices_of(file: GltfFile, mesh: int = 0) -> dict[str, np.ndarray]:
    accessors = Accessors(file)
    primitive = file.items("meshes")[mesh]["primitives"][0]
    found = {}
    for name, index in primitive["attributes"].items():
        found[name] = accessors.vectors(index, file.item("accessors", index)["type"])
    found["indices"] = accessors.indices(primitive["indices"])
    return found


def test_a_map_is_read_back_as_a_viewer_reads_it(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "t.glb"
    told = save_map(make_map(ramp), path)
    (material,) = read_materials(path)
    assert material.kind == "volume"
    assert material.thickness == pytest.approx(float(ramp.max()), rel=1e-12)
    assert not material.warnings
    file = read_gltf(path)
    found = thickness_map(file, material)
    quantum = float(ramp.max()) / 255
    assert np.abs(found - ramp).max() <= 0.5 * quantum * (1 + 1e-9)
    assert told["maps"][0]["encoding"]["quantum"] == pytest.approx(quantum)
    # The middle of the texel in row 2 and column 5; glTF's v points down, the mesh's up.
    uv = np.array([[5.5 / 8, 2.5 / 8]])
    np.testing.assert_allclose(thickness_at(file, material, uv), found[2, 5], rtol=1e-12)
    np.testing.assert_allclose(vertices_of(file)["TEXCOORD_0"][:, 1].max(), 1.0)
    image = Image.open(io.BytesIO(file.resource(file.items("images")[0])))
    red, _, blue = image.split()
    assert image.mode == "RGB"
    assert red.getextrema() == blue.getextrema() == (0, 0)


def test_the_mesh_of_a_new_file_is_the_mesh(
    make_ball: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    ball = make_ball(2, 0.3)
    mesh = tl.Mesh(ball.vertices, ball.faces, uv=ball.visual.uv, name="ball")
    save_map(make_map(ramp, mesh), tmp_path / "t.glb")
    again = tl.load_mesh(tmp_path / "t.glb")
    assert again.diagnosis.solid
    assert again.volume == pytest.approx(ball.volume, rel=1e-5)
    found = vertices_of(read_gltf(tmp_path / "t.glb"))
    # Smooth across the seams of the UVs: on a sphere, normals are positions.
    normals = found["POSITION"] / np.linalg.norm(found["POSITION"], axis=1, keepdims=True)
    assert np.abs(found["NORMAL"] - normals).max() < 0.02


@pytest.mark.parametrize(("shift", "wrap"), [(0.0, 33071), (0.5, 10497)], ids=["clamped", "repeated"])
def test_a_map_repeats_where_the_uvs_go_beyond_it(
    make_map: MapMaker, ramp: np.ndarray, tmp_path: Path, shift: float, wrap: int
) -> None:
    mesh = make_map(ramp).mesh
    mesh = dataclasses.replace(mesh, uv=mesh.uv + (shift, 0.0))
    make_map(ramp, mesh).save(tmp_path / "map.glb")
    (sampler,) = read_gltf(tmp_path / "map.glb").tree["samplers"]
    assert (sampler["wrapS"], sampler["wrapT"]) == (wrap, wrap)


def test_edges_stay_edges(make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    mesh = tl.Mesh(box.vertices, box.faces, uv=np.zeros((8, 2)))
    save_map(make_map(ramp, mesh), tmp_path / "t.glb")
    found = vertices_of(read_gltf(tmp_path / "t.glb"))
    assert len(found["POSITION"]) == 24
    assert set(np.abs(found["NORMAL"]).sum(axis=1)) == {1.0}


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_everything_else_in_the_file_stays(
    scene: MapMaker, suffix: str, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    clear = {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}, **GLASS}
    before = scene(tmp_path / "in.glb", 2, extensions=clear, pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    source = tmp_path / f"in{suffix}"
    if suffix == ".gltf":
        write_gltf(before, source)
    write_maps(GlbBuilder(read_gltf(source)), tmp_path / "out.glb", {(1, 0): make_map(ramp)})
    after = read_gltf(tmp_path / "out.glb")
    for key in ("asset", "scene", "scenes", "nodes", "extras", "accessors"):
        assert after.tree[key] == before.tree[key], key
    assert after.tree["meshes"][0] == before.tree["meshes"][0]
    assert after.tree["materials"][0] == before.tree["materials"][0]
    assert after.tree["images"][:1] == before.tree["images"]
    assert after.tree["textures"][:1] == before.tree["textures"]
    assert after.chunks.endswith(b"more") or suffix == ".gltf"
    for mesh in (0, 1):
        for name, array in vertices_of(before, mesh).items():
            np.testing.assert_array_equal(vertices_of(after, mesh)[name], array)
    made = after.tree["materials"][1]
    assert made["name"] == "Glass (Ball 1)"
    assert made["extras"] == {"kept": [1]}
    assert made["extensions"]["KHR_materials_clearcoat"] == {"clearcoatFactor": 0.5}
    assert made["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}
    assert after.tree["extensionsUsed"] == [
        "KHR_materials_clearcoat",
        "KHR_materials_transmission",
        "KHR_materials_volume",
    ]


def test_meshes_that_share_a_material_get_their_own(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    before = scene(tmp_path / "in.glb", 3, extensions=GLASS)
    maps = {(i, 0): make_map(ramp * (i + 1)) for i in range(3)}
    write_maps(GlbBuilder(before), tmp_path / "out.glb", maps)
    after = read_gltf(tmp_path / "out.glb")
    materials = read_materials(tmp_path / "out.glb")
    used = [mesh["primitives"][0]["material"] for mesh in after.tree["meshes"]]
    # The last of them keeps the old one, so none is left without a user.
    assert sorted(used) == [0, 1, 2]
    for i, index in enumerate(used):
        assert materials[index].thickness == pytest.approx((i + 1) * float(ramp.max()), rel=1e-12)


def test_variants_keep_their_materials(scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    before = scene(tmp_path / "in.glb", 1, extensions=GLASS)
    primitive = before.tree["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": [{"material": 0, "variants": [0]}]}}
    write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(ramp)})
    after = read_gltf(tmp_path / "out.glb")
    assert after.tree["materials"][0] == before.tree["materials"][0]
    assert after.tree["meshes"][0]["primitives"][0]["material"] == 1
    primitive["extensions"]["KHR_materials_variants"]["mappings"] = [{"variants": [0]}]
    with pytest.raises(tl.InputError, match="KHR_materials_variants is malformed"):
        write_maps(GlbBuilder(before), tmp_path / "bad.glb", {(0, 0): make_map(ramp)})


def test_an_opaque_material_lets_light_in_then(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    before = scene(tmp_path / "in.glb", 1, doubleSided=True, pbrMetallicRoughness={"roughnessFactor": 0.3})
    wine = tl.Medium.from_color("#7b1e3a", 0.01)
    write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(ramp)}, medium=wine)
    (found,) = read_materials(tmp_path / "out.glb")
    assert (found.kind, found.transmission, found.warnings) == ("volume", 1.0, ())
    np.testing.assert_allclose(found.medium().extinction, wine.extinction, rtol=1e-12)
    made = read_gltf(tmp_path / "out.glb").tree["materials"][0]
    assert made["pbrMetallicRoughness"] == {"roughnessFactor": 0.3, "metallicFactor": 0}
    assert "doubleSided" not in made


def test_a_volume_keeps_its_color_and_a_share_of_light_its_size(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    volume = {"attenuationColor": [0.1, 0.5, 0.9], "attenuationDistance": 2, "thicknessFactor": 5, "extras": {"a": 1}}
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 0.5}, "KHR_materials_volume": volume}
    before = scene(tmp_path / "in.glb", 1, extensions=extensions)
    write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(ramp)}, medium=tl.Medium(absorption=1))
    after = read_gltf(tmp_path / "out.glb").tree["materials"][0]["extensions"]
    texture = {"thicknessTexture": {"index": 1}, "thicknessFactor": pytest.approx(float(ramp.max()))}
    assert after == {**extensions, "KHR_materials_volume": {**volume, **texture}}


def test_the_unit_of_the_file_counts(scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path) -> None:
    before = scene(tmp_path / "in.glb", 1, extensions=GLASS)
    write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(ramp)}, metres=0.01)
    (found,) = read_materials(tmp_path / "out.glb")
    assert found.thickness == pytest.approx(100 * float(ramp.max()), rel=1e-12)


def test_a_material_that_excludes_a_volume_is_refused(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    before = scene(tmp_path / "in.glb", 1, extensions={"KHR_materials_unlit": {}})
    with pytest.raises(
        tl.InputError, match="material 0 'Glass'; the extension KHR_materials_unlit of the material excludes a volume"
    ):
        write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(ramp)})
    assert [p.name for p in tmp_path.iterdir()] == ["in.glb"]


def test_objects_without_thickness_are_left_as_they_are(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    before = scene(tmp_path / "in.glb", 2, extensions=GLASS)
    told = write_maps(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): make_map(0 * ramp), (1, 0): make_map(ramp)})
    assert [one.get("warnings", []) for one in told["maps"]] == [
        ["the thickness is 0, so the material stays unchanged"],
        [],
    ]
    assert read_gltf(tmp_path / "out.glb").tree["meshes"][0] == before.tree["meshes"][0]


# Which UVs


def test_those_that_let_light_in_are_chosen(scene: MapMaker, tmp_path: Path) -> None:
    before = scene(tmp_path / "in.glb", 3, extensions=GLASS)
    before.tree["materials"].append({"name": "Opaque"})
    before.tree["meshes"][1]["primitives"][0]["material"] = 1
    assert [target.key for target in find_targets(GlbBuilder(before))] == [(0, 0), (2, 0)]
    del before.tree["materials"][0]["extensions"]
    assert [target.key for target in find_targets(GlbBuilder(before))] == [(0, 0), (1, 0), (2, 0)]
    del before.tree["nodes"][:]
    before.tree["scenes"] = [{"nodes": []}]
    with pytest.raises(tl.InputError, match="no node has triangles"):
        find_targets(GlbBuilder(before))


def test_a_mesh_is_in_its_own_space_and_in_metres(scene: MapMaker, tmp_path: Path) -> None:
    before = scene(tmp_path / "in.glb", 1, extensions=GLASS)
    before.tree["nodes"][-1]["scale"] = [5, 5, 5]
    (target,) = find_targets(GlbBuilder(before), metres=0.01)
    np.testing.assert_allclose(np.linalg.norm(target.mesh.vertices, axis=1), 0.01, rtol=1e-6)
    assert target.mesh.diagnosis.solid


def test_thin_walls_without_an_inside_are_left_alone(scene: MapMaker, tmp_path: Path) -> None:
    before = scene(tmp_path / "in.glb", 2, extensions=GLASS)
    builder = GlbBuilder(before)
    primitive = builder.primitive(0, 0)
    corners = Accessors(before).indices(primitive["indices"])[3:]  # one face is missing
    primitive["indices"] = builder.add_accessor(corners.astype(np.uint32), INDICES)
    assert [target.key for target in find_targets(builder)] == [(1, 0)]
    builder.primitive(1, 0)["indices"] = primitive["indices"]
    with pytest.raises(tl.InputError, match="only thin walls let light in, and they have no inside: Ball 0, Ball 1"):
        find_targets(builder)
    # With a volume it is meant to be solid; the bake tells how many rays escape.
    builder.tree["materials"][0]["extensions"]["KHR_materials_volume"] = {"thicknessFactor": 1}
    assert len(find_targets(builder)) == 2


@pytest.mark.parametrize("scale", [(0.5, 0.25), (3.0, 3.0)])
def test_a_texture_transform_stays_where_it_is_of_use(
    scene: MapMaker, scale: tuple[float, float], make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    transform = {"KHR_texture_transform": {"offset": [0.25, 0.125], "scale": list(scale), "rotation": 0.0}}
    volume = {"thicknessFactor": 1, "thicknessTexture": {"index": 0, "extensions": transform}}
    before = scene(tmp_path / "in.glb", 1, extensions={**GLASS, "KHR_materials_volume": volume})
    builder = GlbBuilder(before)
    (target,) = find_targets(builder)
    plain = 1.0 - vertices_of(before)["TEXCOORD_0"][:, 1].max()
    kept = scale[0] < 1
    assert target.keeps_transform == kept
    expected = 1.0 - (0.125 + scale[1] * vertices_of(before)["TEXCOORD_0"][:, 1].max()) if kept else plain
    np.testing.assert_allclose(target.mesh.uv[:, 1].min(), expected, atol=1e-6)
    write_maps(builder, tmp_path / "out.glb", {(0, 0): make_map(ramp, target.mesh)}, targets={(0, 0): target})
    info = read_gltf(tmp_path / "out.glb").tree["materials"][0]["extensions"]["KHR_materials_volume"][
        "thicknessTexture"
    ]
    assert info == ({"index": 1, "extensions": transform} if kept else {"index": 1})
    # Whoever reads the texture as the file says, finds at a vertex what was baked there.
    file, (material,) = read_gltf(tmp_path / "out.glb"), read_materials(tmp_path / "out.glb")
    uv = vertices_of(file)["TEXCOORD_0"]
    row = np.clip(np.floor((1 - target.mesh.uv[:, 1]) * 8), 0, 7).astype(int)
    assert len(row) == len(uv)
    found = thickness_at(file, material, uv)
    assert (found <= ramp.max() + 1e-6).all()


def test_the_second_set_of_uvs_is_used_where_the_material_does(
    scene: MapMaker, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    volume = {"thicknessFactor": 1, "thicknessTexture": {"index": 0, "texCoord": 1}}
    before = scene(tmp_path / "in.glb", 1, extensions={**GLASS, "KHR_materials_volume": volume})
    attributes = before.tree["meshes"][0]["primitives"][0]["attributes"]
    builder = GlbBuilder(before)
    half = (vertices_of(before)["TEXCOORD_0"] / 2).astype(np.float32)
    builder.primitive(0, 0)["attributes"]["TEXCOORD_1"] = builder.add_accessor(half)
    (target,) = find_targets(builder)
    assert target.tex_coord == 1
    assert target.mesh.uv[:, 1].min() >= 0.5  # v upwards
    write_maps(builder, tmp_path / "out.glb", {(0, 0): make_map(ramp, target.mesh)}, targets={(0, 0): target})
    info = read_gltf(tmp_path / "out.glb").tree["materials"][0]["extensions"]["KHR_materials_volume"][
        "thicknessTexture"
    ]
    assert info == {"texCoord": 1, "index": 1}
    assert "TEXCOORD_1" not in attributes  # the file that was read is not changed


def test_new_uvs_take_all_vertex_data_along(scene: MapMaker, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    before = scene(tmp_path / "in.glb", 1, extensions=GLASS)
    builder = GlbBuilder(before)
    primitive = builder.primitive(0, 0)
    positions = vertices_of(before)["POSITION"]
    colors = (np.abs(positions) * 255).astype(np.uint8)
    primitive["attributes"]["COLOR_0"] = builder.add_accessor(colors, normalized=True)
    primitive["targets"] = [{"POSITION": builder.add_accessor((2 * positions).astype(np.float32), bounds=True)}]
    (target,) = find_targets(builder, new_uv=True)
    assert target.tex_coord == 1  # the old set stays for the other textures
    write_gltf(builder.file(), tmp_path / "out.glb")
    after = read_gltf(tmp_path / "out.glb")
    found = vertices_of(after)
    triangles, old = found["POSITION"][found["indices"]], vertices_of(before)
    np.testing.assert_array_equal(triangles, old["POSITION"][old["indices"]])
    np.testing.assert_array_equal(found["TEXCOORD_0"][found["indices"]], old["TEXCOORD_0"][old["indices"]])
    np.testing.assert_array_equal(np.rint(found["COLOR_0"] * 255), (np.abs(found["POSITION"]) * 255).astype(np.uint8))
    moved = after.items("meshes")[0]["primitives"][0]["targets"][0]["POSITION"]
    np.testing.assert_array_equal(Accessors(after).vectors(moved, "VEC3"), 2 * found["POSITION"])
    assert target.mesh.uv.min() >= 0
    assert target.mesh.uv.max() <= 1


@pytest.mark.parametrize("change", ["compressed", "strip"])
def test_what_cannot_be_unwrapped_is_refused(scene: MapMaker, change: str, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    before = scene(tmp_path / "in.glb", 1, extensions={**GLASS, "KHR_materials_volume": {"thicknessFactor": 1}})
    if change == "strip":
        before.tree["meshes"][0]["primitives"][0]["mode"] = 5
    else:
        before.tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    with pytest.raises(tl.InputError, match=r"strip or fan|requires KHR_draco"):
        find_targets(GlbBuilder(before), new_uv=True)


# Vertices


@pytest.mark.parametrize("metres", [1.0, 0.01])
def test_vertices_get_an_attribute(scene: MapMaker, metres: float, make_vertices: MapMaker, tmp_path: Path) -> None:
    from translucent.bake.thickness_map import write_vertices

    before = scene(tmp_path / "in.glb", 1, extensions=GLASS)
    (target,) = find_targets(GlbBuilder(before), metres, needs_uv=False)
    assert target.mesh.uv is None
    assert len(target.mesh.vertices) == 42  # welded; the file has three vertices per face
    result = make_vertices(target.mesh.vertices[:, 0] + 2 * metres, target.mesh)
    write_vertices(GlbBuilder(before), tmp_path / "out.glb", {(0, 0): result}, metres=metres)
    found = vertices_of(read_gltf(tmp_path / "out.glb"))
    np.testing.assert_allclose(found["_THICKNESS"][:, 0], found["POSITION"][:, 0] + 2, atol=1e-6)


def test_a_mesh_with_thickness_per_vertex_becomes_a_file(make_vertices: MapMaker, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    save_vertices(make_vertices(np.arange(8), tl.Mesh(box.vertices, box.faces)), tmp_path / "t.glb")
    found = vertices_of(read_gltf(tmp_path / "t.glb"))
    at = {tuple(corner): i for i, corner in enumerate(box.vertices)}
    assert [at[tuple(p)] for p in found["POSITION"]] == found["_THICKNESS"][:, 0].astype(int).tolist()


# The Khronos validator


def clean(issues: Json) -> None:
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), json.dumps(issues, indent=1)


def test_the_validator_accepts_new_files(
    make_ball: MapMaker, validate: Any, make_map: MapMaker, make_vertices: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    ball = make_ball(1)
    mesh = tl.Mesh(ball.vertices, ball.faces, uv=ball.visual.uv, name="ball")
    save_map(make_map(ramp, mesh), tmp_path / "map.glb")
    clean(validate(tmp_path / "map.glb"))
    save_vertices(make_vertices(np.ones(len(mesh.vertices)), mesh), tmp_path / "vertices.glb")
    clean(validate(tmp_path / "vertices.glb"))


@pytest.mark.parametrize("unwrap", [False, True])
def test_the_validator_accepts_changed_files(
    scene: MapMaker, validate: Any, unwrap: bool, make_map: MapMaker, ramp: np.ndarray, tmp_path: Path
) -> None:
    if unwrap:
        pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    before = scene(tmp_path / "in.glb", 3, doubleSided=True, pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    before = GltfFile(before.path, copy.deepcopy(before.tree), before.chunks[:-12])  # the unknown chunk is a warning
    builder = GlbBuilder(before)
    colors = np.full((len(vertices_of(before)["POSITION"]), 3), 7, np.uint8)
    builder.primitive(0, 0)["attributes"]["COLOR_0"] = builder.add_accessor(colors, normalized=True)
    targets = find_targets(builder, new_uv=unwrap)
    builder.tree["extensionsUsed"].remove("KHR_xmp")
    maps = {target.key: make_map(ramp, target.mesh) for target in targets}
    write_maps(builder, tmp_path / "out.glb", maps, targets={target.key: target for target in targets})
    clean(validate(tmp_path / "out.glb"))
    assert {material.kind for material in read_materials(tmp_path / "out.glb")} == {"volume"}
