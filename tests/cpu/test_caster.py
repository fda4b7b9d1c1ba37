"""Nearest surfaces on any rays: those of the reference, and never a ray that does not leave a closed body."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from translucent.arrays import Array
from translucent.assets import mesh_path
from translucent.cpu.hits import ExactRayCaster
from translucent.geometry.solids import Box, Sphere
from translucent.reference.hits import Lines, SceneTracer

GLASS = tl.Medium(ior=1.5)


def body(mesh: tl.Mesh, x: float = 0.0) -> tl.Object:
    matrix = np.eye(4)
    matrix[0, 3] = x
    return tl.Object(mesh, GLASS, matrix)


def caster_of(*objects: tl.Object) -> ExactRayCaster:
    return ExactRayCaster(objects)


def unit_vectors(count: int, rng: np.random.Generator) -> Array:
    found = rng.normal(size=(count, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def test_objects_that_touch_have_scenes_of_their_own() -> None:
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)).tessellate()
    assert caster_of(body(box), body(box, 1.0)).groups == 2
    assert caster_of(body(box), body(box, 1.1)).groups == 1
    assert caster_of(body(box), body(box, 1.0), body(box, 2.0), body(box, 3.0)).groups == 2


def test_nearest_surfaces_are_those_of_the_reference(rng: np.random.Generator) -> None:
    objects = body(Sphere().tessellate(24)), body(tl.load_mesh(mesh_path("knot")), 1.02), body(Sphere().tessellate(16))
    caster, scene = caster_of(*objects), tl.Scene(objects, tl.Camera.look_at((9, 9, 9), (0, 0, 0)))
    directions = unit_vectors(4000, rng)
    origins = -1.5 * directions + 0.3 * rng.normal(size=(4000, 3))
    face, distance = caster.nearest(origins, directions, np.full((4000, caster.groups), -1))
    points = origins * caster.radius + caster.center - scene.camera.eye
    lines = Lines(points, directions, np.zeros(4000), np.full(4000, np.inf))
    expected = np.full(4000, np.inf)
    for hits in SceneTracer(scene).hits(lines):
        np.minimum.at(expected, hits.pixel, hits.distance)
    found = distance.min(axis=1) * caster.radius
    assert (np.isinf(found) != np.isinf(expected)).sum() <= 1
    both = np.isfinite(found) & np.isfinite(expected)
    assert 0.5 < both.mean() < 0.999
    assert (np.abs(found[both] - expected[both]) > 1e-12).mean() <= 1e-3
    exact = caster.nearest_exactly(origins, directions)[1].min(axis=1) * caster.radius
    np.testing.assert_allclose(exact, expected, rtol=1e-12)
    assert (face[np.isinf(distance)] == -1).all()


@pytest.mark.parametrize("name", ["sphere", "knot", "shell", "amber", "bear", "goblet"])
def test_rays_inside_a_closed_body_leave_it(name: str, rng: np.random.Generator) -> None:
    caster, count = caster_of(body(tl.load_mesh(mesh_path(name)))), 20000
    faces = caster.faces
    area = np.linalg.norm(np.cross(faces.edges[:, 0], faces.edges[:, 1]), axis=1)
    start = rng.choice(len(area), count, p=area / area.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    weights[: count // 10, 0] *= 1e-7  # beside an edge
    weights /= weights.sum(axis=1, keepdims=True)
    origins = faces.corner[start] + np.einsum("kc,kci->ki", weights[:, 1:], faces.edges[start])
    directions = unit_vectors(count, rng)
    directions[np.einsum("ki,ki->k", directions, faces.outward[start]) > 0] *= -1.0
    face = caster.nearest(origins, directions, start[:, None])[0][:, 0]
    doubt = np.flatnonzero(~leaves(caster, face, directions))
    assert len(doubt) < 0.005 * count
    assert (doubt < count // 10).mean() > 0.9, "Embree fails at edges alone"
    again = caster.nearest_exactly(origins[doubt], directions[doubt])[0][:, 0]
    # Closer to the edge than rounding tells there is no exit to be found.
    assert (~leaves(caster, again, directions[doubt])).sum() <= 2


def leaves(caster: ExactRayCaster, face: np.ndarray, directions: Array) -> np.ndarray:
    return (face >= 0) & (np.einsum("ki,ki->k", caster.faces.outward[face], directions) > 0)
