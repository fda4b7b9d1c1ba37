"""Rays, and all their intersections with meshes, in float64: pixel rays of a camera, and any others.

Every test is made in the plane of the picture: seen along its ray, a pixel sends each vertex to one 2D point, which all
faces at that vertex share. The sign of each edge function of these points is exact, and exact ties are broken by moving
the ray by a symbolic, infinitely small step. So each ray crosses a closed surface inwards as often as outwards,
whatever vertices and edges it passes through. Light paths do not come in pictures, so each of their rays has a plane of
its own: the mesh is shifted to its origin and sheared along it (Woop et al. 2013).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.geometry.bvh import curve_order
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import point_from
from translucent.scene.camera import Camera, check_size
from translucent.scene.scene import Object, Scene


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays by index; all arrays are flat.

    Attributes
    ----------
    origins : (n, 3) float64
        In metres from the eye, along the axes of the world; zero for a perspective camera.
    directions : (n, 3) float64
        Unit vectors.
    backdrop : (n, 2) float64
        Position in the picture, right and down from the top left corner, in heights of the picture.
    """

    origins: Array
    directions: Array
    backdrop: Array

    def __len__(self) -> int:
        return len(self.directions)

    def where(self, chosen: Integers | slice) -> Rays:
        """Selection of rays by indices or a slice, renumbered."""
        return Rays(self.origins[chosen], self.directions[chosen], self.backdrop[chosen])

    @staticmethod
    def joined(parts: Sequence[Rays]) -> Rays:
        """All rays of one part after another."""
        return Rays(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Rays)))


def pixel_rays(
    camera: Camera, size: tuple[int, int], offset: tuple[float, float] | tuple[Array, Array] = (0.0, 0.0)
) -> Rays:
    """Rays of all pixels; the index of a ray is row * width + column.

    Parameters
    ----------
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift from the pixel centers, in pixels: of all the same, or (h, w) each.
    """
    at_origin = camera.pose.copy()
    at_origin[:3, 3] = 0.0
    origins, directions = replace(camera, pose=at_origin).rays(size, offset)
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    left, top, _, more_rows = camera.beyond(size)
    shift = np.stack([np.ravel(part) for part in offset], axis=-1)
    backdrop = (np.stack([column + left, row + top], axis=-1) + 0.5 + shift) / (size[1] + more_rows)
    return Rays(origins.reshape(-1, 3), directions.reshape(-1, 3), backdrop)


_Arrays = tuple[npt.NDArray[np.generic], ...]

#: Pairs of a triangle and a pixel that are tested at a time: the working arrays stay below 20 MB.
CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class Hits:
    """Crossings of rays with a surface: flat arrays, sorted by pixel, then distance, entries before exits.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray: row * width + column.
    distance : (k,) float64
        In metres along the unit ray from its origin.
    sign : (k,) int8
        +1 where the ray enters the body, -1 where it leaves.
    face : (k,) int64
        Index into the mesh's faces.
    barycentric : (k, 3) float64
        Weights of the face's corners, >= 0, with sum 1.
    """

    pixel: Integers
    distance: Array
    sign: npt.NDArray[np.int8]
    face: Integers
    barycentric: Array

    def where(self, keep: npt.NDArray[np.bool_] | Integers | slice) -> Hits:
        """Selection of hits by a mask (k,), indices or a slice."""
        return Hits(self.pixel[keep], self.distance[keep], self.sign[keep], self.face[keep], self.barycentric[keep])

    def on_rays(self, chosen: Integers, rays: int) -> Hits:
        """Hits on the `chosen` of so many rays, with these renumbered from 0."""
        number = np.full(rays, -1)
        number[chosen] = np.arange(len(chosen))
        kept = self.where(number[self.pixel] >= 0)
        return replace(kept, pixel=number[kept.pixel])

    def before(self, end: Array) -> Hits:
        """Hits ahead of the origins, up to the distance `end` (pixels,) where each ray stops."""
        return self.where((self.distance >= 0) & (self.distance < end[self.pixel]))


def camera_hits(mesh: Mesh, matrix: npt.ArrayLike, camera: Camera, size: tuple[int, int]) -> Hits:
    """All surfaces of a mesh in front of the origins of the pixel rays.

    Parameters
    ----------
    mesh : Mesh
    matrix : array_like (4, 4)
        Object to world.
    camera : Camera
    size : (width, height)
        In pixels.
    """
    line = line_hits(mesh, matrix, camera, size)
    return line.where(line.distance >= 0)


