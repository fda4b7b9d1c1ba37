"""Losses of a map: right where the answer is known, and the same from every file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from translucent.bake.check import NO_BODY, RIGHT, THICK, THIN, check_map, first_uv, picture
from translucent.cli import main

SIZE = (96, 80)


@pytest.fixture
def slab() -> tl.Mesh:
    """A box of 2 x 2 x 0.5 m: u, v on its front are x, y; all other faces show one point."""
    box = trimesh.creation.box((2, 2, 0.5))
    corners = box.triangles.reshape(-1, 3)
    front = (np.repeat(box.face_normals[:, 2], 3) > 0.5)[:, None]
    uv = np.where(front, 0.5 + 0.5 * corners[:, :2], 0.5)
    return tl.Mesh(corners, np.arange(36).reshape(-1, 3), uv=uv, name="slab")


def facing(height: float = 1.6) -> tl.Camera:
    return tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=height)


def test_a_slab_seen_straight_on_loses_nothing(slab: tl.Mesh) -> None:
    medium = tl.Medium(absorption=(1, 2, 3))
    found = check_map(slab, np.full((8, 8), 0.5), medium, SIZE, facing())
    assert found.thickness.max < 1e-6
    assert found.transmittance.max < 1e-6
    assert found.mean_thickness == pytest.approx(0.5)
    np.testing.assert_allclose(found.baked.radiance, found.true.radiance, atol=1e-5)


def test_the_error_is_that_of_the_map(slab: tl.Mesh) -> None:
    medium = tl.Medium(absorption=2.0)
    found = check_map(slab, np.full((8, 8), 0.7), medium, SIZE, facing())
    assert found.thickness.rms == pytest.approx(0.2, rel=1e-5)
    assert found.thickness.bias == pytest.approx(0.2, rel=1e-5)
    assert found.transmittance.bias == pytest.approx(np.exp(-1.4) - np.exp(-1.0), rel=1e-5)
    assert "40 % of the mean 0.5 m" in str(found)
    json.dumps(found.summary(), allow_nan=False)


def test_a_slanted_view_is_longer_than_the_map_says(slab: tl.Mesh) -> None:
    """Through the faces, at 45 degrees, the way is sqrt(2) times the thickness along the normal."""
    camera = tl.Camera.orthographic((5, 0, 5), (0, 0, 0), height=0.2)
    found = check_map(slab, np.full((8, 8), 0.5), None, (16, 16), camera)
    np.testing.assert_allclose(found.true.thickness, 0.5 * np.sqrt(2), rtol=1e-5)
    assert found.thickness.bias == pytest.approx(0.5 - 0.5 * np.sqrt(2), rel=1e-5)


def test_the_map_is_read_at_the_first_surface_with_row_0_on_top(slab: tl.Mesh) -> None:
    """A map that is 1 at the top and 3 at the bottom, linear between, as seen from the front."""
    values = np.repeat(np.linspace(1, 3, 64)[:, None], 4, axis=1)
    found = check_map(slab, values, None, SIZE, facing(1.6))
    rows = found.baked.thickness[:, SIZE[0] // 2]
    y = 0.8 * (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2)
    # Row k of 64 has its center at v = 1 - (k + 0.5) / 64.
    row = (1 - (0.5 + 0.5 * y)) * 64 - 0.5
    np.testing.assert_allclose(rows, 1 + 2 * row / 63, rtol=1e-4)


def test_a_ball_of_known_thickness(make_ball: Callable[..., trimesh.Trimesh]) -> None:
    """A constant map of 2 on a ball of diameter 2: off by the chord's distance from it, over all pixels of the disk."""
    ball = make_ball(4)
    mesh = tl.Mesh(ball.vertices, ball.faces, uv=ball.visual.uv)
    camera = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2.1)
    found = check_map(mesh, np.full((4, 4), 2.0), None, (160, 160), camera)
    # Mean chord of a disk's pixels is 4/3: E[2 sqrt(1 - r^2)]; so the bias is 2/3, and the mean square error 2/3.
    assert found.mean_thickness == pytest.approx(4 / 3, rel=0.01)
    assert found.thickness.bias == pytest.approx(2 / 3, rel=0.02)
    assert found.thickness.rms**2 == pytest.approx(4 - 16 / 3 + 2, rel=0.02)


