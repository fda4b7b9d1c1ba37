"""Mesh files: formats, units, what loading mends, and what is refused."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from tests.values.handmade import (
    CLEAN,
    CORNERS,
    CUBE,
    DOUBLED,
    EPS,
    ball,
    changed,
    cube,
    facts,
    inverted,
    joined,
    moebius,
)
from translucent import mesh_files
from translucent.geometry import winding
from translucent.geometry.mesh import Mesh, mended
from translucent.geometry.repair import WELD_TOLERANCE, weld
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.mesh_files import load_mesh

# Welding


def test_welding_joins_what_is_within_the_tolerance_and_nothing_else() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [1 + 0.9e-6, 0, 0], [1 + 1.7e-6, 0, 0], [1.1, 0, 0]])
    # The third to the fifth are a chain: neighbors of neighbors are joined.
    assert weld(points, 1e-6).tolist() == [0, 1, 0, 1, 1, 5]


def test_a_crowd_is_joined_without_all_of_its_pairs() -> None:
    """Of two crowds of 2,000 points each, half a tolerance wide, pairs would take 64 MB."""
    chance = np.random.default_rng(1)
    crowds = [at + 5e-7 * chance.random((2000, 3)) for at in (0.0, 1.0)]
    alone = np.array([[2.0, 0, 0], [2 + 0.9e-6, 0, 0], [2 + 2e-6, 0, 0]])
    tracemalloc.start()
    try:
        found = weld(np.concatenate([*crowds, alone]), 1e-6)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    assert found.tolist() == [0] * 2000 + [2000] * 2000 + [4000, 4000, 4002]


@pytest.mark.parametrize(("gap", "solid"), [(0.0, True), (0.5, True), (3.0, False)])
def test_loading_closes_cracks_of_rounding_and_leaves_wider_ones(tmp_path: Path, gap: float, solid: bool) -> None:
    body = ball(1)
    corners = body.vertices[body.faces] * 1.0
    corners[0] += gap * WELD_TOLERANCE * body.diagonal / math.sqrt(3)
    path = tmp_path / "cracked.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    path.write_text("\n".join([*lines, *[f"f {i} {i + 1} {i + 2}" for i in range(1, len(lines), 3)]]))
    mesh = load_mesh(path)
    assert mesh.diagnosis.solid is solid
    assert len(mesh.vertices) == len(body.vertices) + (0 if solid else 3)
    assert f"welded {len(lines) - len(mesh.vertices)} of {len(lines)} vertices" in mesh.repairs[0]


# Loading


def save(path: Path, mesh: Mesh) -> Path:
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return path


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off", "glb"])
def test_a_format_is_read_back_as_it_was_written(tmp_path: Path, suffix: str) -> None:
    body = cube(low=0.25, size=0.5)  # float32 holds these
    mesh = load_mesh(save(tmp_path / f"cube.{suffix}", body))
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.name == f"cube.{suffix}"
    assert len(mesh.vertices) == 8
    corners = {tuple(row) for row in mesh.vertices.tolist()}
    assert corners == {tuple(row) for row in body.vertices.tolist()}
    assert mesh.volume == pytest.approx(0.125, rel=8 * EPS)


def test_an_ascii_stl_and_a_capital_suffix_are_read(tmp_path: Path) -> None:
    path = tmp_path / "CUBE.STL"
    path.write_text(trimesh.Trimesh(CORNERS, CUBE, process=False).export(file_type="stl_ascii"))
    assert facts(load_mesh(path).diagnosis) == CLEAN


@pytest.mark.parametrize(("unit", "size"), [("m", 2.0), ("cm", 0.02), ("in", 0.0508), ("µm", 2e-6), ("km", 2000.0)])
def test_coordinates_are_in_the_given_unit(tmp_path: Path, unit: str, size: float) -> None:
    mesh = load_mesh(save(tmp_path / "cube.obj", cube(size=2.0)), unit=unit)
    assert mesh.bounds == pytest.approx(np.array([[0] * 3, [size] * 3]), rel=1e-15)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="unit 'furlong'; no unit of length has this name"):
        load_mesh(save(tmp_path / "cube.obj", cube()), unit="furlong")


def test_the_nodes_of_a_scene_become_one_mesh_in_their_places(tmp_path: Path) -> None:
    scene, part = trimesh.Scene(), trimesh.Trimesh(CORNERS, CUBE, process=False)
    for x in (0.0, 5.0):
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix((x, 0, 0)))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    assert facts(mesh.diagnosis) == CLEAN | {"components": 2}
    assert mesh.bounds.tolist() == [[0, 0, 0], [6, 1, 1]]


def test_one_flipped_face_is_turned_back_with_a_warning(tmp_path: Path) -> None:
    path = save(tmp_path / "cube.off", Mesh(CORNERS, changed(CUBE, flip=4)))
    with pytest.warns(tl.TranslucentWarning, match=re.escape("'cube.off': flipped 1 of 12 faces to match their")):
        mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.volume == 1.0


def test_a_body_inside_out_is_turned_outwards_with_a_warning(tmp_path: Path) -> None:
    path = save(tmp_path / "cube.off", inverted(cube()))
    with pytest.warns(tl.TranslucentWarning, match=re.escape("mesh 'cube.off': flipped 1 closed part outwards")):
        mesh = load_mesh(path)
    assert mesh.volume == 1.0
    assert mesh.repairs == ("flipped 1 closed part outwards",)


def test_a_cavity_stays_a_cavity(tmp_path: Path) -> None:
    hollow = joined(cube(), inverted(cube(low=0.25, size=0.5)))
    assert load_mesh(save(tmp_path / "hollow.off", hollow)).volume == pytest.approx(0.875, rel=8 * EPS)


@pytest.mark.parametrize("mesh", [moebius(), Mesh(CORNERS, DOUBLED), Mesh(CORNERS, CUBE[2:])])
def test_what_cannot_be_mended_is_left_alone(tmp_path: Path, mesh: Mesh) -> None:
    loaded = load_mesh(save(tmp_path / "mesh.off", mesh))
    left = facts(mesh.diagnosis) | {"unreferenced_vertices": 0}
    assert facts(loaded.diagnosis) == left


@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_flips_of_a_cube_are_repaired(tmp_path_factory: pytest.TempPathFactory, flips: list[bool]) -> None:
    faces = np.where(np.array(flips)[:, None], CUBE[:, ::-1], CUBE)
    path = save(tmp_path_factory.mktemp("flips") / "cube.off", Mesh(CORNERS, faces))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.TranslucentWarning)
        mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.volume == pytest.approx(1.0, rel=8 * EPS)


SEAM = """
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
vt 0 0\nvt 1 0\nvt 0 1\nvt 0.5 0.5
f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 1/4 4/3 3/1\nf 2/1 3/2 4/3
"""


def test_a_uv_seam_survives_welding(tmp_path: Path) -> None:
    path = tmp_path / "seam.obj"
    path.write_text(SEAM)
    mesh = load_mesh(path)
    assert facts(mesh.diagnosis) == CLEAN
    assert mesh.uv is not None
    # By hand: corner, position and uv of every face corner, and 4 positions with 9 different pairs.
    pairs = {(*p, *t) for p, t in zip(mesh.vertices.tolist(), mesh.uv.tolist(), strict=True)}
    assert (len(mesh.vertices), len(pairs)) == (8, 8)
    assert {pair[3:] for pair in pairs if pair[:3] == (0, 0, 0)} == {(0, 0), (0.5, 0.5)}
    first = mesh.faces[0]
    assert mesh.vertices[first].tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]
    assert mesh.uv[first].tolist() == [[0, 0], [0, 1], [1, 0]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "no file has this path; check the path"),
        ("mesh.xyzw", b"", "the mesh format '.xyzw' is not supported; use glb, gltf, obj, stl, ply or off"),
        ("mesh", b"", "the mesh format 'without suffix' is not supported"),
        ("empty.obj", b"", "the mesh has no faces"),
        ("empty.stl", b"", "the mesh has no faces"),
        ("empty.ply", b"", "the file cannot be read ("),
        ("garbage.glb", b"\x00\xff" * 200, "the JSON of the file is broken ("),
        ("garbage.ply", b"\x00\xff" * 200, "the file cannot be read ("),
        ("garbage.off", b"\x00\xff" * 200, "the file cannot be read ("),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "the mesh has no faces; use a mesh of triangles, not of points or lines"),
        ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 vertices are not finite (first: 0)"),
        ("huge.obj", b"v 0 0 1e30\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "beyond the limit of 1e+18 m"),
    ],
)
def test_such_a_file_is_refused(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(tl.InputError, match=re.escape(message)) as caught:
        load_mesh(path)
    assert name in str(caught.value)


INTERRUPTED_IMPORT = """
import signal, sys, translucent as tl