def line_hits(mesh: Mesh, matrix: npt.ArrayLike, camera: Camera, size: tuple[int, int]) -> Hits:
    """All surfaces of a mesh on the pixel rays, including those behind the origins at negative distances."""
    size = check_size(size)
    body = Object(mesh, transform=matrix)
    corners = camera_vertices(mesh, body.matrix, camera)[mesh.faces]
    # Homogeneous: perspective divides by the depth, an orthographic camera by 1.
    weight = corners[..., 2] if camera.fov_y is not None else np.ones(corners.shape[:2])
    grid = PictureGrid.of(camera, size)
    parts: list[_Arrays] = []
    # What is behind the eye appears in the picture as well, turned around: the same box around the negated points.
    for side in (1, -1):
        for face, row, column in _candidates(grid, side * corners, side * weight, size):
            keep, *found = cross_triangles(
                corners[face], weight[face], grid.points(row, column), camera.fov_y is not None
            )
            parts.append(((row * size[0] + column)[keep], face[keep], *found))
    return sorted_hits(parts, -1 if body.faces_inwards else 1)


@dataclass(frozen=True)
class PictureGrid:
    """Pixel centers in the picture's plane: at distance 1 for a perspective camera, in metres for the other."""

    center: Array
    scale: Array

    @classmethod
    def of(cls, camera: Camera, size: tuple[int, int]) -> PictureGrid:
        """The grid of a picture of this size."""
        extent = np.array(camera.half_extent(size)) * (2.0, -2.0)
        aside, above = camera.center(size)
        return cls((np.array(size) - 1 - np.array(size) * (aside, -above)) / 2, extent / size)

    def points(self, row: Integers, column: Integers) -> Array:
        """(k, 2): right and up."""
        return (np.stack([column, row], axis=-1) - self.center) * self.scale

    def pixels(self, points: Array, weight: Array) -> Array:
        """(..., 2): homogeneous column and row of homogeneous points (..., 2) with `weight` (...,)."""
        return points / self.scale + weight[..., None] * self.center


def world_normals(body: Object, face: Integers) -> Array:
    """(k, 3): unit normals of faces in the world, to the side from which the mesh has them counter-clockwise."""
    normals = body.mesh.face_normals[face] @ np.linalg.inv(body.matrix[:3, :3])
    length = np.linalg.norm(normals, axis=1)
    return np.asarray(normals / np.where(length > 0, length, 1.0)[:, None])


def camera_vertices(mesh: Mesh, matrix: Array, camera: Camera) -> Array:
    """(n, 3): vertices right of, above and in front of the eye, in metres."""
    # The mesh keeps its shape to the last digit wherever it is: only the one offset to the eye is large.
    world = _rotate(matrix[:3, :3], mesh.vertices - mesh.center) + point_from(mesh.center, matrix, camera.eye)
    return _rotate(np.stack([camera.right, camera.up, camera.forward]), world)


def _rotate(matrix: Array, vectors: Array) -> Array:
    """Product matrix @ v for each v; unlike a matrix product, equal vectors give bit-equal results wherever they
    stand.
    """
    x, y, z = vectors.T
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=-1)


def _candidates(
    grid: PictureGrid, corners: Array, weight: Array, size: tuple[int, int]
) -> Iterator[tuple[Integers, Integers, Integers]]:
    """Chunks of face, row and column: all pixels in the bounding box of each face's part with positive weight."""
    pixels = grid.pixels(corners[..., :2], weight)
    first_column, columns = pixel_span(pixels[..., 0], weight, size[0])
    first_row, rows = pixel_span(pixels[..., 1], weight, size[1])
    ends = np.cumsum(columns * rows)
    for begin in range(0, int(ends[-1]), CHUNK):
        pair = np.arange(begin, min(begin + CHUNK, int(ends[-1])))
        face = np.searchsorted(ends, pair, side="right")
        inside = pair - (ends - columns * rows)[face]
        yield face, first_row[face] + inside // columns[face], first_column[face] + inside % columns[face]


