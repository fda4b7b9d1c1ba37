"""Diagnosis of many small meshes at a time: one by one, calls would take longer than their triangles."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.geometry.diagnosis import CONVEX_TOLERANCE, Diagnosis, Finding
from translucent.geometry.grouping import SortedSides, connected, equal_rows, sorted_sides, use_mask
from translucent.geometry.mesh import Mesh
from translucent.geometry.winding import triple_products

#: Most triangles of a small mesh, least number of meshes, and triangles that are looked at at a time.
SMALL, FEWEST, MOST = 2000, 8, 1 << 17


def diagnose_together(meshes: Iterable[Mesh]) -> None:
    """Diagnose all small meshes that are convex bodies without a defect; other meshes are left to be diagnosed alone.

    They equal those of each mesh alone, to the last bit.
    """
    waiting = {
        id(mesh): mesh
        for mesh in meshes
        if "diagnosis" not in mesh.__dict__ and len(mesh.faces) <= SMALL and len(mesh.vertices) <= 3 * SMALL
    }
    if len(waiting) < FEWEST:
        return
    batch: list[Mesh] = []
    triangles = 0
    for mesh in waiting.values():
        if triangles + len(mesh.faces) > MOST:
            _diagnose(batch)
            batch, triangles = [], 0
        batch.append(mesh)
        triangles += len(mesh.faces)
    _diagnose(batch)


def _diagnose(meshes: list[Mesh]) -> None:
    many = _Many(meshes)
    volumes = many.volumes()
    good = many.good()
    good &= many.convex(np.sign(volumes))
    none = Finding(0)
    for number in np.flatnonzero(good).tolist():
        volume = float(volumes[number])
        meshes[number].__dict__["diagnosis"] = Diagnosis(
            nonfinite_vertices=none,
            unreferenced_vertices=none,
            degenerate_faces=none,
            duplicate_faces=none,
            open_edges=none,
            mixed_edges=none,
            nonmanifold_edges=none,
            components=1,
            volume=volume,
            closed=True,
            solid=True,
            inside_out_parts=0,
            negative_winding=False,
            inverted=volume < 0,
            convex=True,
        )


class _Many:
    """Vertices and faces of many meshes one after another."""

    def __init__(self, meshes: list[Mesh]) -> None:
        counts = np.array([(len(mesh.vertices), len(mesh.faces)) for mesh in meshes])
        self.vertex_starts, self.face_starts = (np.cumsum(counts, axis=0) - counts).T
        self.vertex_mesh, self.face_mesh = (np.repeat(np.arange(len(meshes)), column) for column in counts.T)
        self.vertices: Array = np.concatenate([mesh.vertices for mesh in meshes])
        self.faces: Integers = np.concatenate([mesh.faces for mesh in meshes]).astype(np.int64)
        self.faces += self.vertex_starts[self.face_mesh, None]
        finite = np.isfinite(self.vertices).all(axis=1)
        self.vertices[~finite] = 0.0
        self.usable: Mask = self._all_vertices(finite & use_mask(self.faces, len(self.vertices)))
        groups = equal_rows(np.column_stack([self.vertex_mesh.astype(np.float64), self.vertices]))
        self.positions = np.bincount(self.vertex_mesh[groups.first], minlength=len(meshes))
        self.shared: Integers = groups.first[groups.of][self.faces]
        self.sides: SortedSides = sorted_sides(self.shared)

    def _all_vertices(self, mask: Mask) -> Mask:
        """(meshes,): whether a mask holds for all vertices of each mesh."""
        return np.asarray(np.logical_and.reduceat(mask, self.vertex_starts))

    def _corners(self) -> Array:
        """(3 axes, 3 corners, m): coordinates about a corner of each mesh, as `part_volumes` has them."""
        origins = self.vertices[self.faces[self.face_starts, 0]]
        local = self.vertices - origins[self.vertex_mesh]
        return np.asarray(local.T[:, self.faces.T])

    def volumes(self) -> Array:
        """(meshes,): signed volumes, each summed up as that of a mesh alone."""
        with np.errstate(under="ignore", over="ignore", invalid="ignore"):
            triples = triple_products(*self._corners())
            ends = [*self.face_starts.tolist(), len(triples)]
            return np.array([triples[begin:end].sum() for begin, end in pairwise(ends)]) / 6.0

    def good(self) -> Mask:
        """(meshes,): which ones are finite, one closed part of genus 0, wound alike, and all faces have an area."""
        found = self.usable & (np.diff(self.face_starts, append=len(self.faces)) > 2)
        a, b, c = self.shared.T
        found[self.face_mesh[(a == b) | (b == c) | (c == a) | ~self._with_area()]] = False
        sides, begins = self.sides, self.sides.begins
        balance = np.add.reduceat(np.where(sides.ascending, 1, -1), begins)
        found[self._of_edge()[(sides.sizes != 2) | (balance != 0)]] = False
        label = connected(sides.vertices, *sides.ends(np.arange(len(begins))).T)
        found[self.face_mesh[label[a] != label[a[self.face_starts]][self.face_mesh]]] = False
        edges = np.bincount(self._of_edge(), minlength=len(found))
        return np.asarray(found & (self.positions - edges + np.diff(self.face_starts, append=len(self.faces)) == 2))

    def _of_edge(self) -> Integers:
        """(k,): mesh of each edge."""
        return self.face_mesh[self.sides.face[self.sides.begins]]

    def _with_area(self) -> Mask:
        """(m,): which faces have an area."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            x, y, z = self._cross(*(self.vertices[self.faces[:, i]] for i in range(3)))
            return np.asarray(np.maximum(np.maximum(np.abs(x), np.abs(y)), np.abs(z)) > 0)

    @staticmethod
    def _cross(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
        """(m,), (m,), (m,): (b - a) x (c - a)."""
        (px, py, pz), (qx, qy, qz) = (b - a).T, (c - a).T
        return py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx

    def convex(self, orientation: Array) -> Mask:
        """(meshes,): whether no edge of two faces bends inwards, where volumes have the sign `orientation`."""
        size = np.maximum.reduceat(self.vertices, self.vertex_starts)
        size -= np.minimum.reduceat(self.vertices, self.vertex_starts)
        mesh, sides = self._of_edge(), self.sides
        paired = sides.sizes == 2
        one, mesh = sides.begins[paired], mesh[paired]
        face, corner = sides.face, sides.number
        a, b, c = (self.vertices[self.shared[face[one], i]] for i in range(3))
        opposite = (self.vertices[self.shared[face[one + 1], (corner[one + 1] + 2) % 3]] - a).T
        dent = (CONVEX_TOLERANCE * size.max(axis=1))[mesh]
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            x, y, z = self._cross(a, b, c)
            height = orientation[mesh] * (x * opposite[0] + y * opposite[1] + z * opposite[2])
            bent = ~(height <= dent * np.sqrt(x * x + y * y + z * z))
        found: Mask = orientation != 0
        found[mesh[bent]] = False
        return found
