"""Every mode against closed forms, as whole bakes."""

from __future__ import annotations

from functools import cache
from math import cos, exp, log, pi, radians, sin

import numpy as np
import pytest

import translucent as tl
from tests.solids import Box, Sphere, Torus
from translucent.assets import mesh_path

RADIUS, SEGMENTS = 0.03, 96
SPHERE, TORUS = Sphere(radius=RADIUS), Torus(0.1, 0.02)
#: Chords of the mesh and of the sphere differ by the sagitta at both ends, and where rays are nearly tangent by the
#: part of a facet that they cut: together less than this share of the radius, in the mean over a cone.
FACETS = 4.0 * SPHERE.sagitta(SEGMENTS)
#: A facet that is nearer by s, at the angle phi from the point, makes the ball smaller by s / (1 - cos phi), and phi is
#: at least the crease angle; the point itself is nearer by up to s.
INSCRIBED = 2.0 * SPHERE.sagitta(SEGMENTS) * (1.0 + 1.0 / (1.0 - cos(radians(40.0))))
MEDIUM = tl.Medium(absorption=(40.0, 40.0, 40.0))


@cache
def ball() -> tl.Mesh:
    """`SPHERE` with texture coordinates, as a bake makes them."""
    return tl.bake_thickness(SPHERE.tessellate(SEGMENTS), 32, mode="normal").mesh


@cache
def ring() -> tl.Mesh:
    """`TORUS` with texture coordinates."""
    return tl.bake_thickness(TORUS.tessellate(SEGMENTS), 32, mode="normal").mesh


def covered(baked: tl.ThicknessMap) -> tuple[np.ndarray, np.ndarray]:
    return baked.values[baked.coverage].astype(float), baked.standard_error[baked.coverage].astype(float)


def gray_mean(tau: float) -> float:
    """-log(E[exp(-tau mu)]) for cosine-weighted mu."""
    return -log(2.0 * (1.0 - (1.0 + tau) * exp(-tau)) / tau**2)


SPHERE_TRUTHS = [
    ({"mode": "cone"}, 4 / 3 * RADIUS),
    ({"mode": "cone", "weighting": "uniform"}, RADIUS),
    ({"mode": "cone", "gaps": "total"}, 4 / 3 * RADIUS),
    ({"mode": "cone", "spread": 90.0}, 2 * RADIUS * (1 - cos(pi / 4) ** 3) * 2 / 3 / sin(pi / 4) ** 2),
    ({"mode": "cone", "spread": 90.0, "weighting": "uniform"}, RADIUS * (1 + cos(pi / 4))),
    ({"mode": "cone", "max_distance": RADIUS}, RADIUS * (0.75 + 2 / 3 * 0.125 * 2)),
    ({"mode": "transmittance", "medium": MEDIUM}, gray_mean(80 * RADIUS) / 40),
    ({"mode": "local", "max_distance": RADIUS}, 0.75),
    ({"mode": "normal"}, 2 * RADIUS),
    ({"mode": "inscribed"}, 2 * RADIUS),
]


@pytest.mark.parametrize(("asked", "truth"), SPHERE_TRUTHS, ids=lambda value: str(value)[:50])
def test_a_sphere(asked: dict, truth: float) -> None:
    values, errors = covered(tl.bake_thickness(ball(), 32, **asked))
    facets = {"local": 4.0 * FACETS / RADIUS, "inscribed": INSCRIBED}.get(asked["mode"], FACETS)
    assert (np.abs(values - truth) <= 3.0 * errors + facets).all()
    # The bias of all texels together is the mesh's alone.
    assert abs(values.mean() - truth) <= facets + 4.0 * values.std() / np.sqrt(len(values))
    assert (errors == 0).all() == (asked["mode"] in ("normal", "inscribed"))


