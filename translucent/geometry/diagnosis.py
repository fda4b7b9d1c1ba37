"""Diagnosis of a triangle mesh: its defects, counted, with the first offenders named.

The question that matters for thickness is whether every ray enters as often as it leaves. That holds exactly when the
faces form a cycle: every directed edge is used as often in one direction as in the other. Winding numbers are integers
then, whatever else (touching parts, non-manifold edges, nested shells) the mesh has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Mask
from translucent.geometry.grouping import CHUNK, SortedSides, connected, equal_rows, extent, sorted_sides, use_mask
from translucent.geometry.repair import spread_winding
from translucent.geometry.winding import inside_out_parts, one_volume, winds_negatively

#: Deepest dent of a convex body, as a fraction of its size.
CONVEX_TOLERANCE = 1e-6

#: Smallest and largest x, y, z.
Bounds = tuple[tuple[float, ...], tuple[float, ...]]

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
    holes : int
        Parts that the edges of `open_bounds` form by common vertices.
    open_bounds : ((x, y, z), (x, y, z)), optional
        Smallest and largest coordinates of edges that faces pass more often in one direction than in the other: where
        the mesh is open, or changes its winding. None for a solid.
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
    holes: int = 0
    open_bounds: Bounds | None = None

    @property
    def inside_out(self) -> bool:
        """True if a part, or a lobe of one, is inside out."""
        return self.inside_out_parts > 0 or self.negative_winding

    @property
    def sound(self) -> bool:
        """True if the mesh is solid and nowhere inside out: exits minus entries is the thickness along every ray."""
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
            lines.append("inverted: all faces point inwards")
        if self.inside_out_parts:
            lines.append(f"{self.inside_out_parts} closed parts inside out")
        elif self.solid and self.negative_winding:
            lines.append("inside out in places: the surface intersects itself, and the faces of one lobe point inwards")
        return tuple(lines)

    def __str__(self) -> str:
        kind = ("closed, convex" if self.convex else "closed") if self.solid else "not a solid"
        return "; ".join([f"{kind}, {self.components} component{'s' if self.components != 1 else ''}", *self.problems])


def diagnose(vertices: Array, faces: npt.NDArray[np.int32], one_closed_part: bool = False) -> Diagnosis:
    """Examine a mesh, as a cycle of oriented triangles.

    Parameters
    ----------
    vertices : (n, 3) float64
        Positions in metres; may hold non-finite values, which are counted.
    faces : (m, 3) int32
        Valid indices into `vertices`.
    one_closed_part : bool
        Whether it is known that no two vertices are at one position, that every edge has two faces, which agree about
        the winding, and that edges join all faces: loading has found that out.
    """
    finite = _finite(vertices)
    used = use_mask(faces, len(vertices))
    filled = vertices if finite.all() else np.where(finite[:, None], vertices, 0.0)
    shared = faces if one_closed_part else _at_positions(vertices, faces)
    edges = None if one_closed_part else _Edges(shared)
    volume = one_volume(filled, faces)
    none = Finding(0)
    open_edges = none if edges is None else edges.found(edges.sizes % 2 == 1)
    mixed_edges = none if edges is None else edges.found((edges.sizes % 2 == 0) & (edges.net != 0))
    whole = bool(finite[used].all()) and (edges is None or len(edges.sizes) > 0)
    solid = whole and not open_edges and not mixed_edges
    inverted = solid and volume < 0
    components = 1 if edges is None else edges.components()
    inside_out = _inside_out(vertices, edges.faces) if edges and whole and components > 1 and not inverted else 0
    convex = solid and components == 1 and _is_convex(vertices, shared, edges, float(np.sign(volume)))
    outwards = faces[:, ::-1] if inverted else faces
    return Diagnosis(
        nonfinite_vertices=_found(~finite),
        unreferenced_vertices=_found(~used),
        degenerate_faces=_found(_degenerate(filled, faces)),
        duplicate_faces=none if _is_one_sheet(faces, edges, components) else _duplicates(shared),
        open_edges=open_edges,
        mixed_edges=mixed_edges,
        nonmanifold_edges=none if edges is None else edges.found(edges.sizes > 2),
        components=components,
        volume=volume,
        closed=not open_edges,
        solid=solid,
        inside_out_parts=inside_out,
        negative_winding=whole and not convex and winds_negatively(vertices, outwards),
        inverted=inverted,
        convex=convex,
        holes=0 if edges is None else edges.holes(),
        open_bounds=None if solid else _open_bounds(vertices[used & finite], vertices, edges if whole else None),
    )


class _Edges:
    """Undirected edges of the faces that have three corners, with how many faces use each and in which direction."""

    def __init__(self, faces: npt.NDArray[np.integer]) -> None:
        collapsed = _collapsed(faces)
        self.faces = faces[~collapsed] if collapsed.any() else faces
        self.sides = sorted_sides(self.faces)
        empty = np.empty(0, dtype=np.int64)
        self.sizes = self.sides.sizes if len(self.faces) else empty
        #: Uses in ascending minus uses in descending direction: 0 for a balanced edge.
        self.net = (
            np.add.reduceat(np.where(self.sides.ascending, 1, -1), self.sides.begins) if len(self.faces) else empty
        )

    def found(self, mask: Mask) -> Finding:
        if not mask.any():
            return Finding(0)
        first = self.sides.ends(np.flatnonzero(mask)[:FIRST]).tolist()
        return Finding(int(mask.sum()), tuple((a, b) for a, b in first))

    def holes(self) -> int:
        """Connected components of the edges that faces use more often in one direction, by common vertices."""
        ends = self.sides.ends(np.flatnonzero(self.net))
        return len(np.unique(connected(self.sides.vertices, *ends.T)[ends])) if len(ends) else 0

    def components(self) -> int:
        """Connected components by shared edges."""
        if len(self.sizes) == 0:
            return 0
        count = self.sides.vertices
        label = connected(count, *self.sides.ends(np.arange(len(self.sizes))).T)
        return int(label.max()) + 1 - int((~use_mask(self.faces, count)).sum())


def _is_one_sheet(faces: npt.NDArray[np.integer], edges: _Edges | None, components: int) -> bool:
    """True if all faces are connected by edges of at most two faces."""
    if edges is None:
        return len(faces) > 2
    return components == 1 and len(edges.faces) > 2 and bool((edges.sizes <= 2).all())


def _is_convex(vertices: Array, faces: npt.NDArray[np.integer], edges: _Edges | None, orientation: float) -> bool:
    """True if all edges of one closed component are convex; with genus 0 that means a convex body."""
    if orientation == 0:
        return False
    faces = faces if edges is None else edges.faces
    # A dent among the first faces answers for most meshes.
    if len(faces) > CHUNK and not _all_convex(vertices, faces, sorted_sides(faces[:CHUNK]), orientation):
        return False
    sides = sorted_sides(faces) if edges is None else edges.sides
    if not (sides.sizes == 2).all():
        return False
    corners = int(use_mask(faces, len(vertices)).sum())
    return corners - len(sides.begins) + len(faces) == 2 and _all_convex(vertices, faces, sides, orientation)


def _all_convex(vertices: Array, faces: npt.NDArray[np.integer], sides: SortedSides, orientation: float) -> bool:
    """True if the edges that have two of these sides are convex."""
    low, high = extent(vertices[use_mask(faces, len(vertices))])
    # Files keep float32, so flat patches and fine tessellations scatter by some 1e-7 of the size.
    dent = CONVEX_TOLERANCE * float((high - low).max())
    first = sides.begins[sides.sizes == 2]
    face, number = sides.face, sides.number
    for begin in range(0, len(first), CHUNK):
        one, other = first[begin : begin + CHUNK], first[begin : begin + CHUNK] + 1
        a, b, c = (vertices.take(faces[face[one], i], axis=0) for i in range(3))
        (px, py, pz), (qx, qy, qz) = (b - a).T, (c - a).T
        x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        opposite = (vertices.take(faces[face[other], (number[other] + 2) % 3], axis=0) - a).T
        with np.errstate(under="ignore"):
            height = orientation * (x * opposite[0] + y * opposite[1] + z * opposite[2])
            if (height > dent * np.sqrt(x * x + y * y + z * z)).any():
                return False
    return True


def _inside_out(vertices: Array, faces: npt.NDArray[np.integer]) -> int:
    """Number of closed parts that face inwards and lie inside no other."""
    part, _ = spread_winding(faces)
    return len(inside_out_parts(vertices, faces, part))


def _open_bounds(used: Array, vertices: Array, edges: _Edges | None) -> Bounds | None:
    """Bounds of the edges at which a mesh that is no solid is open; without edges, of all that faces use."""
    ends = used if edges is None else vertices[edges.sides.ends(np.flatnonzero(edges.net)).ravel()]
    if not len(ends):
        return None
    low, high = extent(ends)
    return tuple(low.tolist()), tuple(high.tolist())


def _finite(vertices: Array) -> Mask:
    """(n,): which vertices are finite."""
    if len(vertices) and np.isfinite(extent(vertices)).all():
        return np.ones(len(vertices), dtype=bool)
    return np.asarray(np.isfinite(vertices).all(axis=1))


def _at_positions(vertices: Array, faces: npt.NDArray[np.int32]) -> npt.NDArray[np.integer]:
    """Faces of the first vertices at each position."""
    positions = equal_rows(vertices)
    return faces if len(positions.first) == len(vertices) else positions.first[positions.of][faces]


def _degenerate(vertices: Array, faces: npt.NDArray[np.int32]) -> Mask:
    """(m,): which faces have no area."""
    found = np.empty(len(faces), dtype=bool)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        for begin in range(0, len(faces), CHUNK):
            part = slice(begin, begin + CHUNK)
            a, b, c = (vertices.take(faces[part, i], axis=0) for i in range(3))
            (px, py, pz), (qx, qy, qz) = (b - a).T, (c - a).T
            largest = np.abs(py * qz - pz * qy)
            np.maximum(largest, np.abs(pz * qx - px * qz), out=largest)
            np.maximum(largest, np.abs(px * qy - py * qx), out=largest)
            found[part] = ~(largest > 0)
    return found


def _collapsed(faces: npt.NDArray[np.integer]) -> Mask:
    """Faces with two corners at one position: they have no side and do not belong to the cycle."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def _found(mask: Mask) -> Finding:
    if not mask.any():
        return Finding(0)
    return Finding(int(mask.sum()), tuple(int(i) for i in np.flatnonzero(mask)[:FIRST]))


def _duplicates(faces: npt.NDArray[np.integer]) -> Finding:
    repeated = np.ones(len(faces), dtype=bool)
    repeated[equal_rows(np.sort(faces, axis=1)).first] = False
    return _found(repeated & ~_collapsed(faces))
