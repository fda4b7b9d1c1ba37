"""Maps made by hand, and small models."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.bake import check, scatter_job, strips
from translucent.bake.settings import BakeSettings
from translucent.bake.thickness_map import BakeReport, ThicknessMap, VertexThickness

Json = dict[str, Any]


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


@pytest.fixture
def checkpoints_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Checkpoints of bakes after every strip, however short the time since the last one."""
    monkeypatch.setattr(strips, "EVERY", 0.0)
    monkeypatch.setattr(strips, "REST", 0.0)


@pytest.fixture(autouse=True)
def small_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks by pictures of 128 x 128 pixels, where no size is stated."""
    for checked in (check.check_map, scatter_job.check_scatter):
        sizes = [(128, 128) if isinstance(one, tuple) else one for one in checked.__defaults__ or ()]
        monkeypatch.setattr(checked, "__defaults__", tuple(sizes))