def pixel_span(coordinate: Array, weight: Array, count: int) -> tuple[Integers, Integers]:
    """(m,), (m,): the first pixel and the number of pixels along one axis that faces (m, 3) may cover."""
    front = weight > 0
    with np.errstate(over="ignore"):
        ratio = coordinate / np.where(front, weight, 1.0)
    low = np.where(front, ratio, np.inf).min(axis=1)
    high = np.where(front, ratio, -np.inf).max(axis=1)
    # A face within the eye's plane is seen only from a point on it, and then everywhere.
    around = (weight == 0).all(axis=1) & (coordinate.min(axis=1) <= 0) & (coordinate.max(axis=1) >= 0)
    low[around], high[around] = -np.inf, np.inf
    for i, j in ((0, 1), (1, 2), (2, 0)):
        # An edge that passes the eye's plane runs to infinity, in the direction of the point where it does.
        crosses = front[:, i] != front[:, j]
        a, b = coordinate[:, i] * np.abs(weight[:, j]), coordinate[:, j] * np.abs(weight[:, i])
        noise = 1e-12 * (np.abs(a) + np.abs(b))
        low[crosses & (a + b <= noise)] = -np.inf
        high[crosses & (a + b >= -noise)] = np.inf
    margin = 1e-9 * (count + 1)
    first = np.maximum(np.ceil(np.clip(low, -1, count) - margin), 0).astype(np.int64)
    last = np.minimum(np.floor(np.clip(high, -1, count) + margin), count - 1).astype(np.int64)
    return first, np.maximum(last - first + 1, 0)


def cross_triangles(corners: Array, weight: Array, points: Array, perspective: bool) -> tuple[Integers, *_Arrays]:
    """Cross triangles (k, 3, 3) with the lines through picture points (k, 2), pair by pair.

    Returns the indices of the pairs that do, and for each its distance, sign and barycentric weights.
    """
    # Seen along the ray, relative to it. Only this step rounds, and alike for all faces at a vertex.
    relative = corners[..., :2] - weight[..., None] * points[:, None, :]
    a, b = relative[:, (1, 2, 0)], relative[:, (2, 0, 1)]
    with np.errstate(under="ignore"):
        rough = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        maybe = np.flatnonzero((rough >= 0).all(axis=1) | (rough <= 0).all(axis=1))
        sign, area = _edge_functions(a[maybe], b[maybe])
    inside = np.abs(sign.sum(axis=1)) == 3
    keep, area = maybe[inside], area[inside]
    barycentric = area / area.sum(axis=1, keepdims=True)
    depths = corners[keep, :, 2]
    # From the first corner, so that it is exact where the depths are equal.
    depth = depths[:, 0] + ((depths[:, 1:] - depths[:, :1]) * barycentric[:, 1:]).sum(axis=1)
    length = np.sqrt(1.0 + (points[keep] ** 2).sum(axis=1)) if perspective else 1.0
    return keep, depth * length, sign[inside, 0], barycentric


def _edge_functions(a: Array, b: Array) -> tuple[npt.NDArray[np.int8], Array]:
    """Exact sign of the cross product a x b (..., 2), and its size; a tie is decided by moving the ray.

    Rounding is monotone, so the rounded products decide which is larger unless they are equal; then their errors do.
    The ray moves by (e, e^2), e -> 0: a x b changes by -e (b - a)_y + e^2 (b - a)_x. The sign is 0 where a = b.
    """
    left, right = a[..., 0] * b[..., 1], a[..., 1] * b[..., 0]
    rest = _product_error(a[..., 0], b[..., 1], left) - _product_error(a[..., 1], b[..., 0], right)
    sign = np.sign(left - right)
    for tie in (rest, a[..., 1] - b[..., 1], b[..., 0] - a[..., 0]):
        sign = np.where(sign == 0, np.sign(tie), sign)
    return sign.astype(np.int8), np.abs((left - right) + rest)


def _product_error(a: Array, b: Array, product: Array) -> Array:
    """a b - product, exactly (Dekker 1971)."""
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    return a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _halves(value: Array) -> tuple[Array, Array]:
    """`value` as a sum of two numbers of 26 bits (Veltkamp)."""
    scaled = value * (2.0**27 + 1.0)
    high = scaled - (scaled - value)
    return high, value - high


def sorted_hits(parts: list[_Arrays], outwards: int) -> Hits:
    """Merge parts, each hit once; `outwards` is -1 where the faces look into the body."""
    nothing = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0, np.int8), np.empty((0, 3)))
    pixel, face, distance, sign, barycentric = (np.concatenate(arrays) for arrays in zip(nothing, *parts, strict=True))
    sign = (sign * outwards).astype(np.int8)
    order = np.lexsort((face, -sign, distance, pixel))
    hits = Hits(pixel, distance, sign, face, barycentric).where(order)
    # A face that passes the eye may have a pixel in both of its boxes.
    new = (np.diff(hits.pixel, prepend=-1) != 0) | (np.diff(hits.face, prepend=-1) != 0)
    return hits.where(new)


#: Number of children of a node.
BRANCHES = 8

