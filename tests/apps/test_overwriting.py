"""No verb replaces a file that it reads, under whatever name, unless an option allows it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import trimesh
from PIL import Image

from tests.boxes import GLASS, boxes
from tests.command_line import Run
from translucent.gltf.file import write_gltf

LOOK = ("--size", "16x12", "--samples", "1", "--backend", "cpu")
QUICK = ("--size", "16", "--rays", "2", "--padding", "1")


@pytest.fixture
def folder(tmp_path: Path, in_tmp_path: Path) -> Path:
    """The working folder: a model, as .glb and .gltf with links, a mesh, a picture of a sky and a table."""
    file = boxes(tmp_path / "model.glb", [{"name": "glass", "extensions": GLASS}], (1, 1, 1), (2, 0, 0))
    write_gltf(file, tmp_path / "model.glb")
    linked = boxes(tmp_path / "other.glb", [{"name": "glass", "extensions": GLASS}], (1, 1, 1), (2, 0, 0))
    linked.tree["images"] = [{"uri": "a%20label.png"}]
    write_gltf(linked, tmp_path / "linked.gltf")
    (tmp_path / "other.glb").unlink()
    for name in ("sky.png", "a label.png"):
        Image.new("RGB", (8, 4), (90, 120, 200)).save(tmp_path / name)
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.ply")
    (tmp_path / "table.csv").write_text("name,color,distance\nwine,#7b1e3a,1cm\n")
    os.symlink(tmp_path / "model.glb", tmp_path / "symbolic.glb")
    os.link(tmp_path / "model.glb", tmp_path / "hard.glb")
    os.symlink(tmp_path, tmp_path / "folder")
    return tmp_path


APPLY = ("--color", "#7b1e3a", "--distance", "1cm")
CASES = {
    "a material": ("material", "apply", "model.glb", "-o", "model.glb", *APPLY),
    "a symbolic link": ("material", "apply", "model.glb", "-o", "symbolic.glb", *APPLY),
    "read through a link": ("material", "apply", "symbolic.glb", "-o", "model.glb", *APPLY),
    "a hard link": ("material", "apply", "model.glb", "-o", "hard.glb", *APPLY),
    "through a folder": ("material", "apply", "model.glb", "-o", "folder/model.glb", *APPLY),
    "a map into its model": ("bake", "model.glb", "-o", "model.glb", *QUICK),
    "many maps into their models": ("bake", "model.glb", "--out-dir", ".", "--format", "glb", *QUICK),
    "a mesh with thickness": ("bake", "box.ply", "--vertices", "-o", "box.ply", "--rays", "2"),
    "a mesh with the details": ("bake", "bear", "--vertices", "-o", "box.ply", "--high", "box.ply"),
    "a picture of a sky": ("render", "box.ply", "-o", "sky.png", "--environment", "sky.png", *LOOK),
    "a picture of a turned sky": ("render", "box.ply", "-o", "sky.png", "--environment", "sky.png,90", *LOOK),
    "a picture as background": ("render", "box.ply", "-o", "sky.png", "--background", "sky.png", *LOOK),
    "a texture of the model": ("render", "linked.gltf", "-o", "a label.png", *LOOK),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_read_is_not_replaced(name: str, folder: Path, run: Run) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    result = run(*CASES[name])
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("error: output '")
    assert result.err.endswith("choose another name for the output, or add --overwrite to replace the file\n")
    assert "'; the command reads this file, as '" in result.err
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_a_table_is_not_replaced(folder: Path, run: Run) -> None:
    before = (folder / "table.csv").read_bytes()
    result = run("extinction", "--batch", "table.csv", "-o", "table.csv")
    assert result.code == 2
    assert result.err.startswith("error: output 'table.csv'; the command reads this file, as 'table.csv'; choose")
    assert (folder / "table.csv").read_bytes() == before
    assert run("extinction", "--batch", "table.csv", "-o", "table.csv", "--overwrite").code == 0
    assert (folder / "table.csv").read_bytes() != before


@pytest.mark.parametrize("name", ["a material", "a map into its model", "a picture of a sky"])
def test_it_is_replaced_where_that_is_meant(name: str, folder: Path, run: Run) -> None:
    result = run(*CASES[name], "--overwrite")
    assert result.code == 0, result.err


def test_other_files_are_replaced_without_a_word(folder: Path, run: Run) -> None:
    for _ in range(2):
        assert run("material", "apply", "model.glb", "-o", "out.glb", *APPLY).code == 0
