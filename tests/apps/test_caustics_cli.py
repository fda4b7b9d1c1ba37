"""``--caustics`` of the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.boxes import boxes
from tests.command_line import Run
from translucent.gltf.file import write_gltf

pytestmark = pytest.mark.usefixtures("one_renderer")

GLASS = {
    "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
        "KHR_materials_ior": {"ior": 1.5},
        "KHR_materials_volume": {"thicknessFactor": 1.0},
    }
}


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A box of glass before an opaque one, in light that comes through it."""
    materials: list[dict[str, Any]] = [GLASS, {}]
    file = boxes(tmp_path / "scene.glb", materials, extents=(1, 1, 2), step=(3, 0, 0))
    file.tree["extensionsUsed"] = ["KHR_lights_punctual", *file.tree.get("extensionsUsed", [])]
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 50.0}]}}
    file.tree["nodes"].append({"translation": [-4, 0.3, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    file.tree["scenes"][0]["nodes"].append(len(file.tree["nodes"]) - 1)
    write_gltf(file, tmp_path / "scene.glb")
    return tmp_path / "scene.glb"


def test_photons_are_counted_in_the_plan(run: Run, model: Path, tmp_path: Path) -> None:
    told = json.loads(run("explain", model, "--caustics", 5000, "--json").out)["plan"]
    assert told["caustics"] == "Caustics(photons=5000, seed=0)"
    assert "5,000 photons from 1 light" in run("explain", model, "--caustics=5000").out
    assert "1,000,000 photons" in run("explain", model, "--caustics").out
    assert "requested" not in run("explain", model).out
    done = run("render", model, "-o", tmp_path / "out.png", "--size", "16x12", "--samples", 1, "-v", "--caustics", 500)
    assert done.code == 0
    assert "caustics: requested: 500 photons" in done.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("goblet", "--preset", "crystal", "--stage", "none", "--caustics"),
            "error: caustics; the scene has no lights that can emit photons; add a tl.PointLight",
        ),
        (("goblet", "--caustics=1000000000000"), "error: Caustics photons 1000000000000; the value must be a whole"),
        (
            ("goblet", "--caustics=-5"),
            "error: '--caustics=-5'; a negative number is read as an option; give a number above 0;",
        ),
        (("goblet", "--caustics=1e6"), "error: Invalid value for '--caustics': '1e6' is not a valid integer"),
    ],
)
def test_what_makes_no_caustics_is_told(run: Run, tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    found = run("render", *options, "-o", tmp_path / "out.png", "--size", "8x8")
    assert found.code == 2
    assert found.err.startswith(message)
    assert not (tmp_path / "out.png").exists()


def test_another_renderer_shows_none(run: Run, model: Path, tmp_path: Path) -> None:
    found = run("render", model, "-o", tmp_path / "out.png", "--caustics", 10, "--opaque-with", "pyrender")
    message = "error: --caustics; not possible with --opaque-with: it draws the objects"
    assert found.err.startswith(message)
