"""Media written into glTF files: they are read back, all else stays, and the Khronos validator accepts the file."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.gltf.gltf_json import JADE, uses
from translucent.gltf.file import GltfFile, read_gltf, write_gltf
from translucent.gltf.materials import materials_of, read_materials
from translucent.gltf.write import write_medium
from translucent.media.medium import BLACKEST

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


def test_without_a_name_only_what_light_enters_is_filled(two_boxes: Path, tmp_path: Path) -> None:
    file = read_gltf(two_boxes)
    file.tree["meshes"][1]["primitives"][0]["material"] = 1
    write_gltf(file, tmp_path / "opaque.glb")
    assert write_medium(tmp_path / "opaque.glb", tmp_path / "all.glb", JADE) == [0, 1]
    file.tree["materials"][0]["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": 0.8}}
    write_gltf(file, tmp_path / "glass.glb")
    assert write_medium(tmp_path / "glass.glb", tmp_path / "out.glb", JADE) == [0]
    assert read_gltf(tmp_path / "out.glb").tree["materials"][1] == file.tree["materials"][1]
    # A name is asked for as it is.
    assert write_medium(tmp_path / "glass.glb", tmp_path / "named.glb", JADE, object_name="Other") == [1]


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
    filled = [name for name, index, _ in uses(after) if found[index].medium() is not None]
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
    assert {index for _, index, _ in uses(read_gltf(tmp_path / "out.glb"))} == {0}


def test_what_gltf_cannot_hold_is_a_warning(two_boxes: Path, tmp_path: Path) -> None:
    milk = tl.Medium(absorption=1.0, scattering=2.0)
    with pytest.warns(tl.TranslucentWarning, match="scattering is written as absorption"):
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
        (two_boxes, {"thickness": 0.0}, "thickness 0.0; the thickness must be finite and above 0"),
        (two_boxes, {"thickness": math.inf}, "the thickness must be finite and above 0"),
        (two_boxes, {"distance": -1.0}, "distance -1.0; the distance must be above 0"),
        (tmp_path / "unlit.glb", {}, "the extension KHR_materials_unlit of the material excludes a volume"),
        (tmp_path / "missing.glb", {}, "no file has this path"),
    ):
        with pytest.raises(tl.InputError, match=message):
            write_medium(model, out, JADE, **options)
    assert out.read_bytes() == b"precious"
    assert sorted(tmp_path.iterdir()) == before
    for name, message in (("out.obj", "suffix '.obj'"), ("none/out.glb", "does not exist")):
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
