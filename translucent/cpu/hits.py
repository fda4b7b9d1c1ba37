"""Rays of a picture and all their intersections with meshes: found by Embree, decided in float64, and proved complete.

The hits are those of `translucent.reference.line_hits`, to the last bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import chain

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask, expanded, slices
from translucent.files.reading import require_memory
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import NEAREST, RayCaster, SceneRayCaster, point_from
from translucent.reference.hits import (
    Hits,
    Lines,
    PictureGrid,
    Rays,
    TracedObject,
    camera_vertices,
    cross_triangles,
    pixel_span,
    sorted_hits,
)
from translucent.scene.camera import Camera, check_size
from translucent.scene.scene import Object

#: Bytes of memory that each pixel takes, at least: the arrays of a frame.
_PIXEL_BYTES = 100

#: Pixels of a band: enough to hide Python's own time, few enough that the working arrays stay below 50 MB.
BAND = 1 << 15

#: Rows of a band: of a narrow picture, too, an edge must not cross too many at a time.
BAND_ROWS = 256


@dataclass(frozen=True)
class Band:
    """Whole rows of a picture. Its pixels count from 0 at its first one: row * width + column, as those of its hits.

    Attributes
    ----------
    first_row, rows, width : int
    """

    first_row: int
    rows: int
    width: int

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.rows * self.width


@dataclass(frozen=True, eq=False)
class PictureRays:
    """Pixel rays of a camera, by bands of rows.

    Attributes
    ----------
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift of the rays from the pixel centers, in pixels.
    grid : PictureGrid
        The points of the picture's plane through which they pass.
    """

    camera: Camera
    size: tuple[int, int]
    offset: tuple[float, float]
    grid: PictureGrid

    @classmethod
    def of(cls, camera: Camera, size: tuple[int, int], offset: tuple[float, float] = (0.0, 0.0)) -> PictureRays:
        """Picture of a camera; raises `InputError` if the size is invalid."""
        width, height = check_size(size)
        found = f"{width * height / 1e6:.0f} million pixels"
        require_memory(f"frame size {width}x{height}", found, _PIXEL_BYTES * width * height, "give a smaller size")
        centered = PictureGrid.of(camera, size)
        return cls(camera, size, offset, PictureGrid(centered.center - offset, centered.scale))

    @property
    def perspective(self) -> bool:
        """True for a perspective camera, False for an orthographic one."""
        return self.camera.fov_y is not None

    def bands(self) -> Iterator[Band]:
        """Bands of the picture from top to bottom."""
        width, height = self.size
        rows = min(max(BAND // width, 1), BAND_ROWS)
        for first in range(0, height, rows):
            yield Band(first, min(rows, height - first), width)

    def points(self, band: Band, pixel: Integers) -> Array:
        """(k, 2): positions of the rays of pixels (k,) in the picture's plane, right and up."""
        row, column = np.divmod(pixel, band.width)
        return self.grid.points(row + band.first_row, column)

    def rays(self, band: Band) -> Rays:
        """The rays of a band, as `pixel_rays` has them."""
        pixel = np.arange(band.pixels)
        points, camera = self.points(band, pixel), self.camera
        across = points[:, :1] * camera.right + points[:, 1:] * camera.up
        row, column = np.divmod(pixel, band.width)
        left, top, _, more_rows = camera.beyond(self.size)
        place = np.stack([column + left, row + band.first_row + top], axis=-1)
        backdrop = (place + 0.5 + self.offset) / (self.size[1] + more_rows)
        if not self.perspective:
            return Rays(across, np.broadcast_to(camera.forward, across.shape), backdrop)
        directions = across + camera.forward
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(np.zeros(across.shape), directions, backdrop)


_Pairs = tuple[Integers, Integers]

#: Largest ratio of sideways distance to depth of a vertex that is projected; beyond, it is too near the eye's plane.
STEEPEST = 1e6

#: Pairs of a pixel and a face that are decided at a time: the working arrays stay in the processor's cache.
PAIRS = 1 << 13