#: Number of lines that walk down the tree together: the working arrays stay below 100 MB.
LINES_AT_A_TIME = 1 << 12

#: Pairs of a line and a node that are tested together: what NumPy keeps of them stays in the caches of a processor.
PAIRS = 1 << 10

#: Enlargement of boxes as a fraction of the distances, so that rounding loses no triangle.
BOX_MARGIN = 1e-13

#: Half size of an empty box, which no line hits.
_NOTHING = -1e300


@dataclass(frozen=True, eq=False)
class Lines:
    """Line segments, each from one distance to another.

    Attributes
    ----------
    origins, directions : (n, 3) float64
        In metres, and of unit length.
    start, end : (n,) float64
        Distances from the origin in metres; -inf and inf for all of the line.
    """

    origins: Array
    directions: Array
    start: Array
    end: Array

    def __len__(self) -> int:
        return len(self.directions)

    def where(self, chosen: Integers | slice) -> Lines:
        """Selection of lines by indices or a slice, renumbered."""
        return Lines(self.origins[chosen], self.directions[chosen], self.start[chosen], self.end[chosen])


@dataclass(frozen=True, eq=False)
class BoxTree:
    """Bounding volume hierarchy of triangles.

    Attributes
    ----------
    order : (m,) int64
        The triangle in each box of the lowest level.
    levels : tuple of (nodes, 6, 8) float64
        From the lowest level up: center and half size of the children of each node.
    """

    order: Integers
    levels: tuple[Array, ...]

    @classmethod
    def of(cls, corners: Array) -> BoxTree:
        """Build the tree of triangles (m, 3, 3), in the order of a space-filling curve (Morton 1966)."""
        low, high = corners.min(axis=1), corners.max(axis=1)
        order = curve_order(low, high)
        low, high = low[order], high[order]
        levels = []
        while True:
            starts = np.arange(0, len(low), BRANCHES)
            levels.append(_grouped(0.5 * (low + high), 0.5 * (high - low), len(starts)))
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            if len(starts) == 1:
                return cls(order, tuple(levels))

    def candidates(self, lines: Lines) -> Iterator[tuple[Integers, Integers]]:
        """Chunks of pairs (k,), (k,) of a line and a triangle that may intersect; all that do are among them."""
        for begin in range(0, len(lines), LINES_AT_A_TIME):
            line, triangle = self._walk(lines.where(slice(begin, begin + LINES_AT_A_TIME)))
            yield line + begin, triangle

    @np.errstate(under="ignore", over="ignore")
    def _walk(self, lines: Lines) -> tuple[Integers, Integers]:
        line, node = np.arange(len(lines)), np.zeros(len(lines), dtype=np.int64)
        slack = BOX_MARGIN * (
            np.abs(lines.origins).sum(axis=1) + np.abs(self.levels[-1][0]).max(where=self._real, initial=0)
        )
        for level in reversed(self.levels):
            hit = [np.empty((2, 0), np.int64)]
            for begin in range(0, len(line), PAIRS):
                some, nodes = line[begin : begin + PAIRS], node[begin : begin + PAIRS]
                pair, child = np.nonzero(_overlaps(lines.where(some), level[nodes], slack[some]))
                hit.append(np.array([some[pair], nodes[pair] * BRANCHES + child]))
            line, node = np.concatenate(hit, axis=1)
        return line, self.order[node]

    @property
    def _real(self) -> npt.NDArray[np.bool_]:
        """(6, 8): mask of the children that the root has."""
        return np.broadcast_to(self.levels[-1][0, 3] != _NOTHING, (6, BRANCHES))


def _overlaps(lines: Lines, boxes: Array, slack: Array) -> npt.NDArray[np.bool_]:
    """(k, 8): whether lines may hit boxes (k, 6, 8), by the axes that could separate them (Gottschalk et al. 1996)."""
    x, y, z = (boxes[:, i] - lines.origins[:, i, None] for i in range(3))
    a, b, c = (boxes[:, i] for i in range(3, 6))
    u, v, w = (lines.directions[:, i, None] for i in range(3))
    p, q, r, s = np.abs(u), np.abs(v), np.abs(w), slack[:, None]
    along, reach = x * u + y * v + z * w, a * p + b * q + c * r + s
    overlaps = (along + reach >= lines.start[:, None]) & (along - reach <= lines.end[:, None])
    overlaps &= np.abs(y * w - z * v) <= b * r + c * q + s
    overlaps &= np.abs(z * u - x * w) <= c * p + a * r + s
    overlaps &= np.abs(x * v - y * u) <= a * q + b * p + s
    return np.asarray(overlaps)


