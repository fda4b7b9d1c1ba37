"""Densities inside bodies: values and means by closed forms, and refusals."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import translucent as tl
from translucent.geometry.solids import Box
from translucent.media.density import Density

EPS = float(np.finfo(np.float64).eps)
NAN = math.nan
MESH = Box((0, 0, 0), (1, 1, 1)).tessellate()
CAMERA = tl.Camera.look_at((0, 0, 5), (0, 0, 0))


def test_a_grid_has_its_samples_at_voxel_centers(rng: np.random.Generator) -> None:
    values = rng.random((3, 4, 5))
    centers = (np.stack(np.meshgrid(*map(np.arange, values.shape), indexing="ij"), axis=-1) + 0.5) / values.shape
    # A center is rounded by an ulp of up to 5 voxels.
    np.testing.assert_allclose(tl.DensityGrid(values).at(centers), values, atol=8 * EPS)


def test_a_grid_is_trilinear_between_centers_and_constant_beyond(rng: np.random.Generator) -> None:
    grid = tl.DensityGrid(rng.random((2, 2, 2)))
    corners = [
        grid.at(((0.25, 0.75)[i], (0.25, 0.75)[j], (0.25, 0.75)[k])) for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    assert grid.at((0.5, 0.5, 0.5)) == pytest.approx(np.mean(corners), rel=4 * EPS)
    assert grid.at((0.0, 0.25, 0.1)) == pytest.approx(corners[0], rel=4 * EPS)
    assert grid.at((1.0, 0.9, 0.8)) == pytest.approx(corners[7], rel=4 * EPS)
    assert grid.at((0.25, 0.25, 0.35)) == pytest.approx(0.8 * corners[0] + 0.2 * corners[1], rel=16 * EPS)


def test_one_voxel_is_a_constant(rng: np.random.Generator) -> None:
    grid = tl.DensityGrid([[[0.7]]])
    points = rng.random((20, 3))
    assert (grid.at(points) == 0.7).all()
    np.testing.assert_allclose(grid.mean_between(points, points[::-1]), 0.7, rtol=4 * EPS)
    assert grid.maximum == 0.7


def test_zeros_are_a_density() -> None:
    grid = tl.DensityGrid(np.zeros((2, 3, 4)))
    assert grid.at((0.3, 0.4, 0.5)) == 0
    assert grid.mean_between(np.zeros((1, 3)), np.ones((1, 3))) == 0


DENSITIES: dict[str, Density] = {
    "grid": tl.DensityGrid(np.random.default_rng(3).random((5, 1, 7))),
    "linear": tl.LinearDensity(1, 0.2, 3.0),
    "from zero": tl.LinearDensity(2, 0.0, 1.0),
    "rising": tl.ExponentialDensity(0, 0.1, 5.0),
    "falling": tl.ExponentialDensity(0, 5.0, 1e-3),
    "level": tl.ExponentialDensity(0, 2.0, 2.0),
}


@pytest.mark.parametrize("name", DENSITIES)
def test_the_mean_on_a_line_is_its_integral(name: str, rng: np.random.Generator) -> None:
    density = DENSITIES[name]
    start, end = rng.random((2, 6, 3))
    start[5] = end[5]
    for a, b, mean in zip(start, end, density.mean_between(start, end), strict=True):
        kinks = (
            [] if name != "grid" else np.unique([t for n, axis in ((5, 0), (7, 2)) for t in _cuts(a[axis], b[axis], n)])
        )
        parts = np.concatenate([[0.0], kinks, [1.0]])
        expected = sum(
            quad(lambda t, a=a, b=b: float(density.at(a + t * (b - a))), low, high, epsabs=1e-14)[0]
            for low, high in pairwise(parts)
        )
        assert mean == pytest.approx(expected, rel=1e-13)


def _cuts(a: float, b: float, voxels: int) -> list[float]:
    """Places on a line at which the coordinate from a to b passes the centers of voxels."""
    return [t for i in range(voxels) if a != b and 0 < (t := ((i + 0.5) / voxels - a) / (b - a)) < 1]


def test_many_lines_have_the_means_of_each(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    start, end = rng.random((2, 200, 3))
    whole = DENSITIES["grid"].mean_between(start, end)
    monkeypatch.setattr("translucent.media.density.CHUNK", 100)
    np.testing.assert_array_equal(DENSITIES["grid"].mean_between(start, end), whole)


def test_profiles_have_their_ends() -> None:
    for kind in (tl.LinearDensity, tl.ExponentialDensity):
        profile = kind(1, 0.5, 3.0)
        assert profile.at([(0, 0, 0), (0, 1, 0), (0, 1 + 1e-12, 0)]) == pytest.approx([0.5, 3.0, 3.0], rel=4 * EPS)
        assert profile.maximum == 3.0


def test_a_saved_array_is_loaded(tmp_path: Path, rng: np.random.Generator) -> None:
    values = rng.random((2, 3, 4)).astype(np.float32)
    np.save(tmp_path / "smoke.npy", values)
    np.testing.assert_array_equal(tl.DensityGrid.load(tmp_path / "smoke.npy").values, values)


def test_the_array_is_a_copy() -> None:
    values = np.ones((1, 1, 1))
    grid = tl.DensityGrid(values)
    values[0] = 5
    assert grid.maximum == 1
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(grid.values)[0] = 5


@pytest.mark.parametrize(
    ("values", "found"),
    [
        (np.zeros((0, 1, 1)), r"shape \(0, 1, 1\), and not \(nx, ny, nz\)"),
        (np.ones((2, 2)), r"shape \(2, 2\)"),
        (1.0, r"shape \(\)"),
        ("smoke", "does not contain numbers"),
        ([[[1.0, -1e-9]]], r"1 values are outside 0 to 1e\+12; the first is -1e-09 at \(0, 0, 1\)"),
        ([[[NAN]], [[NAN]]], r"2 values .* the first is nan at \(0, 0, 0\)"),
        ([[[math.inf]]], "the first is inf"),
    ],
)
def test_grids_that_cannot_be(values: Any, found: str) -> None:
    with pytest.raises(tl.InputError, match=f"^density grid.*{found}"):
        tl.DensityGrid(values)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"^density grid '.*no\.npy'; no file has this path; check the path"):
        tl.DensityGrid.load(tmp_path / "no.npy")
    (tmp_path / "text.npy").write_text("smoke")
    with pytest.raises(tl.InputError, match="not a NumPy array"):
        tl.DensityGrid.load(tmp_path / "text.npy")
    np.save(tmp_path / "object.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(tl.InputError, match="its values are of type 'object', and not numbers"):
        tl.DensityGrid.load(tmp_path / "object.npy")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tl.LinearDensity(3, 0, 1), "LinearDensity axis 3; the axis must be 0, 1 or 2"),
        (lambda: tl.LinearDensity(0, -1, 1), "LinearDensity start -1; the density must be at least 0"),
        (lambda: tl.LinearDensity(0, 1, NAN), "LinearDensity end nan"),
        (lambda: tl.ExponentialDensity(0, 0.0, 1), "ExponentialDensity start 0.0; the density must be above 0"),
        (lambda: tl.ExponentialDensity(0, 1, math.inf), "ExponentialDensity end inf"),
        (lambda: tl.Object(MESH, density=tl.LinearDensity(0, 0, 1)), "the object is opaque"),
        (
            lambda: tl.Object(MESH, tl.Medium(1.0), sheet_thickness=1e-3, density=tl.LinearDensity(0, 0, 1)),
            "a thin-walled sheet",
        ),
        (lambda: tl.Object(MESH, tl.Medium(1.0), density=np.ones((2, 2, 2))), "(?s)density of an object .* ndarray"),  # type: ignore[arg-type]
    ],
)
def test_refusals(make: Any, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        make()
