"""The verb `material`, in-process: what a file states, a medium written into it, and one line for each mistake."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Run, one_error_line, strict_json
from translucent.gltf.file import GltfFile, read_gltf, write_gltf
from translucent.gltf.materials import read_materials

WINE = ("--color", "linear(0.2,0.02,0.05)", "--distance", "1cm")


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """Two boxes: wine with a volume, and a table without a material."""
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), node_name="Wine", geom_name="Wine")
    scene.add_geometry(trimesh.creation.box((9, 9, 1)), node_name="Table", geom_name="Table")
    path = tmp_path / "model.glb"
    path.write_bytes(scene.export(file_type="glb"))
    file = read_gltf(path)
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_volume": {
            "thicknessFactor": 1,
            "attenuationColor": [0, 0.5, 1],
            "attenuationDistance": 2,
        },
    }
    tree = {**file.tree, "materials": [{"name": "Glass", "extensions": extensions}], "extensionsUsed": [*extensions]}
    for mesh in tree["meshes"]:
        mesh["primitives"][0].pop("material", None)
        if mesh["name"] == "Wine":
            mesh["primitives"][0]["material"] = 0
    write_gltf(GltfFile(path, tree, file.chunks), path)
    return path


def test_show_tells_the_values_the_medium_and_the_warnings(run: Run, model: Path) -> None:
    code, out, err = run("material", "show", model)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == f"{model}: 1 material"
    assert lines[1] == "0 'Glass': volume, transmission 1, ior 1.33"
    assert lines[2].split() == ["thickness", "1", "(mesh", "space)"]
    assert lines[3].split() == ["color", "0", "0.5", "1", "linear,", "at", "2", "m"]
    assert lines[4].split() == ["extinction", "5.7565", "0.34657", "0", "1/m"]
    assert lines[5].startswith("  warning: attenuationColor red is 0")


def test_show_as_json(run: Run, model: Path) -> None:
    code, out, err = run("material", "show", model, "--json")
    assert (code, err) == (0, "")
    (entry,) = strict_json(out)["materials"]
    assert (entry["index"], entry["name"], entry["ior"]) == (0, "Glass", 1.33)
    assert entry["extinction"][1:] == pytest.approx([np.log(2) / 2, 0.0])
    assert len(entry["warnings"]) == 1


def test_show_tells_where_a_thickness_texture_is_read(run: Run, model: Path) -> None:
    file = read_gltf(model)
    tree = {**file.tree, "textures": [{}, {}]}
    texture = {"index": 1, "texCoord": 1}
    tree["materials"][0]["extensions"]["KHR_materials_volume"]["thicknessTexture"] = texture
    write_gltf(GltfFile(model, tree, file.chunks), model)
    assert "thickness            1 times texture 1 at TEXCOORD_1 (mesh space)" in run("material", "show", model)[1]
    texture["extensions"] = {"KHR_texture_transform": {"rotation": 0.5, "texCoord": 0}}
    write_gltf(GltfFile(model, tree, file.chunks), model)
    assert "times texture 1 at TEXCOORD_0, transformed (mesh space)" in run("material", "show", model)[1]
    (entry,) = strict_json(run("material", "show", model, "--json")[1])["materials"]
    assert entry["thickness_transform"] == {"offset": [0, 0], "rotation": 0.5, "scale": [1, 1], "tex_coord": 0}


def test_an_infinite_distance_is_null(run: Run, model: Path) -> None:
    run("material", "apply", model, "--color", "white", "--distance", "1m", "-o", model, "--overwrite")
    (entry,) = strict_json(run("material", "show", model, "--json")[1])["materials"]
    assert entry["attenuation_distance"] is None
    assert entry["extinction"] == [0, 0, 0]


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_apply_writes_the_color_and_leaves_the_rest(run: Run, model: Path, tmp_path: Path, suffix: str) -> None:
    before, output = model.read_bytes(), tmp_path / f"out{suffix}"
    code, out, err = run("material", "apply", model, *WINE, "--object", "Wine", "--thickness", "0.25", "-o", output)
    assert (code, out, err) == (0, f"{output}: material 0 changed\n", "")
    (found,) = read_materials(output)
    assert (found.attenuation_color, found.attenuation_distance) == ((0.2, 0.02, 0.05), 0.01)
    assert (found.thickness, found.ior, found.warnings) == (0.25, 1.33, ())
    assert model.read_bytes() == before
    old, new = trimesh.load_scene(model), trimesh.load_scene(output)
    assert {k: v.shape for k, v in ((n, g.vertices) for n, g in old.geometry.items())} == {
        k: v.shape for k, v in ((n, g.vertices) for n, g in new.geometry.items())
    }


def test_apply_without_an_object_fills_what_light_enters(run: Run, model: Path) -> None:
    code, out, _ = run("material", "apply", model, *WINE, "-o", model, "--overwrite", "--json")
    assert code == 0
    assert strict_json(out) == {"output": str(model), "materials": [0]}
    assert len(read_materials(model)) == 1
    code, out, _ = run("material", "apply", model, *WINE, "--object", "Table", "-o", model, "--overwrite", "--json")
    assert strict_json(out) == {"output": str(model), "materials": [1]}


def test_a_preset_brings_its_index_of_refraction_and_tells_what_is_lost(run: Run, model: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.glb"
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        code, _, err = run("material", "apply", model, "--preset", "marble", "--object", "Wine", "-o", output)
    assert code == 0
    assert (
        "warning: glTF stores only absorption: scattering is written as absorption, and emission is left out\n" in err
    )
    medium = read_materials(output)[0].medium()
    assert medium.ior == tl.preset("marble").medium.ior
    np.testing.assert_allclose(medium.extinction, tl.preset("marble").medium.extinction, rtol=1e-13)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "no medium is given"),
        (["--color", "teal"], "--distance is missing"),
        ([*WINE, "--preset", "jade"], "use one or the other"),
        ([*WINE, "--object", "Beer"], "object 'Beer'; "),
        ([*WINE, "--thickness", "0"], "length '0'; the length must be positive"),
        ([*WINE, "--thickness", "thick"], "length 'thick'; the text is not a number"),
        (["--color", "linear(0,1,1)", "--distance", "1cm", "--no-clamp"], "red = 0 is not in 0 < t <= 1"),
    ],
)
def test_a_bad_option_writes_nothing(run: Run, model: Path, tmp_path: Path, options: list[str], message: str) -> None:
    before = sorted(tmp_path.iterdir())
    assert message in one_error_line(run("material", "apply", model, *options, "-o", tmp_path / "out.glb"))
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("out.obj", "suffix '.obj'"),
        ("none/out.glb", "create the folder first"),
        ("folder.glb", "a folder of this name"),
    ],
)
def test_a_bad_output_is_refused(run: Run, model: Path, tmp_path: Path, output: str, message: str) -> None:
    (tmp_path / "folder.glb").mkdir()
    assert message in one_error_line(run("material", "apply", model, *WINE, "-o", tmp_path / output))


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write into read-only folders")
def test_a_read_only_folder_is_a_failure_in_one_line(run: Run, model: Path, tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    line = one_error_line(run("material", "apply", model, *WINE, "-o", folder / "out.glb"), code=1)
    assert "cannot be written" in line


def test_a_folder_that_refuses_is_a_failure_in_one_line(
    run: Run, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("translucent.files.paths._temporary_file", refuse)
    line = one_error_line(run("material", "apply", model, *WINE, "-o", tmp_path / "out.glb"), code=1)
    assert "the file cannot be written (Permission denied)" in line
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.parametrize("verb", ["show", "apply"])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"glTF\2\0\0\0\xff\0\0\0", "the file is cut off after 12 bytes"),
        (b"{", "the JSON of the file is broken ("),
        (b"", "the file is empty"),
        (b"{}", "the JSON of the file has no 'asset', so the file is not glTF 2.0"),
        (
            b'{"asset": {}, "materials": [{"extensions": {"KHR_materials_volume": {"thicknessFactor": "1"}}}]}',
            "material 0 '': thicknessFactor is '1', not a number",
        ),
    ],
)
def test_a_bad_model_is_refused(run: Run, tmp_path: Path, verb: str, content: bytes, message: str) -> None:
    bad, output = tmp_path / "bad.glb", tmp_path / "out.glb"
    bad.write_bytes(content)
    more = (*WINE, "-o", output) if verb == "apply" else ()
    line = one_error_line(run("material", verb, bad, *more))
    assert message in line
    assert "bad.glb" in line
    assert not output.exists()


def test_help_shows_examples(run: Run) -> None:
    for verb in ("show", "apply"):
        code, out, err = run("material", verb, "--help")
        assert (code, err) == (0, "")
        assert f"Example: translucent material {verb}" in out