def test_the_transmittance_of_a_colored_medium() -> None:
    medium = tl.Medium(absorption=(5.0, 40.0, 200.0))
    values, errors = covered(tl.bake_thickness(ball(), 48, mode="transmittance", medium=medium))
    weights, sigma = np.array([0.2126, 0.7152, 0.0722]), medium.extinction
    tau = 2 * RADIUS * sigma
    bright = (weights * 2 * (1 - (1 + tau) * np.exp(-tau)) / tau**2).sum()
    low, high = 0.0, 2 * RADIUS
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (weights * np.exp(-sigma * middle)).sum() > bright else (low, middle)
    assert (np.abs(values - low) <= 3.0 * errors + FACETS).all()


def test_a_transmittance_that_underflows() -> None:
    """Nothing comes out of a narrow cone through 0.06 m at 1e6 / m, but the thickness is there all the same."""
    dense = tl.Medium(absorption=(1e6, 1e6, 2e6))
    values, _ = covered(tl.bake_thickness(ball(), 24, mode="transmittance", spread=20.0, medium=dense))
    assert (values > 2 * RADIUS * cos(radians(10)) - FACETS).all()
    assert (values <= 2 * RADIUS).all()


def test_the_normal_mode_of_a_box_is_exact() -> None:
    sides = (0.1, 0.2, 0.4)
    baked = tl.bake_thickness(Box((0, 0, 0), sides).tessellate(), 96, mode="normal")
    unwrapped = baked.mesh
    values, _ = covered(baked)
    assert unwrapped.uv is not None
    nearest = np.array(sides)[np.abs(values[:, None] - sides).argmin(axis=1)]
    assert (np.abs(values - nearest) <= 1e-5 * nearest).all()
    # Each side of the box shows the length across it.
    assert {float(side) for side in nearest} == set(sides)


SLAB = [
    ("cosine", 2 * (1 - cos(pi / 6)) / sin(pi / 6) ** 2),
    ("uniform", -log(cos(pi / 6)) / (1 - cos(pi / 6))),
]


@pytest.mark.parametrize(("weighting", "share"), SLAB)
def test_a_slab(weighting: str, share: float) -> None:
    thick = 1e-3
    slab = Box((0, 0, 0), (0.2, 0.2, thick)).tessellate()
    values, errors = covered(tl.bake_thickness(slab, 64, spread=60.0, weighting=weighting))
    # Beside an edge rays leave through it; the middle of the values is far from any.
    order = values.argsort()[len(values) // 4 : -len(values) // 4]
    assert (np.abs(values[order] - share * thick) <= 3 * errors[order] + 1e-6 * thick).all()


def test_a_slab_of_a_hundred_thousandth() -> None:
    slab = Box((0, 0, 0), (1.0, 1.0, 1e-5)).tessellate()
    values, _ = covered(tl.bake_thickness(slab, 64, mode="normal"))
    assert np.isclose(np.median(values), 1e-5, rtol=1e-5, atol=0)


def test_the_middle_of_a_box_against_quadrature() -> None:
    """The mean over the hemisphere at the middle of a side: the exact chord, summed over 400 x 400 directions."""
    box = Box((0, 0, 0), (0.1, 0.2, 0.4))
    grid = (np.arange(400) + 0.5) / 400
    square, turn = (axis.ravel() for axis in np.meshgrid(grid, 2 * np.pi * grid))
    sine, cosine = np.sqrt(square), np.sqrt(1 - square)
    directions = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=1)
    truth = box.chord((0.05, 0.1, 0.0), directions).mean()
    solid = box.tessellate()
    corners = solid.vertices[solid.faces]
    bottom = (corners[..., 2] == 0).all(axis=1)
    # Of all faces only the bottom lies in the first tile, and fills it.
    uv = np.where(bottom[:, None, None], corners[..., :2] / (0.1, 0.2), corners[..., :2] / (0.1, 0.2) + (1, 0))
    mesh = tl.Mesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3), uv.reshape(-1, 2))
    baked = tl.bake_thickness(mesh, 5, tile=1001, rays=1024)
    assert abs(baked.values[2, 2] - truth) <= 3 * baked.standard_error[2, 2] + 1e-6 * truth