@dataclass(frozen=True, eq=False)
class ProjectedObject:
    """Object projected into the image plane of a camera."""

    body: Object
    picture: PictureRays

    @cached_property
    def vertices(self) -> Array:
        """(n, 3): vertices right of, above and in front of the eye, in metres."""
        return camera_vertices(self.body.mesh, self.body.matrix, self.picture.camera)

    @cached_property
    def corners(self) -> Array:
        """(m, 3, 3): `vertices` of each face."""
        return self.vertices[self.body.mesh.faces]

    @cached_property
    def weight(self) -> Array:
        """(m, 3): perspective divisors of the corners."""
        return self.corners[..., 2] if self.picture.perspective else np.ones(self.corners.shape[:2])

    @cached_property
    def beside(self) -> Mask:
        """(n,): vertices in the plane of the eye, or nearly, which have no projection."""
        if not self.picture.perspective:
            return np.zeros(len(self.vertices), dtype=bool)
        return np.asarray(np.abs(self.vertices[:, :2]).max(axis=1) >= STEEPEST * np.abs(self.vertices[:, 2]))

    @cached_property
    def passing(self) -> Mask:
        """(m,): faces that cross the plane of the eye, or nearly, whose projections are no triangles."""
        front = self.weight > 0
        return np.asarray(self.beside[self.body.mesh.faces].any(axis=1) | (front.any(axis=1) != front.all(axis=1)))

    @cached_property
    def any_passing(self) -> bool:
        """True if any faces are `passing`."""
        return bool(self.passing.any())

    @cached_property
    def projected(self) -> Array:
        """(n, 2): column and row of the vertices; meaningless for those `beside` the eye."""
        depth = self.vertices[:, 2] if self.picture.perspective else np.ones(len(self.vertices))
        weight = np.where(self.beside, 1.0, depth)
        return np.asarray(self.picture.grid.pixels(self.vertices[:, :2], weight) / weight[:, None])

    def interact(self, band: Band, pairs: Iterator[_Pairs]) -> Hits:
        """Pairs of a pixel and a face in which the ray hits the face, each once, sorted as by `line_hits`."""
        parts = []
        for pixel, face in pairs:
            points = self.picture.points(band, pixel)
            keep, *found = cross_triangles(self.corners[face], self.weight[face], points, self.picture.perspective)
            parts.append((pixel[keep], face[keep], *found))
        return sorted_hits(parts, -1 if self.body.faces_inwards else 1)

    def boxed_pairs(self, band: Band, requested: Mask, chosen: Mask | None = None) -> Iterator[_Pairs]:
        """Candidate pairs of a `requested` pixel (pixels,) and a face, or a `chosen` one (m,), by the faces' bounding
        boxes.
        """
        face, top, rows, left, columns = self._boxes
        pixels = np.flatnonzero(requested)
        before = np.concatenate([[0], np.cumsum(requested)])
        start = np.clip(top - band.first_row, 0, band.rows)
        stop = np.clip(top + rows - band.first_row, 0, band.rows)
        keep = before[start * band.width] < before[stop * band.width]
        if chosen is not None:
            keep &= chosen[face]
        box = np.flatnonzero(keep)
        part, row = expanded(start[box], stop[box] - start[box])
        box = box[part]
        first = row * band.width + left[box]
        low, high = before[first], before[first + columns[box]]
        for some in slices(high - low, PAIRS):
            part, index = expanded(low[some], high[some] - low[some])
            yield pixels[index], face[box[some][part]]

    @cached_property
    def _boxes(self) -> tuple[Integers, ...]:
        """Face, first row, rows, first column and columns of the pixels that faces may cover, ahead or behind."""
        parts = []
        # What is behind the eye appears in the picture as well, turned around.
        for side in (1, -1) if self.picture.perspective else (1,):
            pixels = self.picture.grid.pixels(side * self.corners[..., :2], side * self.weight)
            left, columns = pixel_span(pixels[..., 0], side * self.weight, self.picture.size[0])
            top, rows = pixel_span(pixels[..., 1], side * self.weight, self.picture.size[1])
            face = np.flatnonzero((columns > 0) & (rows > 0))
            parts.append((face, *(array[face] for array in (top, rows, left, columns))))
        return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


#: Generous bound of the relative rounding of positions in the picture: doubt costs time, and errors lose surfaces.
ROUNDING = 1e-11

#: Pairs of an edge and a row that are handled at a time: the working arrays stay below 10 MB.
CROSSINGS = 1 << 16


