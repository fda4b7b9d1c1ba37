"""The extension in Blender itself, headless: what it bakes, writes, refuses, and leaves as it was."""

from __future__ import annotations

import importlib
import json
import os
import runpy
import subprocess
import sys
import tomllib
import zipfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from translucent.assets import mesh_path
from translucent.bake.atlas import unwrap
from translucent.geometry.normals import corner_normals
from translucent.materials.blender import absorption_node, principled_node
from translucent.version import VERSION

ROOT = Path(__file__).parents[2]
TOOL = runpy.run_path(str(ROOT / "tools" / "measure_blender.py"))

#: Sides of a box in metres, which is the thickness along the normals of its faces, and the axis of each face.
SIDES, AXES = np.array([0.02, 0.03, 0.04]), (0, 0, 1, 1, 2, 2)

#: Corners of its quads, counter-clockwise from outside; corners are numbered by x, y and z as bits.
QUADS = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])

#: Lower left and size of the UVs of each face: tiles 1001 and 1002, and the half of a tile where two share one.
PLACES = ((0, 0, 0.5, 1), (0.5, 0, 0.5, 1), (1, 0, 1, 1), (0, 0, 1, 1), (1, 0, 0.5, 1), (1.5, 0, 0.5, 1))
SLOTS = (0, 0, 0, 1, 1, 1)


def box(sides: np.ndarray) -> np.ndarray:
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.asarray((bits - 0.5) * sides)


def face_uv(place: tuple[float, ...]) -> np.ndarray:
    u, v, width, height = place
    return np.array([[u, v], [u + width, v], [u + width, v + height], [u, v + height]])


