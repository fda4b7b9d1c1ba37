"""Where rays are inside bodies: ordered intervals, from face signs and winding numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from translucent.camera import Camera
from translucent.reference.hits import Hits, line_hits
from translucent.scene import Object, Scene

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Intervals:
    """Parts of rays inside bodies: flat arrays, sorted by pixel, then entry. Those of one body do not overlap.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray: row * width + column.
    t_enter, t_exit : (k,) float64
        Distances in metres from the ray's origin, 0 <= t_enter < t_exit.
    body : (k,) int64
        Index into `Scene.objects`.
    winding : (k,) int64
        How often the body's surface winds around the interval; never 0, and 2 where the mesh overlaps itself.
    """

    pixel: Integers
    t_enter: Array
    t_exit: Array
    body: Integers
    winding: Integers

    @property
    def thickness(self) -> Array:
        """(k,): metres inside the body, counted as often as its surface winds around them."""
        return self.winding * (self.t_exit - self.t_enter)


def body_intervals(hits: Hits, origin: Integers, body: int = 0) -> Intervals:
    """Intervals of one body.

    Parameters
    ----------
    hits : Hits
        All surfaces of the body ahead of the rays' origins.
    origin : (pixels,) int64
        Winding number of the body at the origin of each ray.
    body : int
        What the result calls the body.
    """
    inside = np.flatnonzero(origin)
    pixel = np.concatenate([inside, hits.pixel])
    # The origin stands before the hits of its pixel, and these keep their order.
    order = np.argsort(pixel, kind="stable")
    pixel = pixel[order]
    t = np.concatenate([np.zeros(len(inside)), hits.distance])[order]
    step = np.concatenate([origin[inside], hits.sign.astype(np.int64)])[order]
    begins = np.diff(pixel, prepend=-1) != 0
    total = np.cumsum(step)
    winding = total - (total - step)[begins][np.cumsum(begins) - 1]
    keep = np.flatnonzero(~begins[1:] & (winding[:-1] != 0) & (t[1:] > t[:-1]))
    return Intervals(pixel[keep], t[keep], t[keep + 1], np.full(len(keep), body, dtype=np.int64), winding[keep])


def unbalanced(hits: Hits, origin: Integers) -> Mask:
    """(pixels,): rays that do not end outside: they leave a body more or less often than they are in it or enter it.

    Parameters
    ----------
    hits, origin
        As for `body_intervals`.
    """
    return np.not_equal(sum_signs(hits, len(origin)), -origin)


def sum_signs(hits: Hits, pixels: int) -> Integers:
    """(pixels,): entries minus exits on each ray."""
    return np.bincount(hits.pixel, hits.sign, pixels).astype(np.int64)


def origin_windings(body: Object, line: Hits, camera: Camera, pixels: int) -> Integers:
    """How often a body contains the origin of each ray, (pixels,).

    For a solid this is the sum of the signs behind the origin. It agrees with the hits ahead even if the origin is on
    the surface, and differs from ray to ray for an orthographic camera. Behind the eye, the hole of an open body would
    say nothing about what is ahead; so there the winding number at the eye decides, rounded.

    Parameters
    ----------
    body : Object
    line : Hits
        Of `line_hits`: all surfaces of the body, before and behind the origins.
    camera : Camera
    pixels : int
        Number of rays.
    """
    if camera.fov_y is not None and not body.mesh.diagnosis.solid:
        return np.full(pixels, round(body.winding_number(camera.eye)), dtype=np.int64)
    return sum_signs(line.where(line.distance < 0), pixels)


def merge(parts: Sequence[Intervals]) -> Intervals:
    """The intervals of several bodies as one list, sorted by pixel, then entry; at least one part."""
    arrays = {field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Intervals)}
    order = np.lexsort((arrays["body"], arrays["t_enter"], arrays["pixel"]))
    return Intervals(**{name: array[order] for name, array in arrays.items()})


def scene_intervals(scene: Scene, size: tuple[int, int], bodies: Sequence[int]) -> tuple[Intervals, Mask]:
    """Intervals of bodies on the pixel rays of the scene's camera.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    bodies : sequence of int
        Indices into `Scene.objects`, each the surface of a solid.

    Returns
    -------
    intervals : Intervals
    unbalanced : (width * height,) bool
        Pixels where some body's entries and exits do not balance: a hole or a face wound wrongly.
    """
    pixels = size[0] * size[1]
    bad = np.zeros(pixels, dtype=bool)
    nothing = (np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
    parts = [Intervals(*nothing)]
    for index in bodies:
        body = scene.objects[index]
        line = line_hits(body.mesh, body.matrix, scene.camera, size)
        origin = origin_windings(body, line, scene.camera, pixels)
        ahead = line.where(line.distance >= 0)
        parts.append(body_intervals(ahead, origin, index))
        bad |= unbalanced(ahead, origin)
    return merge(parts), bad
