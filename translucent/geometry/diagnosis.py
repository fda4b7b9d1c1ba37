"""Diagnosis of a triangle mesh: its defects, counted, with the first offenders named.

The question that matters for thickness is whether every ray enters as often as it leaves. That holds exactly when the
faces form a cycle: every directed edge is used as often in one direction as in the other. Winding numbers are integers
then, whatever else (touching parts, non-manifold edges, nested shells) the mesh has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.geometry.grouping import equal_rows, position_ids, shared_edges, side_ends, used_vertices
from translucent.geometry.repair import spread_winding
from translucent.geometry.sample_lines import winds_negatively
from translucent.geometry.winding import inside_out_parts

#: Deepest dent of a convex body, as a share of its size.
CONVEX_TOLERANCE = 1e-6

#: Largest number of offenders that a finding names.
FIRST = 3


@dataclass(frozen=True)
class Finding:
    """Finding of one kind of defect.

    Attributes
    ----------
    count : int
        How many faces, edges or vertices have it.
    first : tuple of int or of (int, int)
        Indices of the first offenders: faces, vertices, or edges as vertex pairs.
    """

    count: int
    first: tuple[object, ...] = ()

    def __bool__(self) -> bool:
        return self.count > 0


@dataclass(frozen=True)
class Diagnosis:
    """Defects and properties of a mesh; vertices at the same position count as one.

    Attributes
    ----------
    nonfinite_vertices, unreferenced_vertices : Finding
    degenerate_faces : Finding
        Faces of zero area.
    duplicate_faces : Finding
        Faces whose three corners another, earlier face has too, whatever its winding.
    open_edges : Finding
        Edges with an odd number of faces: the boundary of a hole.
    mixed_edges : Finding
        Edges whose faces disagree about the winding.
    nonmanifold_edges : Finding
        Edges with more than two faces; harmless for thickness where the windings balance.
    components : int
        Parts that share no edge.
    volume : float
        Signed volume in cubic metres; meaningful for closed meshes.
    closed : bool
        No open edge.
    solid : bool
        Closed and consistently wound: the thickness along every ray is defined.
    inside_out_parts : int
        Closed parts that look inwards and are no cavity, beside others that look outwards.
    negative_winding : bool
        Around some places the surface winds a negative number of times: a lobe or a part of it is inside out there.
        Found on sample lines, so that what is smaller than a hundredth of the mesh can be missed.
    inverted : bool
        Solid, with all faces looking inwards.
    convex : bool
        Solid, one component, and no edge bends inwards.
    """

    nonfinite_vertices: Finding
    unreferenced_vertices: Finding
    degenerate_faces: Finding
    duplicate_faces: Finding
    open_edges: Finding
    mixed_edges: Finding
    nonmanifold_edges: Finding
    components: int
    volume: float
    closed: bool
    solid: bool
    inside_out_parts: int
    negative_winding: bool
    inverted: bool
    convex: bool

    @property
    def inside_out(self) -> bool:
        """Whether a part, or a lobe of one, is inside out."""
        return self.inside_out_parts > 0 or self.negative_winding

    @property
    def sound(self) -> bool:
        """Whether the mesh is solid and nowhere inside out: exits minus entries is the thickness along every ray."""
        return self.solid and not self.inside_out

    @property
    def problems(self) -> tuple[str, ...]:
        """One line per defect, with its count and first offenders; empty for a clean solid."""
        kinds = [
            (self.nonfinite_vertices, "non-finite vertices", "vertex"),
            (self.open_edges, "open edges", "vertices"),
            (self.mixed_edges, "edges with mixed winding", "vertices"),
            (self.nonmanifold_edges, "edges with more than two faces", "vertices"),
            (self.duplicate_faces, "duplicated faces", "face"),
            (self.degenerate_faces, "faces of zero area", "face"),
            (self.unreferenced_vertices, "unreferenced vertices", "vertex"),
        ]
        lines = [
            f"{finding.count} {text} (first: {noun} {', '.join(str(item) for item in finding.first)})"
            for finding, text, noun in kinds
            if finding
        ]
        if self.inverted:
            lines.append("inverted: all faces look inwards")
        if self.inside_out_parts:
            lines.append(f"{self.inside_out_parts} closed parts inside out")
        elif self.solid and self.negative_winding:
            lines.append("inside out in places: the surface crosses itself, and a lobe of it looks inwards")
        return tuple(lines)

    def __str__(self) -> str:
        kind = ("closed, convex" if self.convex else "closed") if self.solid else "not a solid"
        return "; ".join([f"{kind}, {self.components} component{'s' if self.components != 1 else ''}", *self.problems])


def diagnose(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int32]) -> Diagnosis:
    """Examine a mesh, as a cycle of oriented triangles.

    Parameters
    ----------
    vertices : (n, 3) float64
        Positions in metres; may hold non-finite values, which are counted.
    faces : (m, 3) int32
        Valid indices into `vertices`.
    """
    finite = np.asarray(np.isfinite(vertices).all(axis=1))
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    corners = np.where(finite[:, None], vertices, 0.0)[faces]
    with np.errstate(over="ignore", under="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        degenerate = np.asarray(~(np.abs(normals).max(axis=1) > 0))
    shared = position_ids(vertices)[faces]
    edges = _Edges(shared[~_collapsed(shared)])
    open_edges = np.asarray(edges.total % 2 == 1)
    mixed = np.asarray(~open_edges & (edges.net != 0))
    closed = not open_edges.any()
    solid = bool(closed and not mixed.any() and finite[used].all() and len(edges.total) > 0)
    volume = _signed_volume(corners)
    components = edges.components()
    inverted = solid and volume < 0
    whole = bool(finite[used].all()) and len(edges.total) > 0
    inside_out = _inside_out(vertices, edges.faces) if whole and components > 1 and not inverted else 0
    convex = solid and components == 1 and edges.all_convex(vertices, float(np.sign(volume)))
    outwards = faces[:, ::-1] if inverted else faces
    return Diagnosis(
        nonfinite_vertices=_found(~finite),
        unreferenced_vertices=_found(~used),
        degenerate_faces=_found(degenerate),
        duplicate_faces=_duplicates(shared),
        open_edges=edges.found(open_edges),
        mixed_edges=edges.found(mixed),
        nonmanifold_edges=edges.found(edges.total > 2),
        components=components,
        volume=volume,
        closed=closed,
        solid=solid,
        inside_out_parts=inside_out,
        negative_winding=whole and not convex and winds_negatively(vertices, outwards),
        inverted=inverted,
        convex=convex,
    )


class _Edges:
    """Undirected edges of a mesh, with how many faces use each and in which direction."""

    def __init__(self, faces: npt.NDArray[np.int64]) -> None:
        self.faces = faces
        start, end = side_ends(faces)
        shared = shared_edges(faces)
        self.of_side, self.total = shared.of, shared.sizes
        self.pairs = np.sort(np.stack([start, end], axis=1)[shared.first], axis=1)
        direction = np.where(start < end, 1.0, -1.0)
        #: Uses in ascending minus uses in descending direction: 0 for a balanced edge.
        self.net = np.rint(np.bincount(self.of_side, weights=direction, minlength=len(self.pairs))).astype(np.int64)

    def found(self, mask: npt.NDArray[np.bool_]) -> Finding:
        return Finding(int(mask.sum()), tuple((int(a), int(b)) for a, b in self.pairs[mask][:FIRST]))

    def components(self) -> int:
        """Connected components by shared edges."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        if len(self.pairs) == 0:
            return 0
        ids, index = np.unique(self.pairs, return_inverse=True)
        rows, columns = index.reshape(self.pairs.shape).T
        graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(len(ids), len(ids)))
        return int(connected_components(graph, directed=False, return_labels=False))

    def all_convex(self, vertices: npt.NDArray[np.float64], orientation: float) -> bool:
        """Whether all edges are convex; with one closed component of genus 0 that means a convex body."""
        if not (self.total == 2).all() or orientation == 0:
            return False
        used = used_vertices(self.faces)
        if len(used) - len(self.pairs) + len(self.faces) != 2:
            return False
        order = np.argsort(self.of_side, kind="stable").reshape(-1, 2)
        one, other = order[:, 0], order[:, 1]
        corners = vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * orientation
        opposite = vertices[self.faces[other // 3, (other + 2) % 3]]
        height = np.einsum("ij,ij->i", normals[one // 3], opposite - corners[one // 3, 0])
        size = np.ptp(vertices[used], axis=0).max()
        # Files keep float32, so flat patches and fine tessellations scatter by some 1e-7 of the size.
        return bool((height <= CONVEX_TOLERANCE * size * np.linalg.norm(normals[one // 3], axis=1)).all())


def _inside_out(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> int:
    """Number of closed parts that face inwards and lie inside no other."""
    part, _ = spread_winding(faces)
    return len(inside_out_parts(vertices, faces, part))


def _collapsed(faces: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Faces with two corners at one position: they have no side and do not belong to the cycle."""
    return np.asarray((faces[:, [0, 1, 2]] == faces[:, [1, 2, 0]]).any(axis=1))


def _found(mask: npt.NDArray[np.bool_]) -> Finding:
    return Finding(int(mask.sum()), tuple(int(i) for i in np.flatnonzero(mask)[:FIRST]))


def _duplicates(faces: npt.NDArray[np.int64]) -> Finding:
    repeated = np.ones(len(faces), dtype=bool)
    repeated[equal_rows(np.sort(faces, axis=1)).first] = False
    return _found(repeated & ~_collapsed(faces))


def _signed_volume(corners: npt.NDArray[np.float64]) -> float:
    """Volume by the divergence theorem, about the first corner, so that far-away meshes lose no digits."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        a, b, c = (corners - corners[0, 0]).transpose(1, 0, 2)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
