"""Diagnoses of many small meshes at once against those of each alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.geometry import together
from translucent.geometry.diagnosis import diagnose
from translucent.geometry.solids import Box, Sphere, Torus
from translucent.geometry.together import diagnose_together

BALL = Sphere(radius=0.4).tessellate(8)
CUBE = Box.slab((1.0, 2.0), 3.0).tessellate()
CONVEX = {
    "ball": BALL,
    "far ball": tl.Mesh(BALL.vertices + 1e6, BALL.faces),
    "inverted ball": tl.Mesh(BALL.vertices, BALL.faces[:, ::-1]),
    "cube": CUBE,
    "cube of faces apart": tl.Mesh(CUBE.vertices[CUBE.faces.ravel()], np.arange(CUBE.faces.size).reshape(-1, 3)),
    "needle": tl.Mesh(BALL.vertices * (1e-6, 1.0, 1e3), BALL.faces),
}


def dented() -> np.ndarray:
    """Vertices of the ball with one pushed in."""
    vertices = BALL.vertices.copy()
    vertices[5] *= 0.5
    return vertices


def sliver() -> tl.Mesh:
    """The cube with one of its triangles in two, and a face of no area between these and the next one."""
    u, v, w = CUBE.faces[0].tolist()
    middle = len(CUBE.vertices)
    vertices = np.concatenate([CUBE.vertices, [0.5 * (CUBE.vertices[u] + CUBE.vertices[v])]])
    return tl.Mesh(vertices, np.concatenate([CUBE.faces[1:], [[u, middle, w], [middle, v, w], [u, v, middle]]]))


def broken() -> dict[str, tl.Mesh]:
    """Meshes that are no convex bodies, or have a defect."""
    ball, faces = BALL.vertices, BALL.faces
    turned, twice = faces.copy(), np.concatenate([faces, faces])
    turned[3] = turned[3, ::-1]
    away, unknown = np.concatenate([ball, [[9.0, 9.0, 9.0]]]), ball.copy()
    unknown[2, 1] = np.nan
    pair = np.concatenate([ball, ball + 2.0]), np.concatenate([faces, faces + len(ball)])
    kissing = trimesh.creation.box().vertices, trimesh.creation.box().faces
    touching = np.concatenate([kissing[0], kissing[0] + 1.0]), np.concatenate([kissing[1], kissing[1] + 8])
    return {
        "torus": Torus(0.1, 0.04).tessellate(8),
        "dented": tl.Mesh(dented(), faces),
        "open": tl.Mesh(ball, faces[1:]),
        "one face turned": tl.Mesh(ball, turned),
        "all faces twice": tl.Mesh(ball, twice),
        "a vertex unused": tl.Mesh(away, faces),
        "not a number": tl.Mesh(unknown, faces),
        "two parts": tl.Mesh(*pair),
        "two parts that touch": tl.Mesh(*touching),
        "a face of no area": tl.Mesh(away, np.concatenate([faces, [[0, 0, len(ball)]]])),
        "a copy of a vertex unused": tl.Mesh(np.concatenate([ball, ball[:1]]), faces),
        "a sliver along an edge": sliver(),
        "flat": tl.Mesh(ball * (1.0, 1.0, 0.0), faces),
        "two faces": tl.Mesh(ball, [[0, 1, 2], [0, 2, 1]]),
    }


@pytest.mark.parametrize("most", [together.MOST, 300])
def test_each_has_the_diagnosis_that_it_has_alone(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr(together, "MOST", most)
    meshes = {name: dataclasses.replace(mesh) for name, mesh in {**CONVEX, **broken()}.items()}
    diagnose_together(meshes.values())
    assert {name for name, mesh in meshes.items() if "diagnosis" in mesh.__dict__} == set(CONVEX)
    for name, mesh in meshes.items():
        assert mesh.diagnosis == diagnose(mesh.vertices, mesh.faces), name


def test_meshes_of_all_sizes_to_the_last_bit(rng: np.random.Generator) -> None:
    shapes = [Sphere(radius=0.4).tessellate(int(n)) for n in rng.integers(3, 24, 30)]
    meshes = [tl.Mesh(shape.vertices * rng.uniform(0.5, 2.0, 3) + rng.normal(size=3), shape.faces) for shape in shapes]
    diagnose_together(meshes)
    for mesh in meshes:
        assert mesh.__dict__["diagnosis"] == diagnose(mesh.vertices, mesh.faces)


def test_a_plan_finds_them_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    meshes = [dataclasses.replace(BALL) for _ in range(together.FEWEST)]
    monkeypatch.setattr("translucent.geometry.mesh.diagnose", lambda *_: pytest.fail("a mesh was examined alone"))
    tea = tl.Medium(absorption=(1.0, 2.0, 3.0))
    bodies = [tl.Object(mesh, tea) for mesh in meshes]
    scene = tl.Scene(bodies, tl.Camera.look_at((0, 0, 3), (0, 0, 0)))
    tl.plan(scene)
    assert all(mesh.diagnosis.convex for mesh in meshes)