class Pressed:
    def find_spec(self, name, *_):
        if name == "networkx":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Pressed())
try:
    tl.load_mesh(sys.argv[1])
except KeyboardInterrupt:
    from trimesh import graph
    print(graph.nx.__name__)
print(len(tl.load_mesh(sys.argv[1]).faces))
"""


def test_an_interrupted_import_of_trimesh_is_whole_and_what_it_logs_is_not_printed(tmp_path: Path) -> None:
    """trimesh catches what is raised while it imports networkx, and would raise it wherever that is used.

    It logs that the file is damaged: in a process of its own, since pytest has handlers for what is logged.
    """
    text = (
        "solid a\nfacet normal 0 0 x\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid"
    )
    (tmp_path / "a.stl").write_text(text)
    command = [sys.executable, "-c", INTERRUPTED_IMPORT, tmp_path / "a.stl"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("networkx\n1\n", "")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="the path is a folder; give the path of a file"):
        load_mesh(tmp_path)


def test_a_part_in_the_hole_of_a_ring_is_no_cavity_and_a_shell_in_a_ball_is(tmp_path: Path) -> None:
    """The box around the ring holds both; whether a part is a cavity is for the winding number to say."""
    ring, ball = Torus().tessellate(24), Sphere(radius=0.15).tessellate(12)
    inverted = Mesh(ball.vertices, ball.faces[:, ::-1])
    assert joined(ring, inverted).diagnosis.inside_out_parts == 1
    assert "1 closed parts inside out" in joined(ring, inverted).diagnosis.problems
    with pytest.warns(tl.TranslucentWarning, match="flipped 1 closed part outwards"):
        mended = load_mesh(save(tmp_path / "ring.ply", joined(ring, inverted)))
    assert mended.volume == pytest.approx(ring.volume + ball.volume, rel=1e-6)
    shell = joined(Sphere().tessellate(24), inverted)
    assert shell.diagnosis.inside_out_parts == 0
    assert load_mesh(save(tmp_path / "shell.ply", shell)).repairs == ()


def test_a_stray_triangle_far_away_does_not_weld_the_model_into_one_point(tmp_path: Path) -> None:
    ball, stray = Sphere().tessellate(48), Sphere(center=(1e6, 0.0, 0.0)).tessellate(4)
    loaded = load_mesh(save(tmp_path / "stray.ply", joined(ball, stray)))
    assert len(loaded.vertices) == len(ball.vertices) + len(stray.vertices)


def test_many_parts_are_oriented_in_one_go(tmp_path: Path) -> None:
    """Every part inside out, 1500 of them: no loop over all parts for each part."""
    ball = Sphere(radius=0.3).tessellate(4)
    parts = [Mesh(ball.vertices + (i % 40, i // 40, 0.0), ball.faces[:, ::-1]) for i in range(1500)]
    with pytest.warns(tl.TranslucentWarning, match="flipped 1500 closed parts outwards"):
        assert load_mesh(save(tmp_path / "parts.ply", joined(*parts))).diagnosis.solid


def test_parts_are_compared_with_those_around_them_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Balls that look inwards: 400 apart from one another, each with another in it, and 400 bubbles in a box."""
    ball, inner = Sphere(radius=0.3).tessellate(4), Sphere(radius=0.1).tessellate(4)
    places = [(i % 20 + 0.01 * i, i // 20, 0.1 * (i % 7)) for i in range(400)]
    apart = [Mesh(one.vertices + at, one.faces[:, ::-1]) for at in places for one in (ball, inner)]
    monkeypatch.setattr(winding, "MOST_PAIRS", 20 * sum(len(part.faces) for part in apart))  # of 2,400,000 per part
    with pytest.warns(tl.TranslucentWarning, match="flipped 400 closed parts outwards"):
        assert mended(joined(*apart)).volume == pytest.approx(400 * (ball.volume - inner.volume))
    bubbles = [Box((-1, -1, -1), (30, 30, 2)).tessellate(1), *apart[::2]]
    assert mended(joined(*bubbles)).repairs == ()


def test_parts_that_all_lie_one_in_another_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(winding, "MOST_PAIRS", 1000)
    nested = [Sphere(radius=i).tessellate(4) for i in range(1, 40)]
    with pytest.raises(tl.InputError, match="39 parts with faces that point inwards are nested"):
        mended(joined(*(inverted(one) for one in nested)))


def test_text_in_latin_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / "latin.obj"
    path.write_bytes(
        "# modèle\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n".encode("latin-1")
    )
    assert load_mesh(path).diagnosis.solid


def test_texture_coordinates_of_several_materials_stay_as_they_are(tmp_path: Path) -> None:
    from PIL import Image

    for name in "ab":
        Image.new("RGB", (8, 8), (9, 8, ord(name))).save(tmp_path / f"{name}.png")
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.1 0.2\nvt 0.9 0.2\nvt 0.1 0.8\n"
    faces = "usemtl a\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nusemtl b\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n"
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\n{corners}{faces}")
    mesh = tl.load_mesh(tmp_path / "m.obj")
    assert mesh.diagnosis.solid
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv[mesh.faces].min(axis=(0, 1)), [0.1, 0.2])
    np.testing.assert_allclose(mesh.uv[mesh.faces].max(axis=(0, 1)), [0.9, 0.8])


@pytest.mark.parametrize("index", ["ushort", "int"])
def test_a_plain_ply_is_read_without_trimesh(index: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As trimesh reads it; files with anything else in them are left to trimesh."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment a tetrahedron\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face 4\nproperty list uchar {index} vertex_indices\nend_header\n"
    ).encode()
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
    faces = np.zeros(4, [("count", "u1"), ("corners", "<u2" if index == "ushort" else "<i4", 3)])
    faces["count"], faces["corners"] = 3, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    content = header + corners.tobytes() + faces.tobytes()
    plain, other = tmp_path / "plain.ply", tmp_path / "other.ply"
    plain.write_bytes(content)
    other.write_bytes(content.replace(b"float", b"float32"))
    by_trimesh = load_mesh(other)

    def imported(module: str = "trimesh") -> None:
        raise AssertionError(f"{module} is imported")

    monkeypatch.setattr(mesh_files, "import_trimesh", imported)
    mesh = load_mesh(plain)
    np.testing.assert_array_equal(mesh.vertices, by_trimesh.vertices)
    np.testing.assert_array_equal(mesh.faces, by_trimesh.faces)
    assert mesh.diagnosis.solid
    faces["corners"][0, 0] = 4
    plain.write_bytes(header + corners.tobytes() + faces.tobytes())
    with pytest.raises(tl.InputError, match=r"plain\.ply'; .*trimesh is imported"):
        load_mesh(plain)