def test_first_uvs_are_exact_far_away(make_ball: Callable[..., trimesh.Trimesh]) -> None:
    ball = make_ball(2)
    mesh = tl.Mesh(ball.vertices, ball.faces, uv=ball.visual.uv)
    near = tl.Camera.orthographic((0, 0, 3), (0, 0, 0), height=2.1)
    far = tl.Camera.orthographic((0, 0, 3e4), (0, 0, 0), height=2.1)
    first, second = (first_uv(mesh, camera, (64, 64)) for camera in (near, far))
    both = np.isfinite(first).all(axis=-1) & np.isfinite(second).all(axis=-1)
    assert both.sum() > 2500
    assert np.quantile(np.abs(first[both] - second[both]), 0.99) < 1e-4
    with pytest.raises(tl.InputError, match="the mesh has no texture coordinates"):
        first_uv(tl.Mesh(ball.vertices, ball.faces), near, (8, 8))


def test_the_picture_shows_look_truth_and_difference(slab: tl.Mesh) -> None:
    thick = check_map(slab, np.full((8, 8), 0.7), None, SIZE, facing(3.0))
    thin = check_map(slab, np.full((8, 8), 0.3), None, SIZE, facing(3.0))
    exact = check_map(slab, np.full((8, 8), 0.5), None, SIZE, facing(3.0))
    shown = np.asarray(picture([thick, thin]))
    height = shown.shape[0] // 2
    assert shown.shape == (2 * height, 3 * SIZE[0], 3)
    middle = height - SIZE[1] // 2
    assert tuple(shown[middle, 2 * SIZE[0] + SIZE[0] // 2]) == THICK
    assert tuple(shown[height + middle, 2 * SIZE[0] + SIZE[0] // 2]) == THIN
    assert tuple(shown[height - 2, 2 * SIZE[0] + 2]) == NO_BODY
    # Thicker is darker; beside the body both looks are alike.
    baked, true = (int(shown[middle, x].sum()) for x in (SIZE[0] // 2, SIZE[0] + SIZE[0] // 2))
    assert baked < true
    assert tuple(shown[height - 2, 2]) == tuple(shown[height - 2, SIZE[0] + 2])
    right = np.asarray(picture([exact]))[middle, 2 * SIZE[0] + SIZE[0] // 2].astype(int)
    assert np.abs(right - RIGHT).max() > 0 or exact.thickness.p99 == 0 or exact.thickness.max < 1e-6


@pytest.mark.parametrize("suffix", ["npy", "glb"])
def test_the_command_line_checks_what_it_wrote(
    suffix: str, slab: tl.Mesh, tmp_path: Path, capsys: pytest.CaptureFixture[str], make_ball: Any
) -> None:
    make_ball(2, 0.01).export(tmp_path / "ball.obj")
    path = tmp_path / f"t.{suffix}"
    arguments = ["bake", str(tmp_path / "ball.obj"), "-o", str(path), "--size", "128", "--rays", "16", "--check"]
    assert main([*arguments, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["check"].values()
    with Image.open(f"{path}.check.png") as image:
        assert image.width == 3 * 128
    # The mean over the cosine-weighted hemisphere of a ball is 4/3 of the radius, as is the mean chord of its disk.
    assert found["mean_thickness"] == pytest.approx(4 / 3 * 0.01, rel=0.03)
    assert abs(found["thickness"]["bias"]) < 0.05 * 0.01
    # E[(chord - 4/3)^2] = 2 - 16/9.
    assert found["thickness"]["rms"] == pytest.approx(0.01 * np.sqrt(2 - 16 / 9), rel=0.1)
    if suffix == "glb":
        return
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "thickness      rms" in told
    assert f"{path}.check.png: with the map, true, difference" in told


def test_a_gltf_file_is_checked_in_metres_and_in_its_own_medium(
    ball_glb: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A ball of radius 1 whose unit is mm, in a medium that lets exp(-1) pass after 1 in that unit."""
    source, path = tmp_path / "wine.glb", tmp_path / "t.glb"
    color = f"linear({np.exp(-1)},{np.exp(-1)},{np.exp(-1)})"
    assert main(["material", "apply", str(ball_glb), "--color", color, "--distance", "1m", "-o", str(source)]) == 0
    capsys.readouterr()
    options = ["--size", "128", "--rays", "16", "--unit", "mm", "--check", "--json"]
    assert main(["bake", str(source), "-o", str(path), *options]) == 0
    (found,) = json.loads(capsys.readouterr().out)["check"].values()
    assert found["mean_thickness"] == pytest.approx(4 / 3 * 1e-3, rel=0.03)
    assert abs(found["thickness"]["bias"]) < 0.05 * 1e-3
    # With t = 2 s, s^2 uniform: the mean of exp(-2 s) is (1 - 3 exp(-2)) / 2; with the mean t everywhere exp(-4 / 3).
    expected = np.exp(-4 / 3) - (1 - 3 * np.exp(-2)) / 2
    assert found["transmittance"]["bias"] == pytest.approx(expected, abs=0.012)
