"""``translucent render --opaque-with pyrender``."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tests.boxes import GLASS, boxes
from tests.command_line import Run
from translucent.gltf.file import write_gltf


def write(path: Path, *materials: dict[str, Any]) -> Path:
    """A file with a box of 1 m for each material, the second behind the first, and a lamp in front."""
    file = boxes(path, list(materials), extents=(1, 1, 1), step=(0.3, 0, -1.5))
    file.tree["extensionsUsed"] = ["KHR_lights_punctual"]
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 30.0}]}}
    file.tree["nodes"].append({"translation": [0, 2, 4], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    file.tree["scenes"][0]["nodes"].append(len(file.tree["nodes"]) - 1)
    write_gltf(file, path)
    return path


#: Much the same from everywhere: pyrender has only a mean light from all around.
LIT = ("--environment", "light-table")


def test_pyrender_draws_the_opaque_objects_of_a_file(pyrender: ModuleType, run: Run, tmp_path: Path) -> None:
    red = {"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.1, 0.1, 1], "metallicFactor": 0.0}}
    model = write(tmp_path / "scene.glb", {"extensions": GLASS}, red)
    arrays = {}
    for name, options in (("own", ()), ("pyrender", ("--opaque-with", "pyrender"))):
        output = tmp_path / f"{name}.npz"
        arguments = "render", model, "-o", output, "--size", "64x48", "--samples", 4, "--verbose"
        code, out, err = run(*arguments, *LIT, *options)
        assert (code, err) == (0, "")
        with np.load(output) as file:
            arrays[name] = dict(file)
    assert "opaque objects: pyrender 0.1.45 through arrays" in out
    assert "2. backdrop: a backdrop (a picture with depth) replaces opaque objects" in out
    own, drawn = arrays["own"], arrays["pyrender"]
    np.testing.assert_allclose(drawn["thickness"], own["thickness"], atol=1e-5)
    red_box = (own["radiance"][..., 0] > 3 * own["radiance"][..., 1]) & (own["transmittance"] == 1).all(axis=-1)
    assert red_box.sum() > 50
    assert (drawn["radiance"][red_box] != own["radiance"][red_box]).any()
    ratio = drawn["radiance"][red_box].mean() / own["radiance"][red_box].mean()
    assert 0.85 < ratio < 1.2


def test_the_record_says_what_drew_the_opaque_objects(pyrender: ModuleType, run: Run, tmp_path: Path) -> None:
    model = write(tmp_path / "scene.glb", {"extensions": GLASS}, {})
    code, out, _ = run(
        "render",
        model,
        "-o",
        tmp_path / "a.png",
        "--size",
        "32x24",
        "--samples",
        1,
        "--opaque-with",
        "pyrender",
        "--json",
    )
    assert code == 0
    assert json.loads(out)["provenance"]["opaque"] == "pyrender 0.1.45 through arrays"


def test_it_needs_something_opaque_and_a_known_name(pyrender: ModuleType, run: Run, tmp_path: Path) -> None:
    model, output = write(tmp_path / "scene.glb", {"extensions": GLASS}), tmp_path / "a.png"
    code, _, err = run("render", model, "-o", output, "--size", "32x24", "--opaque-with", "pyrender")
    assert code == 2
    assert err == (
        "error: drawing opaque objects with pyrender; all nodes have a medium, so no opaque node is left: 'Box 0'; "
        "render without pyrender\n"
    )
    code, _, err = run("render", model, "-o", output, "--opaque-with", "blender")
    assert code == 2
    assert "'blender' is not" in err
    assert not output.exists()