def _grouped(center: Array, half: Array, nodes: int) -> Array:
    """(nodes, 6, 8): centers and half sizes (n, 3) of neighbors together; the last node may lack some."""
    children = np.zeros((nodes * BRANCHES, 6))
    children[:, 3:] = _NOTHING
    children[: len(center)] = np.hstack([center, half])
    return np.ascontiguousarray(children.reshape(nodes, BRANCHES, 6).transpose(0, 2, 1))


#: Enlargement of the scene's bounding sphere, as a fraction.
MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class TracedObject:
    """Object for ray casting, in metres from the eye.

    Attributes
    ----------
    body : Object
    corners : (m, 3, 3) float64
        Of its faces.
    """

    body: Object
    corners: Array

    @classmethod
    def of(cls, body: Object, eye: Array) -> TracedObject:
        """Object relative to `eye` (3,)."""
        x, y, z = (body.mesh.vertices - body.mesh.center).T[:, :, None] * body.matrix[:3, :3].T[:, None]
        # The mesh keeps its shape to the last digit wherever it is: only the one offset to the eye is large.
        corners = (x + y + z + point_from(body.mesh.center, body.matrix, eye))[body.mesh.faces]
        return cls(body, corners)

    @cached_property
    def tree(self) -> BoxTree:
        """Bounding volume hierarchy of the faces."""
        return BoxTree.of(self.corners)

    def hits(self, lines: Lines) -> Hits:
        """All surfaces on the lines; `Hits.pixel` is the number of the line."""
        hits = self.crossings(lines, self.tree.candidates(lines))
        return hits.where((hits.distance >= lines.start[hits.pixel]) & (hits.distance <= lines.end[hits.pixel]))

    def crossings(self, lines: Lines, candidates: Iterable[tuple[Integers, Integers]]) -> Hits:
        """Intersections of candidate pairs (k,), (k,) of a line and a face, anywhere on the line."""
        parts = []
        for line, face in candidates:
            sheared = _sheared(self.corners[face] - lines.origins[line, None], lines.directions[line])
            keep, *found = cross_triangles(
                sheared, np.ones(sheared.shape[:2]), np.zeros((len(sheared), 2)), perspective=False
            )
            parts.append((line[keep], face[keep], *found))
        return sorted_hits(parts, -1 if self.body.faces_inwards else 1)


class SceneTracer:
    """Ray caster for all objects of a scene.

    Parameters
    ----------
    scene : Scene
        Points are in metres from the eye of its camera, along the axes of the world.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.objects = [TracedObject.of(body, scene.camera.eye) for body in scene.objects]
        low = np.min([traced.corners.min(axis=(0, 1)) for traced in self.objects], axis=0)
        high = np.max([traced.corners.max(axis=(0, 1)) for traced in self.objects], axis=0)
        self.center = 0.5 * (low + high)
        self.radius = 0.5 * float(np.linalg.norm(high - low)) * (1.0 + MARGIN)

    def hits(self, lines: Lines) -> list[Hits]:
        """The surfaces of each object on the lines."""
        return [traced.hits(lines) for traced in self.objects]

    def ball(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Entry and exit of lines in the scene's bounding sphere: distances (n,), equal for lines that miss it."""
        to_center = self.center - origins
        middle = np.einsum("ki,ki->k", to_center, directions)
        across = np.linalg.norm(to_center - middle[:, None] * directions, axis=1)
        half = np.sqrt(np.maximum((self.radius - across) * (self.radius + across), 0.0))
        return middle - half, middle + half


def _sheared(vectors: Array, directions: Array) -> Array:
    """(k, 3, 3): vectors (k, 3, 3) in the frame of unit directions (k, 3): right, up, and the distance along the ray.

    Equal vectors give bit-equal results whatever triangle they belong to.
    """
    rows = np.arange(len(directions))
    forward = np.abs(directions).argmax(axis=1)
    right, up = (forward + 1) % 3, (forward + 2) % 3
    # As a camera does, look along -z of a right-handed frame.
    away = directions[rows, forward] > 0
    right, up = np.where(away, up, right), np.where(away, right, up)
    depth = directions[rows, forward][:, None]
    x, y, z = (vectors[rows, :, axis] for axis in (right, up, forward))
    with np.errstate(under="ignore"):
        distance = z / depth
        shear = directions[rows, right][:, None], directions[rows, up][:, None]
        return np.stack([x - shear[0] * distance, y - shear[1] * distance, distance], axis=-1)