@pytest.mark.parametrize("mode", ["normal", "inscribed"])
def test_the_tube_of_a_torus(mode: str) -> None:
    values, _ = covered(tl.bake_thickness(ring(), 32, mode=mode))
    assert (np.abs(values - 0.04) <= 6 * TORUS.sagitta(SEGMENTS)).all()


def test_gaps_of_a_torus_against_its_exact_chords() -> None:
    """First exit stops in the tube; the total goes on through the other side."""
    mesh = TORUS.tessellate(64)
    first = tl.bake_vertex_thickness(mesh, spread=60.0)
    total = tl.bake_vertex_thickness(mesh, spread=60.0, gaps="total")
    inner = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).argmax()
    assert total.values[inner] > 1.1 * first.values[inner]
    grid = (np.arange(100) + 0.5) / 100
    square, turn = (axis.ravel() for axis in np.meshgrid(np.sin(radians(30)) ** 2 * grid, 2 * np.pi * grid))
    sine, cosine = np.sqrt(square), np.sqrt(1 - square)
    inward = -mesh.vertices[inner] / np.linalg.norm(mesh.vertices[inner])
    up = np.array([0.0, 0.0, 1.0])
    directions = (
        np.outer(cosine, inward)
        + np.outer(sine * np.cos(turn), up)
        + np.outer(sine * np.sin(turn), np.cross(up, inward))
    )
    truth = TORUS.chord(mesh.vertices[inner], directions).mean()
    assert abs(total.values[inner] - truth) <= 3 * total.standard_error[inner] + 20 * TORUS.sagitta(64)


def test_overlapping_parts() -> None:
    """A ball whose lower half is inside another: rays stop at the other's skin, pass it, or see one body."""
    one, other = Sphere(radius=1.0).tessellate(48), Sphere(center=(0.0, 0.0, 1.2), radius=1.0).tessellate(48)
    both = tl.Mesh(
        np.concatenate([one.vertices, other.vertices]), np.concatenate([one.faces, other.faces + len(one.vertices)])
    )
    south = one.vertices[:, 2].argmin()
    found = {
        name: tl.bake_vertex_thickness(both, "normal", **asked).values[south]
        for name, asked in {"stop": {}, "pass": {"ignore_back_faces": True}, "total": {"gaps": "total"}}.items()
    }
    assert np.isclose(found["stop"], 1.2, atol=0.02)
    assert np.isclose(found["pass"], 2.0, atol=0.02)
    assert np.isclose(found["total"], 3.2, atol=0.02)


def test_a_cavity_ends_the_first_length_and_not_the_total() -> None:
    shell = tl.load_mesh(mesh_path("shell"))
    outer = np.linalg.norm(shell.vertices - shell.center, axis=1) > 0.023
    first = tl.bake_vertex_thickness(shell, "normal").values[outer]
    total = tl.bake_vertex_thickness(shell, "normal", gaps="total").values[outer]
    assert np.allclose(first, 0.004, rtol=0.02)
    assert np.allclose(total, 0.008, rtol=0.02)
    assert np.allclose(
        tl.bake_vertex_thickness(shell, "normal", gaps="total", max_distance=0.03).values[outer], 0.004, rtol=0.02
    )


def test_along_the_normal_one_ray_is_enough() -> None:
    mesh = Sphere(radius=0.03).tessellate(24)
    one, many = (tl.bake_thickness(mesh, 16, mode="normal", rays=rays) for rays in (1, 64))
    np.testing.assert_array_equal(one.values, many.values)
    assert one.report.rays == many.report.rays
    vertices = [tl.bake_vertex_thickness(mesh, mode="normal", rays=rays).values for rays in (1, 64)]
    np.testing.assert_array_equal(*vertices)
    with pytest.raises(tl.InputError, match="rays 1; not a whole number in 2"):
        tl.bake_thickness(mesh, 16, rays=1)
