"""The shipped meshes: what their README says of them holds, and their generator still makes them."""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt
import pytest

from translucent.geometry.mesh import Mesh
from translucent.mesh_files import load_mesh

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "meshes"
ROW = re.compile(r"^\| `(\S+)` \|.*\| ([\d.]+) × ([\d.]+) × ([\d.]+) \| (\d+) \| (yes|no) \|$", re.MULTILINE)
#: name -> ((x, y, z) in centimetres, triangles, closed), as the README has them.
DOCUMENTED = {
    name: (tuple(float(v) for v in size), int(triangles), closed == "yes")
    for name, *size, triangles, closed in ROW.findall((FOLDER / "README.md").read_text(encoding="utf-8"))
}
each_mesh = pytest.mark.parametrize("name", sorted(DOCUMENTED))


def _load(name: str) -> Mesh:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_mesh(FOLDER / name)


def test_readme_and_folder_list_the_same_files() -> None:
    files = {path.name for path in FOLDER.iterdir()}
    assert files == set(DOCUMENTED) | {"README.md"}
    assert {"sphere.ply", "knot.ply", "bear.ply", "soap.ply", "goblet.ply", "wine.ply"} <= files


def test_all_files_together_are_small() -> None:
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 3e6


@each_mesh
def test_mesh_is_as_documented(name: str) -> None:
    mesh = _load(name)
    size, triangles, closed = DOCUMENTED[name]
    assert (mesh.bounds[1] - mesh.bounds[0]) * 100 == pytest.approx(size, abs=0.0051)
    assert len(mesh.faces) == triangles
    assert mesh.diagnosis.solid == closed
    assert mesh.repairs == ()
    if closed:
        assert mesh.diagnosis.problems == ()
        assert mesh.volume > 0
    else:
        assert mesh.diagnosis.open_edges
        assert not mesh.diagnosis.mixed_edges
        assert not mesh.diagnosis.degenerate_faces


def test_only_the_leaf_is_open_and_it_has_texture_coordinates() -> None:
    assert [name for name, (_, _, closed) in DOCUMENTED.items() if not closed] == ["leaf.ply"]
    uv = _load("leaf.ply").uv
    assert uv is not None
    assert uv.min() >= 0
    assert uv.max() <= 1
    assert np.ptp(uv, axis=0).min() > 0.5


@each_mesh
def test_mesh_stands_on_the_ground(name: str) -> None:
    if name not in ("wine.ply", "drink.ply", "wick.ply", "flame.ply", "ice.ply"):
        assert abs(_load(name).bounds[0, 1]) < 1e-7


def test_wine_fills_the_goblet_along_shared_vertices() -> None:
    goblet, wine = _load("goblet.ply"), _load("wine.ply")
    surface = wine.bounds[1, 1]
    wall = wine.vertices[wine.vertices[:, 1] < surface - 1e-6]
    rim = wine.vertices[wine.vertices[:, 1] >= surface - 1e-6]
    edge = rim[np.hypot(rim[:, 0], rim[:, 2]) > np.hypot(rim[:, 0], rim[:, 2]).max() - 1e-6]
    shared = {p.tobytes() for p in goblet.vertices}
    assert len(wall) > 1000
    assert all(p.tobytes() in shared for p in wall)
    assert all(p.tobytes() in shared for p in edge)
    # The same triangles, wound the other way.
    of_wall = [key for key in _face_keys(wine) if any(np.frombuffer(p)[1] < surface - 1e-6 for p in key)]
    assert {(a, c, b) for a, b, c in of_wall} <= {turn for key in _face_keys(goblet) for turn in _turns(key)}
    assert 0.15e-3 < wine.volume < 0.25e-3  # a glass of wine in cubic metres


def _face_keys(mesh: Mesh) -> list[tuple[bytes, bytes, bytes]]:
    keys = [p.tobytes() for p in mesh.vertices]
    return [(keys[a], keys[b], keys[c]) for a, b, c in mesh.faces]


def _turns(key: tuple[bytes, bytes, bytes]) -> list[tuple[bytes, bytes, bytes]]:
    a, b, c = key
    return [(a, b, c), (b, c, a), (c, a, b)]


def test_goblet_wall_is_everywhere_about_as_thick_as_documented() -> None:
    generator = _generator()
    wall, normal = generator.bowl_wall()
    outer = wall + generator.WALL * normal
    # No point of the outer wall is nearer to the inner one than that it was moved by.
    gap = np.linalg.norm(outer[:, None] - wall[None], axis=-1).min(axis=1)
    assert gap == pytest.approx(np.full(len(wall), 0.15), abs=1e-3)


def test_shell_is_a_ball_with_a_cavity() -> None:
    shell = _load("shell.ply")
    assert shell.diagnosis.components == 2
    assert shell.volume == pytest.approx(4 / 3 * np.pi * (0.025**3 - 0.021**3), rel=0.01)
    assert abs(shell.winding_number(shell.center)) < 1e-9
    assert shell.winding_number(shell.center + np.array([0.023, 0, 0])) == pytest.approx(1.0, abs=1e-9)


def test_knot_neither_pinches_nor_meets_itself() -> None:
    generator = _generator()
    t = 2 * np.pi * np.arange(1200) / 1200
    p, h = generator.knot_curve(t), 1e-3
    first = (generator.knot_curve(t + h) - generator.knot_curve(t - h)) / (2 * h)
    second = (generator.knot_curve(t + h) - 2 * p + generator.knot_curve(t - h)) / h**2
    bend = np.linalg.norm(first, axis=1) ** 3 / np.linalg.norm(np.cross(first, second), axis=1)
    assert bend.min() > 1.5 * generator.KNOT_TUBE
    apart = np.abs(t[:, None] - t[None])
    apart = np.minimum(apart, 2 * np.pi - apart)
    strands = np.linalg.norm(p[:, None] - p[None], axis=-1)[apart > 0.6]
    assert strands.min() > 1.2 * 2 * generator.KNOT_TUBE


@pytest.mark.parametrize("name", ["bear.ply", "soap.ply", "knot.ply", "bangle.ply"])
def test_triangles_are_well_shaped(name: str) -> None:
    mesh = _load(name)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    squares = ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).sum(axis=1)
    # 1 for an equilateral triangle, 0 for a needle.
    quality = 4 * np.sqrt(3) * area / squares
    assert np.quantile(quality, 0.01) > 0.35


def _generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_meshes", ROOT / "tools" / "make_meshes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        # Dataclasses look their own module up.
        patch.setitem(sys.modules, "make_meshes", module)
        spec.loader.exec_module(module)
    return module


def test_generator_makes_the_shipped_files_byte_for_byte() -> None:
    pytest.importorskip("skimage", reason="the mesh generator needs scikit-image (dependency group 'meshes')")
    with np.errstate(under="ignore"):
        made = _generator().build()
    assert set(made) == {path.name for path in FOLDER.iterdir()}
    differing = [name for name, data in made.items() if (FOLDER / name).read_bytes() != data]
    assert differing == []