@dataclass(frozen=True, eq=False)
class Edges:
    """Unique edges of a mesh.

    Attributes
    ----------
    ends : (e, 2) int64
        Vertices, the lower number first.
    edge : (m, 3) int64
        Number of the edge that follows each corner of a face.
    turn : (m, 3) int8
        1 where the face runs along it from the first vertex to the second, -1 where against it.
    """

    ends: Integers
    edge: Integers
    turn: npt.NDArray[np.int8]

    @classmethod
    def of(cls, mesh: Mesh) -> Edges:
        """The edges of a mesh."""
        start = mesh.faces.astype(np.int64)
        end = np.roll(start, -1, axis=1)
        key = np.minimum(start, end) * len(mesh.vertices) + np.maximum(start, end)
        keys, edge = np.unique(key, return_inverse=True)
        ends = np.stack(np.divmod(keys, len(mesh.vertices)), axis=1)
        return cls(ends, edge.reshape(-1, 3), np.where(start < end, 1, -1).astype(np.int8))


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of a mesh: edges across which the number of faces changes.

    Attributes
    ----------
    start, end : (e, 2) float64
        Column and row; `start` is the upper one.
    change : (e,) float64
        How many faces more there are to the right of the edge than to the left.
    """

    start: Array
    end: Array
    change: Array

    @classmethod
    def of(cls, projection: ProjectedObject, edges: Edges) -> Outline:
        """Outline of the object in the picture, without the faces that pass the eye."""
        a, b, c = projection.projected[projection.body.mesh.faces].transpose(1, 2, 0)
        with np.errstate(under="ignore"):
            clockwise = np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).astype(np.int8)
        clockwise[projection.passing] = 0
        net = np.bincount(edges.edge.ravel(), (clockwise[:, None] * edges.turn).ravel(), len(edges.ends))
        chosen = np.flatnonzero(net)
        first, second = projection.projected[edges.ends[chosen]].transpose(1, 0, 2)
        # Rows count downwards: a face that appears clockwise lies to the right of its sides that go up.
        upwards = second[:, 1] < first[:, 1]
        start, end = np.where(upwards[:, None], (second, first), (first, second))
        return cls(start, end, np.where(upwards, net[chosen], -net[chosen]))

    def counts(self, band: Band) -> tuple[Integers, Mask]:
        """(pixels,), (pixels,): number of faces over each pixel, and mask of pixels next to the outline, where it is in
        doubt.
        """
        tolerance = ROUNDING * (band.width + np.abs(self.start).max(axis=1) + np.abs(self.end).max(axis=1))
        past = band.first_row + band.rows
        first = np.ceil(np.clip(self.start[:, 1] - tolerance, band.first_row, past)).astype(np.int64)
        last = np.floor(np.clip(self.end[:, 1] + tolerance, band.first_row - 1, past - 1)).astype(np.int64)
        rows = np.maximum(last - first + 1, 0)
        # A column more, for what changes to the right of the picture.
        change = np.zeros((2, band.rows * (band.width + 1)))
        for some in slices(rows, CROSSINGS):
            edge, row = expanded(first[some], rows[some])
            self._add_changes(change, band, edge + some.start, row, tolerance[some][edge])
        number, doubt = np.cumsum(change.reshape(2, band.rows, band.width + 1), axis=2)[..., :-1].reshape(2, -1)
        return number.astype(np.int64), doubt > 0

    def _add_changes(self, change: Array, band: Band, edge: Integers, row: Integers, tolerance: Array) -> None:
        """Add the change of the face count at each column, where edges (k,) cross rows (k,)."""
        line = (row - band.first_row) * (band.width + 1)
        size = change.shape[1]
        crossed = (self.start[edge, 1] <= row) & (row < self.end[edge, 1])
        column = np.ceil(np.clip(self._column(edge, row), 0, band.width)).astype(np.int64)
        change[0] += np.bincount((line + column)[crossed], self.change[edge[crossed]], size)
        level = self.start[edge, 1] == self.end[edge, 1]
        near = self._column(edge, row - tolerance), self._column(edge, row + tolerance)
        left, right = np.sort([near[0], np.where(level, self.end[edge, 0], near[1])], axis=0)
        first = np.ceil(np.clip(left - tolerance, 0, band.width)).astype(np.int64)
        past = np.floor(np.clip(right + tolerance, -1, band.width - 1)).astype(np.int64) + 1
        some = first < past
        change[1] += np.bincount((line + first)[some], minlength=size)
        change[1] -= np.bincount((line + past)[some], minlength=size)

    def _column(self, edge: Integers, row: Array | Integers) -> Array:
        """(k,): where edges are at rows (k,), or at the end that is nearest to there."""
        start, end = self.start[edge], self.end[edge]
        height = end[:, 1] - start[:, 1]
        fraction = (np.clip(row, start[:, 1], end[:, 1]) - start[:, 1]) / np.where(height > 0, height, 1.0)
        return np.asarray(start[:, 0] + fraction * (end[:, 0] - start[:, 0]))


@dataclass(frozen=True, eq=False)
class TracedMesh:
    """Mesh prepared for ray tracing, independent of the camera."""

    embree: RayCaster
    edges: Edges

    @classmethod
    def of(cls, mesh: Mesh) -> TracedMesh:
        """Prepare a mesh; raises `RenderError` if embreex cannot be imported."""
        return cls(RayCaster(mesh), Edges.of(mesh))


class PixelTracer:
    """Tracer of all surfaces of one object in one picture, for any number of threads at once.

    Parameters
    ----------
    traced : TracedMesh
        Of the object's mesh.
    body : Object
    picture : Picture
    """

    def __init__(self, traced: TracedMesh, body: Object, picture: PictureRays) -> None:
        self.embree = traced.embree
        self._projection = ProjectedObject(body, picture)
        self._outline = Outline.of(self._projection, traced.edges)
        self._eye, self._axes = _camera_in_ball(traced.embree, body, picture.camera)

    def hits(self, band: Band) -> Hits:
        """All surfaces on the rays of a band, as `line_hits` gives them; pixels count from the first of the band."""
        found, incomplete = self.search(band)
        if not incomplete.any():
            return found
        # Where the proof fails, every face that may cover the pixel is tried.
        rest = self._projection.interact(band, self._projection.boxed_pairs(band, incomplete))
        both = joined_hits([found.where(~incomplete[found.pixel]), rest])
        return both.where(np.argsort(both.pixel, kind="stable"))

    def search(self, band: Band) -> tuple[Hits, Mask]:
        """Hits that Embree finds, decided in float64, and (pixels,): rays whose hits are not proved complete."""
        expected, incomplete = self._outline.counts(band)
        pixel = np.flatnonzero((expected > 0) & ~incomplete)
        passing = self._projection.passing
        ray, face = self.embree.candidates(*self.rays(band, pixel), expected[pixel], ~passing)
        pairs = _sliced(pixel[ray], face)
        if self._projection.any_passing:
            # These are not expected, for they have no outline; there are few of them, and all are tried.
            proper = ~passing[face]
            everywhere = np.ones(band.pixels, dtype=bool)
            pairs = chain(
                _sliced(pixel[ray[proper]], face[proper]), self._projection.boxed_pairs(band, everywhere, passing)
            )
        hits = self._projection.interact(band, pairs)
        found = np.bincount(hits.pixel[~passing[hits.face]], minlength=band.pixels)
        return hits, incomplete | (found != expected)

    def rays(self, band: Band, pixel: Integers) -> tuple[Array, Array]:
        """Origins and unit directions (k, 3) of the rays of pixels (k,), in the ball of `RayCaster`."""
        points = self._projection.picture.points(band, pixel)
        across = points[:, :1] * self._axes[0] + points[:, 1:] * self._axes[1]
        if self._projection.picture.perspective:
            origins, directions = np.broadcast_to(self._eye, across.shape), across + self._axes[2]
        else:
            origins, directions = self._eye + across, np.broadcast_to(self._axes[2], across.shape)
        return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


class ExactRayCaster(SceneRayCaster):
    """Ray caster for the objects of a scene, with a slow search in float64 for rays on which float32 fails."""

    def __init__(self, objects: Sequence[Object]) -> None:
        super().__init__(objects)
        self._bodies = objects

    def nearest_exactly(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """Nearest hits of a few rays in float64, with exact decisions on edges and vertices; see `nearest`."""
        face, distance = np.full((len(origins), self.groups), -1), np.full((len(origins), self.groups), np.inf)
        lines = Lines(origins, directions, np.full(len(origins), NEAREST), np.full(len(origins), np.inf))
        for (group, first), traced in zip(self.places(), self._traced, strict=True):
            hits = traced.hits(lines)
            ray, nearest = np.unique(hits.pixel, return_index=True)
            closer = hits.distance[nearest] < distance[ray, group]
            ray, nearest = ray[closer], nearest[closer]
            face[ray, group], distance[ray, group] = hits.face[nearest] + first, hits.distance[nearest]
        return face, distance

    @cached_property
    def _traced(self) -> list[TracedObject]:
        return [TracedObject(body, self.corners(i)) for i, body in enumerate(self._bodies)]


def _camera_in_ball(caster: RayCaster, body: Object, camera: Camera) -> tuple[Array, Array]:
    """The eye (3,) and the camera's axes (3, 3), one a row, in the ball of a mesh."""
    linear = body.matrix[:3, :3]
    axes = np.stack([-point_from(caster.center, body.matrix, camera.eye), camera.right, camera.up, camera.forward])
    eye, *rows = np.linalg.solve(linear, axes.T).T / caster.radius
    return eye, np.stack(rows)


def _sliced(pixel: Integers, face: Integers) -> Iterator[tuple[Integers, Integers]]:
    for begin in range(0, len(pixel), PAIRS):
        yield pixel[begin : begin + PAIRS], face[begin : begin + PAIRS]


def joined_hits(parts: list[Hits]) -> Hits:
    """Concatenate hits."""
    return Hits(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Hits)))
