"""Support of meshes of many vertices, against all of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import translucent as tl
from translucent.geometry.solids import Box, Sphere
from translucent.geometry.support import Support, largest_of
from translucent.scene import stages
from translucent.scene.showcase import framing
from translucent.scene.stages import ground_mesh, stage_named

MEDIUM = tl.Medium(absorption=(1, 2, 3))

MATRIX = np.array([[0.3, -1.1, 0.2, 4.0], [0.9, 0.4, 0.0, -2.0], [0.1, 0.2, -0.7, 1.0], [0, 0, 0, 1]])


def dented(count: int = 200) -> tl.Mesh:
    ball = Sphere().tessellate(count)
    x, y, z = 4.0 * ball.vertices.T
    return tl.Mesh(ball.vertices * (1 + 0.15 * np.sin(5 * x) * np.cos(4 * y) * np.sin(3 * z))[:, None], ball.faces)


def flat() -> tl.Mesh:
    return tl.Mesh(dented().vertices * (1, 1, 0), dented().faces)


@pytest.mark.parametrize(
    "mesh", [dented(), flat(), Box((-1, -1, -1), (1, 1, 1)).tessellate()], ids=lambda mesh: mesh.name
)
def test_supports_are_those_of_all_vertices(mesh: tl.Mesh) -> None:
    support, points = Support(mesh, MATRIX), mesh.vertices @ MATRIX[:3, :3].T + MATRIX[:3, 3]
    assert support.many == (len(mesh.vertices) > 100)
    directions = np.random.default_rng(5).normal(size=(3, 40))
    for each in (directions, directions[:, :1]):
        np.testing.assert_allclose(
            support.largest(lambda p, each=each: p @ each), (points @ each).max(axis=0), rtol=1e-13
        )
    np.testing.assert_allclose(support.bounds, [points.min(axis=0), points.max(axis=0)], rtol=1e-13)


def test_projections_are_those_of_all_vertices() -> None:
    """Tangents of angles off an axis, before the eye, and infinite ones of what is beside it or behind."""
    mesh = dented()
    support, points = Support(mesh, np.eye(4)), mesh.vertices

    for eye in ((0.0, 0.0, 1.3), (0.0, 0.0, 9.0), (0.0, 0.3, 0.9)):

        def tangents(given: Any, eye: Any = eye) -> Any:
            seen = given - np.asarray(eye)
            ahead = -seen[:, 2]
            return np.divide(np.abs(seen[:, 0]), ahead, out=np.full(len(seen), np.inf), where=ahead > 1e-9)[:, None]

        expected = tangents(points).max(axis=0)
        np.testing.assert_allclose(support.largest(tangents), expected, rtol=1e-13)
        assert np.isinf(expected[0]) == (eye[2] < 1)


def test_few_vertices_are_looked_at() -> None:
    looked_at = 0

    def along(points: Any) -> Any:
        nonlocal looked_at
        looked_at += len(points)
        return points[:, :1]

    mesh = dented(400)
    largest_of([Support(mesh, np.eye(4)), Support(Box((-3, 0, 0), (-2, 1, 1)).tessellate(), np.eye(4))], along)
    assert looked_at < 0.1 * len(mesh.vertices)


def test_large_meshes_are_framed_as_by_all_of_their_vertices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cameras and grounds, with and without shadows; vertices that no face uses are seen by neither."""
    mesh, stage = tl.Mesh(dented().vertices * (1, 3, 1), dented().faces), stage_named("studio")  # with a long shadow
    stray = tl.Mesh(np.concatenate([mesh.vertices, [(0.0, 50.0, 0.0)]]), mesh.faces)
    placed = [tl.Object(each, MEDIUM) for each in (mesh, stray)]
    few = [tl.Object(Box((-1, -1, -1), (1, 1, 1)).tessellate(), MEDIUM)]
    for objects in (placed[:1], placed[1:], [*placed, *few]):
        made = []
        for large in (1 << 30, 0):
            monkeypatch.setattr(stages, "LARGE", large)
            cameras = [framing(objects, (16, 9), up=(0.1, 1, 0)), framing(objects, (9, 16), stage=stage)]
            ground = ground_mesh(tl.Scene(objects, cameras[1]), np.eye(3))
            made.append([cameras[0].pose, cameras[1].pose, ground.vertices])
        for one, other in zip(*made, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13)


def test_farthest_vertices_are_one_for_each_direction() -> None:
    support, points = Support(dented(), MATRIX), dented().vertices @ MATRIX[:3, :3].T + MATRIX[:3, 3]
    directions = np.random.default_rng(6).normal(size=(40, 3))
    found = support.farthest(directions)
    np.testing.assert_allclose((found * directions).sum(axis=1), (points @ directions.T).max(axis=0), rtol=1e-13)