def chords(mesh: tl.Mesh, size: int, count: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Some texels of a map whose centers lie in one face, and the lengths from there to the exit along the smooth
    normal: the nearest of all faces, in float64, by Moeller and Trumbore's formula.
    """
    assert mesh.uv is not None
    uv, corners, normals = mesh.uv[mesh.faces], mesh.vertices[mesh.faces], corner_normals(mesh)
    texels, lengths = [], []
    for texel in np.random.default_rng(0).permutation(size * size):
        row, column = divmod(int(texel), size)
        center = np.array([(column + 0.5) / size, 1.0 - (row + 0.5) / size])
        a, b, c = uv.transpose(1, 0, 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            area = cross(b - a, c - a)
            weights = np.column_stack([cross(b - center, c - center), cross(c - center, a - center)]) / area[:, None]
        weights = np.column_stack([weights, 1.0 - weights.sum(axis=1)])
        inside = np.flatnonzero((weights > 0.01).all(axis=1))
        if len(inside) != 1:
            continue
        (face,) = inside
        point, normal = weights[face] @ corners[face], weights[face] @ normals[face]
        direction = -normal / np.linalg.norm(normal)
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        p, away = np.cross(direction, two), point - corners[:, 0]
        q, determinant = np.cross(away, one), (one * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v, length = (
                (away * p).sum(1) / determinant,
                q @ direction / determinant,
                (two * q).sum(1) / determinant,
            )
            ahead = (u >= 0) & (v >= 0) & (u + v <= 1) & (length > 1e-9) & (np.arange(len(uv)) != face)
        texels.append(int(texel))
        lengths.append(length[ahead].min())
        if len(texels) == count:
            break
    return np.array(texels), np.array(lengths)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


@dataclass(frozen=True)
class Done:
    """Results that the driver wrote."""

    result: dict[str, Any]
    arrays: dict[str, np.ndarray]
    bear: tl.Mesh
    welded: tl.Mesh


@pytest.fixture(scope="session")
def tool() -> ModuleType:
    """The tool that builds the extension; it imports others that lie beside it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools"))
        return importlib.import_module("build_blender")


@pytest.fixture(scope="session")
def archive(tool: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension without wheels."""
    path = tmp_path_factory.mktemp("extension") / "translucent.zip"
    tool.write_zip(path, {**tool.common_files(), "blender_manifest.toml": tool.manifest()})
    return path


@pytest.fixture(scope="session")
def python() -> str:
    """A Python that has Blender's module."""
    command = TOOL["blender_command"]()
    if command is None or "--background" in command:
        pytest.skip(TOOL["ABSENT"])
    return str(command[0])


@pytest.fixture(scope="session")
def done(python: str, archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Done:
    """The steps of the driver, in one Blender."""
    folder = tmp_path_factory.mktemp("blender")
    welded = tl.load_mesh(mesh_path("bear"))
    made = unwrap(welded, 64, None)
    assert made.mesh.uv is not None
    vertices, uv = welded.vertices.astype(np.float32), made.mesh.uv.astype(np.float32)
    bear = tl.Mesh(vertices[made.vertex], made.mesh.faces, uv=uv, name="bear")
    cube, squares = box(np.full(3, 0.02)), np.array([face_uv((i % 3 / 3, i // 3 / 2, 0.3, 0.45)) for i in range(6)])
    triangles = QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    meshes = {
        "bear_vertices": vertices,
        "bear_faces": made.vertex[bear.faces],
        "bear_uv": uv[bear.faces],
        "box_vertices": box(SIDES),
        "box_faces": QUADS,
        "box_uv": np.array([face_uv(place) for place in PLACES]),
        "box_slots": np.array(SLOTS, dtype=np.int32),
        "cube_vertices": cube,
        "cube_faces": QUADS,
        "cube_uv": squares,
        "bare_vertices": cube,
        "bare_faces": triangles,
        "beyond_vertices": cube,
        "beyond_faces": QUADS,
        "beyond_uv": squares - 2.0,
        "inverted_vertices": cube,
        "inverted_faces": QUADS[:, ::-1],
        "inverted_uv": squares,
    }
    np.savez(folder / "meshes.npz", **meshes)
    (folder / "translucent.zip").write_bytes(archive.read_bytes())
    environment = {**os.environ, "TRANSLUCENT_PYTHON": sys.executable, "PYTHONPATH": str(ROOT)}
    command = [python, str(Path(__file__).with_name("blender_driver.py")), str(folder)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    with np.load(folder / "arrays.npz") as arrays:
        return Done(
            json.loads((folder / "result.json").read_text()),
            dict(arrays),
            bear,
            tl.Mesh(vertices, made.vertex[bear.faces]),
        )


# The archive


def test_the_archive_has_this_version_and_all_presets_with_pictures(archive: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        assert f'version = "{VERSION}"' in files.read("blender_manifest.toml").decode()
        assert [one["name"] for one in json.loads(files.read("presets.json"))] == list(tl.presets())
        pictures = {Path(name).stem for name in files.namelist() if name.startswith("pictures/")}
        assert set(tl.presets()) - pictures == {"cloud", "fog"}
        assert "worker.py" in files.namelist()
        assert not [name for name in files.namelist() if name.endswith(".txt")]


def test_equal_contents_are_equal_archives(tool: ModuleType, archive: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        contents = {name: files.read(name) for name in reversed(files.namelist())}
    tool.write_zip(tmp_path / "again.zip", contents)
    assert (tmp_path / "again.zip").read_bytes() == archive.read_bytes()


def test_a_build_with_wheels_names_them_and_their_blender(tool: ModuleType) -> None:
    found = tomllib.loads(tool.manifest("linux-x64", ("a.whl", "b.whl")).decode())
    assert found["wheels"] == ["./wheels/a.whl", "./wheels/b.whl"]
    assert found["platforms"] == ["linux-x64"]
    assert found["blender_version_max"] == "5.1.0"
    listed = (ROOT / "integrations" / "blender" / "wheels.txt").read_text()
    names = {line.split("==")[0] for line in listed.splitlines() if "==" in line}
    assert names >= {"numpy", "scipy", "trimesh", "embreex", "pillow", "click", "charset-normalizer"}


def test_blenders_own_command_validates_it(tool: ModuleType, archive: Path, python: str) -> None:
    tool.validate(archive, python)


# Bakes


def test_an_image_is_what_the_command_bakes(done: Done, run: Run, tmp_path: Path) -> None:
    assert done.result["bear"][2:] == ["Non-Color", "1"]
    assert done.bear.uv is not None
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in done.bear.vertices.tolist()]
    lines += [f"vt {u!r} {v!r}" for u, v in done.bear.uv.tolist()]
    lines += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in (done.bear.faces + 1).tolist()]
    (tmp_path / "bear.obj").write_text("\n".join(lines))
    baked = run("bake", tmp_path / "bear.obj", "-o", tmp_path / "bear.npy", "--size", "64", "--rays", "8")
    assert baked.code == 0, baked.err
    expected = np.load(tmp_path / "bear.npy")
    np.testing.assert_allclose(done.arrays["bear"], expected, rtol=1e-5, atol=1e-5 * expected.max())


def test_lengths_are_metres_at_every_unit_and_scale(done: Done) -> None:
    """Along normals, against float64: the scene is in centimetres, and the object mirrored and twice as large."""
    assert done.result["bear_in_centimetres"] == "Stuff thickness"
    mirrored = tl.Mesh(done.bear.vertices * (-1, 1, 1), done.bear.faces[:, ::-1], uv=done.bear.uv)
    baked = tl.bake_thickness(mirrored, size=64, mode="normal")
    assert (done.arrays["bear_normal"] > 0).tolist() == (baked.values > 0).tolist()
    shown, truth = chords(mirrored, 64)
    assert len(truth) > 50
    values = done.arrays["bear_normal"].ravel()[shown]
    np.testing.assert_allclose(values, baked.values.ravel()[shown], rtol=1e-3)
    np.testing.assert_allclose(values, truth, rtol=1e-2)


def test_the_attribute_is_what_the_toolkit_bakes(done: Done) -> None:
    assert done.result["bear"][:2] == ["POINT", "FLOAT"]
    expected = tl.bake_vertex_thickness(done.welded, rays=4).values
    np.testing.assert_allclose(done.arrays["bear_vertices"], expected, rtol=1e-5)


def test_two_materials_have_two_images_of_two_tiles(done: Done) -> None:
    assert done.result["box_of_two"] == [1001, 1002, 1001, 1002]
    for slot, name in enumerate(("Red", "Blue")):
        for tile, start in ((1001, 0), (1002, 1)):
            expected = np.zeros((32, 32))
            for place, axis, own in zip(PLACES, AXES, SLOTS, strict=True):
                if own == slot and start <= place[0] < start + 1:
                    left = round(32 * (place[0] - start))
                    expected[:, left : left + round(32 * place[2])] = SIDES[axis]
            np.testing.assert_allclose(done.arrays[f"{name}_{tile}"], expected, rtol=1e-6)


def test_what_blender_makes_of_an_object_is_baked(done: Done) -> None:
    assert done.result["modifiers_count"] == pytest.approx(0.04, rel=1e-6)
    assert done.result["quads_and_polygons_are_triangulated"] == pytest.approx(0.03, rel=1e-6)
    assert done.result["tiles_are_still_there_after_loading"] == ["TILED", 2, pytest.approx(SIDES[1], rel=1e-6)]
    assert done.result["a_second_bake_replaces_the_first"] == ["Stuff thickness"]
    assert done.result["undone"] == [True, True]
    assert any("no units" in text and "one metre" in text for text in done.result["without_units"])


# Errors


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nothing", "Select objects in Object Mode"),
        ("lamp", "No object with a surface is selected"),
        ("instances", "Make Instances Real"),
        ("flat", "'cube' is flat: its scale is 0 along an axis"),
        ("no uv", "'bare' has no UV map. Unwrap it, or bake to a vertex attribute"),
        ("beyond", "12 triangles of 'beyond' lie outside of all UDIM tiles"),
        ("inside out", "object 'inverted'; its faces look inwards; use Mesh > Normals > Recalculate Outside"),
        ("subdivided", "Modifiers of 'cube' make 26 vertices of 8. Apply them"),
        ("shared", "share a mesh, and are not of the same size or shape"),
        ("typed", "'cube' has an attribute 'thickness' of another type"),
        ("edited", "Object Mode"),
        ("no python", "There is no Python at /nowhere/python"),
        ("no toolkit", "The translucent toolkit was not found in"),
    ],
)
def test_an_error_is_a_sentence_and_changes_nothing(done: Done, name: str, sentence: str) -> None:
    text, unchanged = done.result["errors"][name]
    assert sentence in text
    assert "Traceback" not in text
    assert unchanged


def test_a_window_shows_progress_and_a_cancel_changes_nothing(done: Done) -> None:
    begun, passed, answer, percent, last, there = done.result["in_a_window"]
    assert (begun, passed, answer, there) == (["RUNNING_MODAL"], ["PASS_THROUGH"], ["FINISHED"], True)
    assert 0.0 <= percent <= 100.0
    assert "Image 'Stuff thickness'" in last
    running, answer, ended, folder, unchanged, last = done.result["cancelled"]
    assert (running, answer, ended, folder, unchanged) == (True, ["CANCELLED"], True, False, True)
    assert last == "Baking thickness was cancelled; nothing has changed"


def test_the_panel_hands_its_settings_to_both_bakes(done: Done) -> None:
    material, *settings, images, vertices, check = done.result["panel"]
    assert [material["name"], check["name"]] == ["translucent.material", "translucent.check_materials"]
    expected = {"mode": "cone", "size": 32, "padding": 16, "rays": 64, "attribute": "thickness"}
    assert dict(settings) == expected
    for button, target in ((images, "IMAGE"), (vertices, "ATTRIBUTE")):
        assert button == {"name": "translucent.bake_thickness", "target": target, **expected}


# Materials


def test_media_are_per_unit_of_the_scene(done: Done) -> None:
    name, shared, density = done.result["presets"]
    assert (name, shared) == ("jade", True)
    assert density == pytest.approx(0.01 * principled_node(tl.preset("jade").medium)[2], rel=1e-6)
    sigma, ior = done.result["color_at_a_distance"]
    color, most = absorption_node(tl.Medium.from_color((0.5, 0.25, 0.125), 0.02))
    assert sigma == pytest.approx(0.01 * most * (1 - color), rel=1e-4)
    assert ior == pytest.approx(1.4)


def test_the_check_is_a_text_of_the_file(done: Done) -> None:
    empty, nothing, checked, text = done.result["checked"]
    assert (empty, checked) == (["FINISHED"], ["FINISHED"])
    assert "transmits" in nothing
    assert "thickness" in text
    assert "    do: " in text


def test_nothing_is_left_behind(done: Done) -> None:
    assert done.result["left"] == ["0"]


def test_what_an_export_leaves_out_is_named(done: Done) -> None:
    """The material that the extension itself makes has a Glass BSDF, which glTF has no word for."""
    answer, text = done.result["nodes_that_an_export_leaves_out"]
    assert answer == ["FINISHED"]
    assert "warning lost: material 'translucent'" in text
    assert "glTF has no Glass BSDF: an export leaves it out, and so it is not checked" in text
