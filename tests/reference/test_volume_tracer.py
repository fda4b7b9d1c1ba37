"""Rays in any direction: the same surfaces as the rays of pictures find."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere, SphericalShell, Torus
from translucent.media.medium import Medium
from translucent.reference import line_hits, pixel_rays
from translucent.reference.hits import BoxTree, Lines, SceneTracer
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

Array = npt.NDArray[np.float64]
TURN = np.array([[0.36, -0.48, 0.8, 0.1], [0.8, 0.6, 0.0, -0.2], [-0.48, 0.64, 0.6, 0.3], [0, 0, 0, 1]])
MIRROR = TURN @ np.diag([-0.7, 1.1, 1.6, 1.0])


def lines(origins: Array, directions: Array) -> Lines:
    everywhere = np.full(len(directions), np.inf)
    return Lines(np.broadcast_to(origins, directions.shape), directions, -everywhere, everywhere)


def random_lines(rng: np.random.Generator, count: int, through: Array | None = None) -> Lines:
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    target = 0.5 * rng.normal(size=(count, 3)) if through is None else through
    return lines(target - 3 * rng.random((count, 1)) * directions, directions)


@pytest.mark.parametrize("matrix", [np.eye(4), TURN, MIRROR], ids=["plain", "turned", "mirrored"])
@pytest.mark.parametrize("eye", [(2.0, 3.0, 2.5), (0.1, 0.05, 0.02)], ids=["outside", "inside"])
def test_the_rays_of_a_picture(matrix: Array, eye: tuple[float, ...]) -> None:
    camera = Camera.look_at(eye, (0.3, 0.2, -0.3), fov_y=90)
    for solid in (Torus(0.7, 0.2), SphericalShell(), Sphere()):
        mesh = solid.tessellate(24)
        expected = line_hits(mesh, matrix, camera, (31, 23))
        rays = pixel_rays(camera, (31, 23))
        (found,) = SceneTracer(Scene([Object(mesh, Medium(1.0), matrix)], camera)).hits(
            lines(rays.origins, rays.directions)
        )
        for name in ("pixel", "face", "sign"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        np.testing.assert_allclose(found.distance, expected.distance, atol=1e-13)


def test_every_ray_enters_as_often_as_it_leaves(rng: np.random.Generator) -> None:
    """Also through vertices and along edges, where the faces around them must agree."""
    mesh = Sphere().tessellate(12)
    scene = Scene([Object(mesh, Medium(1.0), TURN)], Camera.look_at((0.3, 0.2, 5.0), (0, 0, 0)))
    traced = SceneTracer(scene).objects[0]
    for target in (traced.corners[:, 0], 0.5 * (traced.corners[:, 0] + traced.corners[:, 1])):
        rays = random_lines(rng, len(target), target)
        hits = traced.hits(rays)
        assert (np.bincount(hits.pixel, hits.sign, len(rays)) == 0).all()
        assert len(np.unique(hits.pixel)) > 0.4 * len(rays)
    edge = traced.corners[:, 1] - traced.corners[:, 0]
    rays = lines(traced.corners[:, 0] - 0.1 * edge, edge / np.linalg.norm(edge, axis=1, keepdims=True))
    hits = traced.hits(rays)
    assert (np.bincount(hits.pixel, hits.sign, len(rays)) == 0).all()


def test_rays_along_the_axes_of_a_box() -> None:
    """In the planes of its faces, through its edges and corners: an even number of hits, and the chord between."""
    mesh = Box((0, 0, 0), (1, 1, 1)).tessellate()
    camera = Camera.look_at((0.0, 0.0, 0.0), (0, 0, -1))
    origin = np.array([[x, y, -1.0] for x in (0, 0.5, 1) for y in (0, 0.5, 1)])
    for axis in range(3):
        turned = np.roll(origin, axis + 1, axis=1)
        along = np.broadcast_to(np.roll([0.0, 0.0, 1.0], axis + 1), turned.shape)
        (hits,) = SceneTracer(Scene([Object(mesh, Medium(1.0))], camera)).hits(lines(turned, along))
        assert (np.bincount(hits.pixel, hits.sign, 9) == 0).all()
        assert set(np.bincount(hits.pixel, hits.sign * -hits.distance, 9)) <= {0.0, 1.0}
        assert np.bincount(hits.pixel, minlength=9)[4] == 2


def test_the_tree_loses_nothing(rng: np.random.Generator) -> None:
    corners = rng.normal(size=(1000, 1, 3)) + 0.05 * rng.normal(size=(1000, 3, 3))
    corners[::7] = corners[::7, :1]  # points
    rays = random_lines(rng, 50)
    centers = corners[:, 0]
    # A ray at a triangle's first corner meets its box, wherever it comes from.
    aimed = lines(centers - 2 * rays.directions[np.arange(1000) % 50], rays.directions[np.arange(1000) % 50])
    pairs = [pair for chunk in BoxTree.of(corners).candidates(aimed) for pair in zip(*chunk, strict=True)]
    assert {(i, i) for i in range(1000)} <= set(pairs)
    assert len(pairs) < 0.05 * 1000 * 1000
    assert len(set(pairs)) == len(pairs)


@pytest.mark.parametrize("count", [1, 8, 9, 65])
def test_trees_of_any_size(count: int, rng: np.random.Generator) -> None:
    corners = rng.random((count, 3, 3))
    tree = BoxTree.of(corners)
    assert sorted(tree.order) == list(range(count))
    rays = lines(np.repeat(corners.mean(axis=1), 2, axis=0) - [0, 0, 2], np.tile([0.0, 0.0, 1.0], (2 * count, 1)))
    pairs = {pair for chunk in tree.candidates(rays) for pair in zip(*chunk, strict=True)}
    assert {(2 * i + j, i) for i in range(count) for j in (0, 1)} <= pairs


def test_lines_end(rng: np.random.Generator) -> None:
    mesh = Sphere().tessellate(16)
    tracer = SceneTracer(Scene([Object(mesh, Medium(1.0))], Camera.look_at((0.0, 0.0, 5.0), (0, 0, 0))))
    rays = random_lines(rng, 300)
    rays = Lines(rays.origins + tracer.center, rays.directions, rays.start, rays.end)
    (whole,) = tracer.hits(rays)
    start, end = np.sort(3 * rng.normal(size=(2, 300)), axis=0)
    (part,) = tracer.hits(Lines(rays.origins, rays.directions, start, end))
    expected = whole.where((whole.distance >= start[whole.pixel]) & (whole.distance <= end[whole.pixel]))
    np.testing.assert_array_equal(part.pixel, expected.pixel)
    np.testing.assert_array_equal(part.distance, expected.distance)
    assert 0 < len(part.pixel) < len(whole.pixel)


def test_a_ball_holds_the_scene(rng: np.random.Generator) -> None:
    mesh = Torus().tessellate(16)
    tracer = SceneTracer(Scene([Object(mesh, Medium(1.0), TURN)], Camera.look_at((9.0, 2.0, 5.0), (0, 0, 0))))
    rays = random_lines(rng, 300)
    rays = Lines(rays.origins + tracer.center, rays.directions, rays.start, rays.end)
    enter, leave = tracer.ball(rays.origins, rays.directions)
    (hits,) = tracer.hits(rays)
    assert len(hits.pixel) > 50
    assert (hits.distance > enter[hits.pixel]).all()
    assert (hits.distance < leave[hits.pixel]).all()
    misses = np.linalg.norm(np.cross(rays.origins - tracer.center, rays.directions), axis=1) > tracer.radius
    assert (enter == leave)[misses].all()


def test_unwelded_corners_close_as_welded_ones(rng: np.random.Generator) -> None:
    welded = Sphere().tessellate(10)
    corners = welded.vertices[welded.faces].reshape(-1, 3)
    mesh = Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    traced = SceneTracer(
        Scene([Object(mesh, Medium(1.0), MIRROR)], Camera.look_at((0.3, 0.1, 5.0), (0, 0, 0)))
    ).objects[0]
    rays = random_lines(rng, len(corners), traced.corners.reshape(-1, 3))
    hits = traced.hits(rays)
    assert (np.bincount(hits.pixel, hits.sign, len(rays)) == 0).all()
