"""UDIM tiles in one call, and maps as programs expect them, read by readers that are not ours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.bake.check import VERDICTS, MapCheck
from translucent.geometry.solids import Box

FAST = ("--size", "32", "--rays", "8", "--padding", "2")


def write(path: Path, tiles: dict[tuple[int, int], float]) -> Path:
    """Boxes of a thickness each, over a tile of their own, in which each face has a cell."""
    lines: list[str] = []
    for number, (tile, thickness) in enumerate(tiles.items()):
        mesh = Box.slab((0.1, 0.1), thickness).tessellate()
        lines += [f"v {x} {y} {z + 0.1 * number}" for x, y, z in mesh.vertices]
        for face in range(12):
            low = np.array(tile) + np.array((face % 4, face // 4)) / 4 + 0.02
            lines += [f"vt {low[0] + u} {low[1] + v}" for u, v in ((0, 0), (0.2, 0), (0.2, 0.2))]
        for face, corners in enumerate(mesh.faces):
            ends = [f"{8 * number + v + 1}/{36 * number + 3 * face + i + 1}" for i, v in enumerate(corners)]
            lines.append("f " + " ".join(ends))
    path.write_text("\n".join(lines))
    return path


@pytest.fixture
def slabs(tmp_path: Path) -> Path:
    """Two boxes, 1 and 2 cm thick, over the tiles 1001 and 1012."""
    return write(tmp_path / "slabs.obj", {(0, 0): 0.01, (1, 1): 0.02})


@pytest.fixture
def slab(tmp_path: Path) -> Path:
    return write(tmp_path / "slab.obj", {(0, 0): 0.01})


def test_each_tile_has_a_file_and_all_have_one_scale(run: Run, slabs: Path, tmp_path: Path) -> None:
    done = run("bake", slabs, "-o", tmp_path / "t.<UDIM>.png", "--mode", "normal", *FAST)
    assert done.code == 0, done
    assert sorted(path.name for path in tmp_path.glob("t.*.png")) == ["t.1001.png", "t.1012.png"]
    largest = [np.asarray(Image.open(tmp_path / f"t.{tile}.png")).max() for tile in (1001, 1012)]
    record = json.loads((tmp_path / "t.<UDIM>.png.json").read_text())
    assert [one["tile"] for one in record["maps"]] == [1001, 1012]
    assert len({one["encoding"]["scale"] for one in record["maps"]}) == 1
    assert max(largest) == 65535
    for tile, thickness in ((1001, 0.01), (1012, 0.02)):
        values = tl.load_thickness_map(tmp_path / f"t.{tile}.png")
        assert np.isclose(values[values > 0].min(), thickness, rtol=1e-3)


def test_a_model_without_tiles_is_refused(run: Run, tmp_path: Path) -> None:
    line = one_error_line(run("bake", "bear", "-o", tmp_path / "t.<UDIM>.png", *FAST))
    assert "has no texture coordinates, so it has no UDIM tiles; remove <UDIM> from the name" in line
    line = one_error_line(run("bake", "leaf", "-o", tmp_path / "t.<UDIM>.png", "--check", *FAST))
    assert "has several tiles; check a single tile: --tile 1001" in line


@pytest.mark.parametrize(
    ("program", "name", "unit"), [("unity", "slab_Thickness.png", "mm"), ("unreal", "T_slab_Thickness.png", "cm")]
)
def test_maps_for_engines_are_read_back(
    run: Run, slab: Path, tmp_path: Path, program: str, name: str, unit: str
) -> None:
    done = run("bake", slab, "-o", tmp_path, "--for", program, "--mode", "normal", *FAST)
    assert done.code == 0, done
    picture = Image.open(tmp_path / name)
    assert picture.mode.startswith("I;16")  # one channel of 16 bits
    stored = np.asarray(picture) / 65535.0
    (line,) = [line for line in done.out.splitlines() if line.lower().startswith(program)]
    largest = float(line.rpartition(f" {unit}")[0].split()[-1]) / {"mm": 1e3, "cm": 1e2}[unit]
    metres = largest * (1.0 - stored if program == "unreal" else stored)
    truth = tl.load_thickness_map(tmp_path / name)
    np.testing.assert_allclose(metres, truth, atol=1e-3 * largest)
    assert "sRGB off" in line


def test_a_map_for_blender_is_in_metres_in_one_channel(run: Run, slab: Path, tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    done = run("bake", slab, "-o", tmp_path, "--for", "blender", "--mode", "normal", *FAST)
    assert "Non-Color, its Color into Subsurface Scale; values are metres" in done.out
    # Cycles mixes three channels into one number, as red, green and blue.
    assert [channel.name for channel in exr.File(str(tmp_path / "slab_thickness.exr")).header()["channels"]] == ["Y"]
    line = one_error_line(run("bake", slab, "-o", tmp_path / "a.png", "--for", "blender", *FAST))
    assert "blender reads .exr; write .exr, or give a folder" in line


def test_a_unit_that_looks_wrong_is_said(run: Run, slab: Path, tmp_path: Path) -> None:
    done = run("bake", slab, "-o", tmp_path / "a.png", "--unit", "100m", "--mode", "normal", *FAST)
    assert "m thick, too thick for most light: check --unit" in done.out


@pytest.mark.parametrize(("off", "words"), [(0.02, "looks right"), (0.1, "looks similar"), (0.3, "looks different")])
def test_a_check_ends_in_a_verdict(off: float, words: str) -> None:
    errors = tl.Errors("transmittance", off, 0.0, 0.0, 0.0, 0.0, -off, 0.0, 0.0, 1, "")
    found = MapCheck(None, None, errors, errors, 1.0, np.zeros((1, 1, 3)))
    assert str(found).splitlines()[-1].startswith(f"verdict: {words}")
    assert "too dark" in found.verdict
    assert [most for most, _ in VERDICTS] == sorted(most for most, _ in VERDICTS)
