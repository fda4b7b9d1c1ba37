"""Complete intersections of pixel rays with a mesh: found by Embree, decided in float64, and proved complete.

The result is that of `translucent.reference.line_hits`, to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers, Mask
from translucent.cpu.outline import Edges, Outline
from translucent.cpu.picture import Band, Picture
from translucent.cpu.projection import PAIRS, ProjectedObject
from translucent.geometry.embree import EmbreeMesh
from translucent.geometry.mesh import Mesh
from translucent.reference.hits import Hits, from_eye
from translucent.scene.camera import Camera
from translucent.scene.scene import Object


@dataclass(frozen=True, eq=False)
class TracedMesh:
    """Mesh prepared for ray tracing, independent of the camera."""

    embree: EmbreeMesh
    edges: Edges

    @classmethod
    def of(cls, mesh: Mesh) -> TracedMesh:
        """Prepare a mesh; raises `RenderError` if embreex cannot be imported."""
        return cls(EmbreeMesh(mesh), Edges.of(mesh))


class Tracer:
    """Tracer of all surfaces of one object in one picture. Any number of threads may ask at once.

    Parameters
    ----------
    traced : TracedMesh
        Of the object's mesh.
    body : Object
    picture : Picture
    """

    def __init__(self, traced: TracedMesh, body: Object, picture: Picture) -> None:
        self.embree = traced.embree
        self._seen = ProjectedObject(body, picture)
        self._outline = Outline.of(self._seen, traced.edges)
        self._eye, self._axes = _camera_in_ball(traced.embree, body, picture.camera)

    def hits(self, band: Band) -> Hits:
        """All surfaces on the rays of a band, as `line_hits` gives them; pixels count from the first of the band."""
        found, incomplete = self.search(band)
        if not incomplete.any():
            return found
        # Where the proof fails, every face that may cover the pixel is tried.
        rest = self._seen.meet(band, self._seen.boxed_pairs(band, incomplete))
        both = _joined([found.where(~incomplete[found.pixel]), rest])
        return both.where(np.argsort(both.pixel, kind="stable"))

    def search(self, band: Band) -> tuple[Hits, Mask]:
        """Hits that Embree finds, decided in float64, and (pixels,): rays whose hits are not proved complete."""
        expected, incomplete = self._outline.counts(band)
        pixel = np.flatnonzero((expected > 0) & ~incomplete)
        passing = self._seen.passing
        ray, face = self.embree.candidates(*self.rays(band, pixel), expected[pixel], ~passing)
        pairs = _sliced(pixel[ray], face)
        if self._seen.any_passing:
            # These are not expected, for they have no outline; there are few of them, and all are tried.
            proper = ~passing[face]
            everywhere = np.ones(band.pixels, dtype=bool)
            pairs = chain(_sliced(pixel[ray[proper]], face[proper]), self._seen.boxed_pairs(band, everywhere, passing))
        hits = self._seen.meet(band, pairs)
        found = np.bincount(hits.pixel[~passing[hits.face]], minlength=band.pixels)
        return hits, incomplete | (found != expected)

    def rays(self, band: Band, pixel: Integers) -> tuple[Array, Array]:
        """Origins and unit directions (k, 3) of the rays of pixels (k,), in the ball of `EmbreeMesh`."""
        points = self._seen.picture.points(band, pixel)
        across = points[:, :1] * self._axes[0] + points[:, 1:] * self._axes[1]
        if self._seen.picture.perspective:
            origins, directions = np.broadcast_to(self._eye, across.shape), across + self._axes[2]
        else:
            origins, directions = self._eye + across, np.broadcast_to(self._axes[2], across.shape)
        return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def embree_hits(
    mesh: Mesh,
    matrix: npt.ArrayLike,
    camera: Camera,
    size: tuple[int, int],
    offset: tuple[float, float] = (0.0, 0.0),
) -> Hits:
    """All surfaces of a mesh on the pixel rays, ahead of their origins and behind, as `line_hits` gives them.

    Parameters
    ----------
    mesh : Mesh
    matrix : array_like (4, 4)
        Object to world.
    camera : Camera
    size : (width, height)
        In pixels.
    offset : (right, down)
        Shift of the rays from the pixel centers, in pixels.

    Raises
    ------
    InputError
        If the mesh, the matrix or the size cannot be used.
    RenderError
        If embreex cannot be imported.
    """
    body, picture = Object(mesh, transform=matrix), Picture.of(camera, size, offset)
    tracer = Tracer(TracedMesh.of(mesh), body, picture)
    parts = []
    for band in picture.bands():
        hits = tracer.hits(band)
        parts.append(replace(hits, pixel=hits.pixel + band.first_row * band.width))
    return _joined(parts)


def _camera_in_ball(embree: EmbreeMesh, body: Object, camera: Camera) -> tuple[Array, Array]:
    """The eye (3,) and the camera's axes (3, 3), one a row, in the ball of a mesh."""
    linear = body.matrix[:3, :3]
    axes = np.stack([-from_eye(embree.center, body.matrix, camera), camera.right, camera.up, camera.forward])
    eye, *rows = np.linalg.solve(linear, axes.T).T / embree.radius
    return eye, np.stack(rows)


def _sliced(pixel: Integers, face: Integers) -> Iterator[tuple[Integers, Integers]]:
    for begin in range(0, len(pixel), PAIRS):
        yield pixel[begin : begin + PAIRS], face[begin : begin + PAIRS]


def _joined(parts: list[Hits]) -> Hits:
    return Hits(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Hits)))
