"""metricThickness of glTF-Transform in Node: the document of a file whose thickness is wrong, and what it becomes."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import translucent as tl
from tests.bake.test_audit import model

WEB = Path(__file__).resolve().parents[2] / "web"

PIPELINE = """
import { NodeIO } from "@gltf-transform/core";
import { KHRONOS_EXTENSIONS } from "@gltf-transform/extensions";
import { metricThickness } from "./dist/gltf-transform.js";

const [from, to, options] = process.argv.slice(-3);
const io = new NodeIO().registerExtensions(KHRONOS_EXTENSIONS);
const document = await io.read(from);
const left = [];
try {
  await document.transform(metricThickness({ onFindings: (found) => left.push(...found), ...JSON.parse(options) }));
  await io.write(to, document);
  const root = document.getRoot();
  console.log(JSON.stringify({ left, scene: root.getDefaultScene().getName(), nodes: root.listNodes().length }));
} catch (error) {
  console.log(JSON.stringify({ error: error.message }));
}
"""


@pytest.fixture(scope="module")
def dist(web_dist: Path) -> Path:
    if not (web_dist / "gltf-transform.js").is_file() or not (WEB / "node_modules" / "@gltf-transform").is_dir():
        pytest.skip("glTF-Transform is not there: run `make web`")
    if shutil.which("node") is None:
        pytest.skip("Node is not here")
    return web_dist


def piped(path: Path, output: Path, **options: Any) -> dict[str, Any]:
    command = [sys.executable, "-m", "translucent"]
    given = json.dumps({"command": command, "size": 64, "rays": 16, **options})
    node = ["node", "--input-type=module", "--eval", PIPELINE, str(path), str(output), given]
    done = subprocess.run(node, cwd=WEB, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_wrong_thickness_becomes_metric(dist: Path, tmp_path: Path) -> None:
    """As `material check --fix` leaves the file; the rest of a document stays, and so do documents that are right."""
    path = model(tmp_path / "ball.glb", thickness=1.0, material={"pbrMetallicRoughness": {}})
    assert {"metal", "thickness-too-large"} <= set(tl.check_materials(path).codes)
    told = piped(path, tmp_path / "out.glb")
    assert told["left"] == []
    assert told["nodes"] == 1
    assert tl.check_materials(tmp_path / "out.glb").findings == ()
    scene = tl.load_scene(tmp_path / "out.glb")
    assert scene.objects[0].mesh.diagonal == pytest.approx(0.02 * 3**0.5, rel=1e-3)
    again = piped(tmp_path / "out.glb", tmp_path / "again.glb")
    assert again["left"] == []
    assert (tmp_path / "again.glb").stat().st_size == pytest.approx((tmp_path / "out.glb").stat().st_size, rel=0.01)


def test_what_fails_is_an_error_that_says_what_to_do(dist: Path, tmp_path: Path) -> None:
    path = model(tmp_path / "ball.glb")
    told = piped(path, tmp_path / "out.glb", command="no-such-translucent")
    assert told["error"].startswith("metricThickness; there is no command no-such-translucent; pip install")
    told = piped(path, tmp_path / "out.glb", rays=0)
    assert "rays" in told["error"]
    told = piped(path, tmp_path / "out.glb", texels=64)
    assert told["error"].startswith(
        "option texels of metricThickness; there is no such option; use one of command, size"
    )
    assert not (tmp_path / "out.glb").exists()
