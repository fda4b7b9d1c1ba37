"""Ordered segments of rays, each with one mixture of media, by the overlap policy of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.reference.intervals import Intervals
from translucent.reference.sheets import Crossings
from translucent.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of rays between neighboring surfaces: flat arrays, in order along each ray, without overlap.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray; ascending.
    t_enter, t_exit : (k,) float64
        Distances in metres from the ray's origin; equal for a sheet.
    length : (k,) float64
        Metres of the media: t_exit - t_enter, or the path through a sheet.
    extinction : (k, 3) float64
        Of all media there, in 1/m.
    emission : (k, 3) float64
        Of all media there, in radiance per metre.
    count : (k,) int64
        How often thickness counts the length.
    """

    pixel: Integers
    t_enter: Array
    t_exit: Array
    length: Array
    extinction: Array
    emission: Array
    count: Integers


def scene_segments(scene: Scene, intervals: Intervals, crossings: Crossings) -> Segments:
    """Ordered segments of the media on each ray.

    Parameters
    ----------
    scene : Scene
        `Scene.overlap` decides what fills a point in several bodies. A sheet adds to what it stands in.
    intervals : Intervals
        Of solids; bodies are indices into `Scene.objects`.
    crossings : Crossings
        Of sheets; each cuts the piece in which it stands.
    """
    pixel, t_enter, t_exit, bodies, windings = _pieces(intervals, crossings)
    solid = (pixel, t_enter, t_exit, t_exit - t_enter, *mix(scene, bodies, windings))
    at, once = crossings.distance, np.ones(len(crossings.body), dtype=np.int64)
    extinction, emission = _coefficients(scene)
    sheet = (crossings.pixel, at, at, crossings.path, extinction[crossings.body], emission[crossings.body], once)
    columns = [np.concatenate(pair) for pair in zip(solid, sheet, strict=True)]
    # Of two pieces that begin at one point, the sheet goes first: it ends there, too.
    order = np.lexsort((columns[2], columns[1], columns[0]))
    return Segments(*(column[order] for column in columns))


def mix(scene: Scene, bodies: Integers, windings: npt.NDArray[np.int32]) -> tuple[Array, Array, Integers]:
    """Mix of media at points in at least one body, by the overlap policy of the scene.

    Parameters
    ----------
    scene : Scene
    bodies : (b,) int64
        Indices into `Scene.objects`, ascending.
    windings : (b, k) int32
        How often each body winds around each point. Below 0 it fills nothing: such rays are invalid.

    Returns
    -------
    extinction, emission : (k, 3) float64
    count : (k,) int64
        How often thickness counts the point.
    """
    extinction, emission = (table[bodies] for table in _coefficients(scene))
    inside = windings > 0
    if scene.overlap == "add" or not len(bodies):
        times = np.maximum(windings, 0)
        return _total(times, extinction), _total(times, emission), np.asarray(times.sum(axis=0, dtype=np.int64))
    once = np.asarray(inside.any(axis=0), dtype=np.int64)
    if scene.overlap == "union":
        media, medium = np.unique(np.hstack([extinction, emission]), axis=0, return_inverse=True)
        present = np.array([inside[medium.ravel() == i].any(axis=0) for i in range(len(media))])
        return _total(present, media[:, :3]), _total(present, media[:, 3:]), once
    # Bodies of one priority fill their common points alike, so any of them will do.
    order = np.argsort([-scene.objects[i].priority for i in bodies], kind="stable")
    highest = order[inside[order].argmax(axis=0)]
    return extinction[highest] * once[:, None], emission[highest] * once[:, None], once


def _coefficients(scene: Scene) -> tuple[Array, Array]:
    """Extinction and emission of all objects, (n, 3) each; 0 for opaque ones."""
    media = [body.medium for body in scene.objects]
    rows = [(m.extinction, m.emission) if m is not None else np.zeros((2, 3)) for m in media]
    table = np.array(rows, dtype=np.float64)
    return table[:, 0], table[:, 1]


def _total(times: npt.NDArray[np.int32] | npt.NDArray[np.bool_], values: Array) -> Array:
    """(k, 3): at each point, the sum of `values` (b, 3), each as often as `times` (b, k) says."""
    return np.asarray(np.einsum("bk,bc->kc", times.astype(np.float64), values))


def _pieces(
    intervals: Intervals, crossings: Crossings
) -> tuple[Integers, Array, Array, Integers, npt.NDArray[np.int32]]:
    """Pixel, t_enter and t_exit (k,) of the pieces in any body; the bodies (b,), and their windings there (b, k)."""
    bodies, row = np.unique(intervals.body, return_inverse=True)
    pixel = np.concatenate([intervals.pixel, intervals.pixel, crossings.pixel])
    t = np.concatenate([intervals.t_enter, intervals.t_exit, crossings.distance])
    order = np.lexsort((t, pixel))
    pixel, t = pixel[order], t[order]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    enters, exits = rank[: len(row)], rank[len(row) : 2 * len(row)]
    windings = np.zeros((len(bodies), len(order)), dtype=np.int32)
    windings[row, enters], windings[row, exits] = intervals.winding, -intervals.winding
    # Each interval ends on its ray, so the sums are back to 0 where the next ray begins.
    windings = np.cumsum(windings, axis=1, dtype=np.int32)
    keep = np.flatnonzero((windings[:, :-1] != 0).any(axis=0) & (t[1:] > t[:-1]))
    return pixel[keep], t[keep], t[keep + 1], bodies, windings[:, keep]
