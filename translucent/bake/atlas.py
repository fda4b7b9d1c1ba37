"""Texture coordinates of a map, the surface points of its texels, and the padding around its charts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.geometry.mesh import Mesh

#: Texels between the charts that xatlas makes, and the fraction of a small map's side that this is at most.
CHART_GAP, GAP_SHARE = 4, 1 / 128

#: Distance of texture coordinates to an integer within which they are equal to it: float32 near 1 rounds by half of it.
WHOLE = 1e-7

#: Advice about texture coordinates that no map can have.
ANEW = "make new UVs with --unwrap (in Python: omit uv), or unwrap the mesh in a modelling tool"

#: Largest number of tiles that one triangle may cover; more repeat a texture, which no thickness does.
MOST_TILES = 4.0


#: Distance, as a fraction of a texel, within which a texel's center is on a triangle's edge.
ON_EDGE = 1e-7

#: Number of rows whose distances are computed at a time.
ROWS = 256


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """A mesh with texture coordinates.

    Attributes
    ----------
    mesh : Mesh
    uv : (m, 3, 2) float64
        At the corners of its faces.
    vertex : (n,) int64
        Vertex of the mesh that was given, for each vertex of this one.
    made_by : str
        "mesh" or "xatlas".
    tiles : tuple of int
        UDIM tiles in which there are faces.
    warnings : tuple of str
    """

    mesh: Mesh
    uv: Array
    vertex: Integers
    made_by: str
    tiles: tuple[int, ...]
    warnings: tuple[str, ...]


def unwrap(mesh: Mesh, size: int, tile: int | None) -> Unwrapped:
    """Texture coordinates for a map of `size` texels a side.

    Raises
    ------
    InputError
        If there are none and xatlas is not installed; if they are not finite, repeat a texture or have no area; or if
        no face lies in the UDIM tile that is requested.
    """
    vertex = np.arange(len(mesh.vertices))
    made_by = "mesh"
    if mesh.uv is None:
        mesh, vertex = _new_uv(mesh, size)
        made_by = "xatlas"
    assert mesh.uv is not None
    _check(mesh, mesh.uv)
    near = np.round(mesh.uv)
    uv = np.where(np.abs(mesh.uv - near) <= WHOLE, near, mesh.uv)[mesh.faces]
    number, crossing = _tiles(uv)
    tiles = tuple(np.unique(number).tolist())
    return Unwrapped(mesh, uv, vertex, made_by, tiles, _doubts(mesh, uv, tiles, crossing, tile))


def tiles_of(mesh: Mesh) -> tuple[int, ...]:
    """UDIM tiles in which a mesh has faces; 0 for faces outside of all."""
    if mesh.uv is None:
        return ()
    near = np.round(mesh.uv)
    uv = np.where(np.abs(mesh.uv - near) <= WHOLE, near, mesh.uv)[mesh.faces]
    return tuple(np.unique(_tiles(uv)[0]).tolist())


def in_tile(uv: Array, tile: int) -> npt.NDArray[np.bool_]:
    """(m,): mask of faces (m, 3, 2) in a UDIM tile."""
    return np.asarray(_tiles(uv)[0] == tile)


def _new_uv(mesh: Mesh, size: int) -> tuple[Mesh, Integers]:
    xatlas = require_package("xatlas", f"new texture coordinates for {mesh.name!r}", "unwrap it in a modelling tool")
    mesh.require_finite()
    one, two, three = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    if not np.cross(two - one, three - one).any():
        raise InputError(f"mesh {mesh.name!r}", "no face of the mesh has an area", "export the mesh again")
    unit = ((mesh.vertices - mesh.center) / (0.5 * mesh.diagonal)).astype(np.float32)
    gap = max(1, min(CHART_GAP, round(GAP_SHARE * size)))
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(unit, mesh.faces.astype(np.uint32))
    options.resolution, options.padding, options.bilinear = size, gap, True
    atlas.generate(pack_options=options)
    vertex, faces, uv = atlas[0]
    vertex = vertex.astype(np.int64)
    made = Mesh(mesh.vertices[vertex], faces.astype(np.int32), uv.astype(np.float64), mesh.name, mesh.repairs)
    return made, vertex


def _check(mesh: Mesh, uv: Array) -> None:
    if bad := int((~np.isfinite(uv)).any(axis=1).sum()):
        raise InputError(f"mesh {mesh.name!r}", f"{bad} texture coordinates are not finite", ANEW)
    corners = uv[mesh.faces]
    # Much faster than reductions along an axis of three.
    one, two, three = corners.transpose(1, 0, 2)
    span = np.maximum(np.maximum(one, two), three) - np.minimum(np.minimum(one, two), three)
    if float(span.max()) > MOST_TILES:
        face = int(span.max(axis=1).argmax())
        raise InputError(
            f"mesh {mesh.name!r}",
            f"face {face} covers {span.max():.3g} tiles in UV space, so the map repeats on this face",
            ANEW,
        )
    a, b = two - one, three - one
    with np.errstate(under="ignore"):
        if not (a[:, 0] * b[:, 1] != a[:, 1] * b[:, 0]).any():
            raise InputError(f"mesh {mesh.name!r}", "no face of the mesh has an area in UV space", ANEW)


def _tiles(uv: Array) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """(m,): UDIM tile of each face, by its middle, 0 where there is none; and whether the face leaves its tile."""
    tile = np.floor(uv.mean(axis=1)).astype(np.int64)
    crossing = ((uv < tile[:, None]) | (uv > tile[:, None] + 1)).any(axis=(1, 2))
    u, v = tile.T
    numbered = (u >= 0) & (u < 10) & (v >= 0) & (v < 900)
    return np.where(numbered, 1001 + u + 10 * v, 0), crossing


def _doubts(
    mesh: Mesh, uv: Array, tiles: tuple[int, ...], crossing: npt.NDArray[np.bool_], tile: int | None
) -> tuple[str, ...]:
    """Warnings about texture coordinates; raises if a requested tile is empty."""
    listed = ", ".join(map(str, tiles))
    if tile is not None:
        if tile not in tiles:
            raise InputError(
                f"UDIM tile {tile}", f"mesh {mesh.name!r} has faces in {listed}", "choose one of these tiles"
            )
        return ()
    if len(tiles) > 1 and 0 not in tiles and not crossing.any():
        text = f"the texture coordinates use the UDIM tiles {listed}, which overlap in a single map"
        return (f"{text}: to bake each tile, use -o 'name.<UDIM>.png'",)
    if outside := int(((uv < 0) | (uv > 1)).any(axis=(1, 2)).sum()):
        return (f"{outside} of {len(uv)} faces have texture coordinates outside 0..1, where the map repeats",)
    return ()


@dataclass(frozen=True, eq=False)
class Texels:
    """Texels of a strip of a map, and the points that they show.

    Attributes
    ----------
    row, column : (k,) int64
        Each texel once, row by row.
    face : (k,) int64
        The face that has the center of the texel, or is nearest to it among the faces that touch the texel.
    barycentric : (k, 3) float64
        The point of the face that is nearest to the texel's center in UV.
    inside : (k,) bool
        Whether that is the center itself.
    overlapping : (k,) bool
        Whether the center is inside several faces.
    """

    row: Integers
    column: Integers
    face: Integers
    barycentric: Array
    inside: Mask
    overlapping: Mask


class Atlas:
    """Atlas: triangles in a map, prepared for finding the texels that they touch.

    Parameters
    ----------
    uv : (m, 3, 2) float64
        Texture coordinates at the corners of the faces, v upwards; beyond 0..1 the map repeats.
    width, height : int
        Of the map, in texels.
    """

    def __init__(self, uv: Array, width: int, height: int) -> None:
        self.width, self.height = width, height
        least = np.minimum(np.minimum(uv[:, 0], uv[:, 1]), uv[:, 2])
        shifted = uv - np.floor(least)[:, None]
        # Column and row as real numbers: texel (i, j) is the square from (j, i) to (j + 1, i + 1).
        self.corners = np.stack([shifted[..., 0] * width, (1.0 - shifted[..., 1]) * height], axis=-1)
        # (corner, axis, face): NumPy computes along long rows several times as fast as along short ones.
        self._place = np.ascontiguousarray(self.corners.transpose(1, 2, 0))
        heights = self._place[:, 1]
        self._top, self._bottom = _cells(heights.min(axis=0), heights.max(axis=0))

    def strip(self, begin: int, end: int) -> Texels:
        """Texels of rows `begin` to `end` that any face touches."""
        face, row = self._face_rows(begin, end)
        left, right = self._spans(face, row)
        count = right - left
        pair = np.repeat(np.arange(len(face)), count)
        column = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count) + left[pair]
        return self._nearest(face[pair], row[pair], column, begin, end)

    def _face_rows(self, begin: int, end: int) -> tuple[Integers, Integers]:
        """Pairs of a face and a row, not yet wrapped, of the faces that touch the strip or a repetition of it."""
        faces, rows = [], []
        lowest, highest = int(self._top.min()) // self.height, (int(self._bottom.max()) - 1) // self.height
        for turn in range(lowest, highest + 1):
            first, last = begin + turn * self.height, end + turn * self.height
            face = np.flatnonzero((self._top < last) & (self._bottom > first))
            top = np.maximum(self._top[face], first)
            count = np.minimum(self._bottom[face], last) - top
            faces.append(np.repeat(face, count))
            rows.append(np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(top, count))
        return np.concatenate(faces), np.concatenate(rows)

    def _spans(self, face: Integers, row: Integers) -> tuple[Integers, Integers]:
        """First and last column + 1 in which faces (n,) overlap rows (n,)."""
        place = np.take(self._place, face, axis=2)
        low, high = np.full(len(face), np.inf), np.full(len(face), -np.inf)
        for i in range(3):
            (ax, ay), (bx, by) = place[i], place[(i + 1) % 3]
            rise, run = by - ay, bx - ax
            level = rise == 0
            divisor = np.where(level, 1.0, rise)
            # Where the edge crosses the upper and lower edge of the row, as a fraction of its length.
            with np.errstate(over="ignore", under="ignore"):
                upper, lower = (np.clip((row + side - ay) / divisor, 0.0, 1.0) for side in (0.0, 1.0))
                upper = ax + np.where(level, 0.0, upper) * run
                lower = ax + np.where(level, 1.0, lower) * run
            crosses = (np.minimum(ay, by) <= row + 1) & (np.maximum(ay, by) >= row)
            np.minimum(low, np.minimum(upper, lower), out=low, where=crosses)
            np.maximum(high, np.maximum(upper, lower), out=high, where=crosses)
        touched = low <= high
        left, right = _cells(np.where(touched, low, 0.0), np.where(touched, high, 0.0))
        return left, np.where(touched, right, left)

    def _nearest(self, face: Integers, row: Integers, column: Integers, begin: int, end: int) -> Texels:
        """Choose a face for each texel of a strip, among all pairs of a face and a texel that it touches."""
        center = np.stack([column, row], axis=1).astype(np.float64) + 0.5
        area, inside = _areas(np.take(self._place, face, axis=2), center)
        texel = (row % self.height - begin) * self.width + column % self.width
        pairs = np.flatnonzero(inside)
        pairs = pairs[np.argsort(face[pairs], kind="stable")]
        best = np.full((end - begin) * self.width, -1)
        best[texel[pairs[::-1]]] = pairs[::-1]  # the last one stays, which is of the first face
        # Most other pairs are of a texel whose center some face has.
        beside = np.flatnonzero(~inside & (best[texel] < 0))
        distance, fraction = _closest_on_edges(self.corners[face[beside]], center[beside])
        order = np.lexsort((face[beside], distance, texel[beside]))
        order = order[np.diff(texel[beside[order]], prepend=-1) > 0]
        best[texel[beside[order]]] = beside[order]
        found = np.flatnonzero(best >= 0)
        best, overlapping = best[found], self._overlapping(texel, face, center, pairs, len(best))[found]
        within = inside[best]
        barycentric = np.empty((len(best), 3))
        with np.errstate(under="ignore"):
            fractions = area[:, best[within]]
            barycentric[within] = (fractions / (fractions[0] + fractions[1] + fractions[2])).T
        barycentric[~within] = fraction[order]
        rows, columns = np.divmod(found, self.width)
        return Texels(rows + begin, columns, face[best], barycentric, within, overlapping)

    def _overlapping(self, texel: Integers, face: Integers, center: Array, pairs: Integers, count: int) -> Mask:
        """(count,): whether the center of each texel lies in several faces; `pairs` list the faces at each center."""
        several = np.bincount(texel[pairs], minlength=count) > 1
        # Most of these are on an edge of two faces.
        pairs = pairs[several[texel[pairs]]]
        pairs = pairs[self._depth(face[pairs], center[pairs]) > ON_EDGE]
        return np.bincount(texel[pairs], minlength=count) > 1

    def _depth(self, face: Integers, center: Array) -> Array:
        """(n,): depth of the centers inside their faces, in texels; below 0 outside."""
        corners = self.corners[face]
        depth = np.full(len(face), np.inf)
        turn = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for i in range(3):
            along = corners[:, (i + 1) % 3] - corners[:, i]
            length = np.hypot(along[:, 0], along[:, 1])
            offset = np.sign(turn) * _cross(along, center - corners[:, i])
            depth = np.minimum(depth, offset / np.where(length > 0, length, 1.0))
        return depth


def _cells(low: Array, high: Array) -> tuple[Integers, Integers]:
    """First cell, and last + 1, that closed ranges touch; one that ends on a boundary does not touch the next cell."""
    first = np.floor(low).astype(np.int64)
    return first, np.maximum(np.ceil(high).astype(np.int64), first + 1)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _areas(place: Array, point: Array) -> tuple[Array, Mask]:
    """Twice the areas (3, n) opposite to the corners that points (n, 2) cut off triangles with corners at (3, 2, n),
    and whether they are inside (n,).
    """
    area = np.empty((3, len(point)))
    x, y = point.T
    with np.errstate(under="ignore"):
        for i in range(3):
            (ax, ay), (bx, by) = place[(i + 1) % 3], place[(i + 2) % 3]
            np.subtract((bx - ax) * (y - ay), (by - ay) * (x - ax), out=area[i])
        total = area[0] + area[1] + area[2]
    least = np.minimum(np.minimum(area[0], area[1]), area[2])
    most = np.maximum(np.maximum(area[0], area[1]), area[2])
    return area, ((least >= 0) & (total > 0)) | ((most <= 0) & (total < 0))


def _closest_on_edges(corners: Array, point: Array) -> tuple[Array, Array]:
    """Squared distance (n,) of points (n, 2) outside triangles (n, 3, 2), and barycentric weights of the nearest."""
    distance, barycentric = np.full(len(point), np.inf), np.zeros((len(point), 3))
    for i in range(3):
        j = (i + 1) % 3
        along = corners[:, j] - corners[:, i]
        square = (along * along).sum(axis=1)
        fraction = ((point - corners[:, i]) * along).sum(axis=1) / np.where(square > 0, square, 1.0)
        fraction = np.clip(np.where(square > 0, fraction, 0.0), 0.0, 1.0)
        offset = corners[:, i] + fraction[:, None] * along - point
        away = (offset * offset).sum(axis=1)
        nearer = away < distance
        distance = np.where(nearer, away, distance)
        weights = np.zeros_like(barycentric)
        weights[:, i], weights[:, j] = 1.0 - fraction, fraction
        barycentric = np.where(nearer[:, None], weights, barycentric)
    return distance, barycentric


def pad(values: npt.NDArray[np.float32], valued: npt.NDArray[np.bool_], padding: int) -> None:
    """Fill empty texels within `padding` texels of a filled texel with the nearest value, in place.

    Between two charts each thus keeps the half of the gap that is next to it, and covers nothing of the other.

    Parameters
    ----------
    values : (h, w, ...) float32
    valued : (h, w) bool
    padding : int
    """
    if padding == 0 or valued.all() or not valued.any():
        return
    from scipy.ndimage import distance_transform_edt

    row, column = distance_transform_edt(~valued, return_distances=False, return_indices=True)
    columns = np.arange(values.shape[1])
    for begin in range(0, len(values), ROWS):
        part = slice(begin, begin + ROWS)
        rows = np.arange(begin, min(begin + ROWS, len(values)))[:, None]
        far = (row[part] - rows) ** 2 + (column[part] - columns) ** 2 > padding * padding
        # Only texels without a value change, and only those with one are read.
        new = ~(far | valued[part])
        values[part][new] = values[row[part][new], column[part][new]]
