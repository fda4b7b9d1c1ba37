"""Maps made by hand, small models, and the Khronos validator."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import BakeReport, ThicknessMap, VertexThickness

Json = dict[str, Any]

SCRIPT = """
const v = require(process.argv[1]), fs = require('fs'), path = require('path');
const file = process.argv[2];
const external = uri => Promise.resolve(new Uint8Array(fs.readFileSync(path.join(path.dirname(file), uri))));
v.validateBytes(new Uint8Array(fs.readFileSync(file)), {externalResourceFunction: external})
  .then(r => console.log(JSON.stringify(r.issues)));
"""


@pytest.fixture(scope="session")
def validate() -> Callable[[Path], Json]:
    """Issues that gltf-validator finds; the module is looked for from the working folder, and by NODE_PATH."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is absent, so gltf-validator cannot run")
    where = subprocess.run(
        [node, "-p", "require.resolve('gltf-validator')"], capture_output=True, text=True, check=False
    )
    if where.returncode:
        pytest.skip("the node module gltf-validator is absent: npm install gltf-validator, and set NODE_PATH")

    def _validate(path: Path) -> Json:
        done = subprocess.run(
            [node, "-e", SCRIPT, where.stdout.strip(), str(path)], capture_output=True, text=True, check=True
        )
        issues = json.loads(done.stdout)
        assert isinstance(issues, dict)
        return issues

    return _validate


def report(**changes: Any) -> BakeReport:
    known: Json = {
        "rays": 1000, "seconds": 0.5, "mrays_per_second": 0.002, "samples": 10, "texels": 10, "overlapping_texels": 0,
        "faces_without_texel": 0, "degenerate_faces": 0, "udim_tiles": (1001,), "uv_from": "mesh", "escaped": 0.0,
        "missed": 0.0, "mean_standard_error": 0.001, "max_standard_error": 0.002, "above_tolerance": 0,
    }  # fmt: skip
    return BakeReport(**{**known, **changes})


def quad() -> tl.Mesh:
    """A square of two triangles whose UVs are its corners."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    return tl.Mesh(np.column_stack([corners, np.zeros(4)]), [[0, 1, 2], [0, 2, 3]], uv=corners, name="quad")


@pytest.fixture
def make_map() -> Callable[..., ThicknessMap]:
    """A map of given values, for a mesh if there is one."""

    def _make(values: Any, mesh: tl.Mesh | None = None, **settings: Any) -> ThicknessMap:
        found = np.asarray(values, dtype=np.float32)
        return ThicknessMap(
            values=found,
            coverage=found > 0,
            standard_error=np.full_like(found, 0.25),
            escaped=0.0,
            mesh=mesh or quad(),
            settings=BakeSettings(**{"size": len(found), "seed": 7, **settings}),
            report=report(),
        )

    return _make


@pytest.fixture
def make_vertices() -> Callable[..., VertexThickness]:
    """Thickness per vertex of a mesh."""

    def _make(values: Any, mesh: tl.Mesh) -> VertexThickness:
        found = np.asarray(values, dtype=np.float32)
        return VertexThickness(found, np.zeros_like(found), mesh, BakeSettings(), report())

    return _make


@pytest.fixture
def ramp(rng: np.random.Generator) -> np.ndarray:
    """(8, 8): thickness with all bits in use, some 0, 0.37 m at most."""
    values = rng.uniform(0.01, 0.36, (8, 8)).astype(np.float32)
    values[0, :3], values[7, 7] = 0, np.float32(0.37)
    return values


def sphere_uv(subdivisions: int = 2, radius: float = 1.0) -> trimesh.Trimesh:
    """An icosphere with UVs: each face has a cell of its own, so nothing overlaps."""
    ball = trimesh.creation.icosphere(subdivisions, radius)
    count = len(ball.faces)
    side = int(np.ceil(np.sqrt(count)))
    cell = np.stack(np.divmod(np.arange(count), side), axis=1)[:, None]
    uv = (cell + np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])) / side
    visual = trimesh.visual.TextureVisuals(uv=uv.reshape(-1, 2))
    made = trimesh.Trimesh(ball.triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), process=False)
    made.visual = visual
    return made


@pytest.fixture
def ball_glb(tmp_path: Path) -> Path:
    """A .glb with a ball that has UVs and an opaque material."""
    path = tmp_path / "ball.glb"
    path.write_bytes(trimesh.Scene(sphere_uv()).export(file_type="glb"))
    return path


@pytest.fixture
def make_ball() -> Callable[..., trimesh.Trimesh]:
    """`sphere_uv`."""
    return sphere_uv
