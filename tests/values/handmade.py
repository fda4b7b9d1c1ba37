"""Meshes made by hand, and what is wrong with a mesh, by name."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from translucent.geometry.diagnosis import Diagnosis, Finding
from translucent.geometry.mesh import Mesh

EPS = float(np.finfo(np.float64).eps)

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
#: A cube with corner i at (i >> 2, i >> 1, i) of 0..1, wound outwards.
CUBE = np.array([triangle for a, b, c, d in QUADS for triangle in ((a, b, c), (a, c, d))])
TETRAHEDRON = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def cube(low: float = 0.0, size: float = 1.0) -> Mesh:
    return Mesh(CORNERS * size + low, CUBE)


def changed(faces: npt.NDArray[Any], *, drop: int | None = None, flip: int | None = None, repeat: int | None = None):
    result = faces.copy()
    if flip is not None:
        result[flip] = result[flip, ::-1]
    if repeat is not None:
        result = np.vstack([result, result[repeat]])
    return result if drop is None else np.delete(result, drop, axis=0)


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *[len(mesh.vertices) for mesh in meshes[:-1]]])
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    return Mesh(vertices, np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]))


def inverted(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def moebius(count: int = 12) -> Mesh:
    """A band of `count` quads with half a turn."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = np.array(
        [
            [(1 + side * np.cos(t / 2)) * np.cos(t), (1 + side * np.cos(t / 2)) * np.sin(t), side * np.sin(t / 2)]
            for t in angle
            for side in (0.3, -0.3)
        ]
    )
    # Across the cut the two rims change places.
    pairs = [(2 * i, 2 * i + 1) for i in range(count)] + [(1, 0)]
    return Mesh(rim, [f for (a, b), (c, d) in itertools.pairwise(pairs) for f in ((a, b, c), (b, d, c))])


def ball(subdivisions: int = 3, radius: float = 1.0) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(sphere.vertices, sphere.faces)


CLEAN: dict[str, object] = {
    "nonfinite_vertices": 0,
    "unreferenced_vertices": 0,
    "degenerate_faces": 0,
    "duplicate_faces": 0,
    "open_edges": 0,
    "mixed_edges": 0,
    "nonmanifold_edges": 0,
    "components": 1,
    "closed": True,
    "solid": True,
    "inverted": False,
}


def facts(found: Diagnosis) -> dict[str, object]:
    values = {name: getattr(found, name) for name in CLEAN}
    return {name: value.count if isinstance(value, Finding) else value for name, value in values.items()}


# A slit: two opposite walls at one place, joined along their boundary.
DOUBLED = np.vstack([CUBE[:2], CUBE[:2, ::-1]])


def bitten_box() -> Mesh:
    """An L of unit thickness: a 2 x 2 square without its far quarter."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0)])
    cap = [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)]
    walls = [f for i in range(6) for j in [(i + 1) % 6] for f in ((i, j, j + 6), (i, j + 6, i + 6))]
    return Mesh(vertices, [*[c[::-1] for c in cap], *walls, *[tuple(v + 6 for v in c) for c in cap]])
