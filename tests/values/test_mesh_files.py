"""Meshes of other people, clean and nasty, as files."""

from __future__ import annotations

import csv
import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.values.handmade import CLEAN, facts
from translucent.geometry.repair import WELD_TOLERANCE
from translucent.mesh_files import load_mesh


def _manifest(assets: Path, folder: str) -> dict[str, dict[str, str]]:
    with (assets / "MANIFEST.csv").open(encoding="utf-8") as stream:
        return {Path(row["file"]).name: row for row in csv.DictReader(stream) if row["file"].startswith(f"{folder}/")}


CLEAN_FILES = [
    "1002_tray_bottom.STL",
    "angle_block.STL",
    "armadillo.obj",
    "ballA.off",
    "ballB.off",
    "bunny.obj",
    "cow.obj",
    "cylinder.stl",
    "featuretype.STL",
    "idler_riser.STL",
    "mengerSponge3.glb",
    "penguin.obj",
    "quadknot.obj",
    "rocker-arm.obj",
    "spot.obj",
    "testplate.glb",
    "torus.obj",
    "unit_cube.STL",
    "unit_sphere.STL",
]


@pytest.mark.parametrize("name", CLEAN_FILES)
def test_a_clean_file_is_a_solid_with_the_listed_volume(assets: Path, name: str) -> None:
    row = _manifest(assets, "meshes_clean")[name]
    mesh = load_mesh(assets / "meshes_clean" / name)
    assert mesh.diagnosis.solid
    assert not mesh.diagnosis.inverted
    assert len(mesh.faces) == int(row["tri_raw"])
    # Welding moves a vertex by up to 1e-6 of the diagonal where it closes a crack: volume by that times the area.
    corners = mesh.vertices[mesh.faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(sides, axis=1).sum()
    assert mesh.volume == pytest.approx(float(row["volume"]), abs=WELD_TOLERANCE * mesh.diagonal * area)


def test_the_list_of_clean_files_is_complete(assets: Path) -> None:
    assert sorted(path.name for path in (assets / "meshes_clean").iterdir()) == sorted(CLEAN_FILES)


@pytest.mark.parametrize(
    ("name", "volume", "relative"),
    [
        ("unit_cube.STL", 1.0, 1e-6),
        ("mengerSponge3.glb", (20 / 27) ** 3, 1e-6),  # coordinates are float32
        ("angle_block.STL", 0.041358 / 0.036127, 2e-3),  # the CAD system's own; curved parts are tessellated
        ("idler_riser.STL", 0.14522859 / 0.09754366, 2e-3),
    ],
)
def test_the_volume_of_a_known_body(assets: Path, name: str, volume: float, relative: float) -> None:
    assert load_mesh(assets / "meshes_clean" / name).volume == pytest.approx(volume, rel=relative)


def test_seams_of_a_textured_model_survive(assets: Path) -> None:
    spot = load_mesh(assets / "meshes_clean" / "spot.obj")
    assert spot.uv is not None
    # The file has 3225 texture vertices on 2930 positions.
    assert len(np.unique(spot.vertices, axis=0)) == 2930
    assert 2930 < len(spot.vertices) <= 3225 + 2930


SOLID = dict(CLEAN)
OPEN = CLEAN | {"closed": False, "solid": False}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("3storybuilding.glb", SOLID | {"nonmanifold_edges": 26, "duplicate_faces": 8}),
        ("capsule.obj", SOLID | {"degenerate_faces": 200}),
        ("chair_model.obj", SOLID | {"nonmanifold_edges": 9518, "duplicate_faces": 6382, "components": 3}),
        ("cube_no_bottom.obj", OPEN | {"open_edges": 8}),
        ("fan3.obj", OPEN | {"open_edges": 7, "nonmanifold_edges": 1}),
        ("joined_tetrahedra.obj", SOLID | {"nonmanifold_edges": 3, "duplicate_faces": 1}),
        ("large_block.STL", SOLID),
        ("moebius.obj", OPEN | {"open_edges": 112, "mixed_edges": 4}),
        ("nested_shell_Cray_left.obj", SOLID | {"components": 2}),
        ("not_convex.obj", SOLID | {"nonmanifold_edges": 12}),
        ("notenoughindices.obj", OPEN | {"open_edges": 3}),
        ("self_intersectA.obj", SOLID),
        ("shared.STL", SOLID | {"nonmanifold_edges": 1}),
        ("soup.stl", OPEN | {"open_edges": 300, "components": 100}),
        ("sphereWithHole.stl", OPEN | {"open_edges": 9}),
        ("suzanne.obj", OPEN | {"open_edges": 42, "nonmanifold_edges": 1, "duplicate_faces": 1}),
        ("teapot.obj", OPEN | {"open_edges": 160, "components": 3}),
        ("wallhole.obj", SOLID | {"degenerate_faces": 11, "nonmanifold_edges": 1, "duplicate_faces": 1}),
    ],
)
def test_the_diagnosis_of_a_nasty_file(assets: Path, name: str, expected: dict[str, object]) -> None:
    assert facts(load_mesh(assets / "meshes_nasty" / name).diagnosis) == expected


@pytest.mark.parametrize(
    ("name", "repair", "volume"),
    [
        ("fandisk_inverted.obj", "flipped 1 closed part outwards", 20.244),
        ("sphere_inverted.obj", "flipped 1 closed part outwards", 4.047),
        ("multibody.stl", "flipped 6 of 32 faces to match their neighbors; flipped 2 closed parts outwards", None),
        ("openscad-nonmanifold-crash.obj", "flipped 1 of 1442 faces to match", 451.96),
        ("spider_binary.stl", "flipped 4 of 1368 faces to match", None),
    ],
)
def test_the_winding_of_a_nasty_file_is_mended_aloud(
    assets: Path, name: str, repair: str, volume: float | None
) -> None:
    with pytest.warns(tl.TranslucentWarning, match=re.escape(f"mesh {name!r}: {repair}")):
        mesh = load_mesh(assets / "meshes_nasty" / name)
    assert not mesh.diagnosis.mixed_edges
    assert not mesh.diagnosis.inverted
    if volume is not None:
        # Listed with four or five digits.
        assert mesh.volume == pytest.approx(volume, rel=2e-4)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("empty.stl", "the mesh has no faces"),
        ("points_bin.ply", "the mesh has no faces; use a mesh of triangles, not of points"),
        ("huge_Cray_right.obj", "a coordinate is 3.4e+38 m, beyond the limit of 1e+18 m"),
    ],
)
def test_a_nasty_file_that_cannot_be_used_is_refused(assets: Path, name: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load_mesh(assets / "meshes_nasty" / name)


def test_every_nasty_file_loads_or_is_refused_in_one_line(assets: Path) -> None:
    refused = {}
    for path in sorted((assets / "meshes_nasty").iterdir()):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", tl.TranslucentWarning)
            try:
                mesh = load_mesh(path)
            except tl.InputError as error:
                refused[path.name] = str(error)
                continue
        assert math.isfinite(mesh.volume), path.name
        assert np.isfinite(mesh.vertex_normals).all(), path.name
    assert sorted(refused) == ["empty.stl", "huge_Cray_right.obj", "points_bin.ply"]
    assert not any("\n" in message for message in refused.values())


def test_a_box_at_the_limit_of_float32_loads_with_its_unit(assets: Path) -> None:
    # 3.4e38 um would still be 3.4e32 m; nothing but a scale of the file helps, and nothing overflows on the way.
    with pytest.raises(tl.InputError, match=r"a coordinate is 3.4e\+32 m"):
        load_mesh(assets / "meshes_nasty" / "huge_Cray_right.obj", unit="um")
