"""Ordered intervals of rays inside bodies, from face signs and winding numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.reference.hits import Hits, Rays
from translucent.scene.camera import Camera
from translucent.scene.scene import Object, Scene

#: Fraction of the scene's diagonal on which rounding may wind a body's surface negatively.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Intervals:
    """Parts of rays inside bodies: flat arrays, sorted by pixel, then entry. Those of one body do not overlap.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray.
    t_enter, t_exit : (k,) float64
        Distances in metres from the ray's origin, 0 <= t_enter < t_exit.
    body : (k,) int64
        Index into `Scene.objects`.
    winding : (k,) int64
        How often the body's surface winds around the interval; never 0, and 2 where the mesh overlaps itself. Below 0
        faces look the wrong way.
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


def body_intervals(hits: Hits, origin: Integers, end: Array, body: int = 0) -> Intervals:
    """Intervals of one body.

    Parameters
    ----------
    hits : Hits
        All surfaces of the body between the origins and the ends of the rays.
    origin : (pixels,) int64
        Winding number of the body at the origin of each ray.
    end : (pixels,) float64
        Where an opaque surface stops each ray, in metres; inf where none does.
    body : int
        What the result calls the body.
    """
    inside, stopped = np.flatnonzero(origin), np.flatnonzero(np.isfinite(end))
    pixel = np.concatenate([inside, hits.pixel, stopped])
    # The origin stands before the hits of its pixel, the end after them, and these keep their order.
    order = np.argsort(pixel, kind="stable")
    pixel = pixel[order]
    t = np.concatenate([np.zeros(len(inside)), hits.distance, end[stopped]])[order]
    step = np.concatenate([origin[inside], hits.sign, np.zeros(len(stopped), dtype=np.int64)])[order]
    begins = np.diff(pixel, prepend=-1) != 0
    total = np.cumsum(step)
    winding = total - (total - step)[begins][np.cumsum(begins) - 1]
    keep = np.flatnonzero(~begins[1:] & (winding[:-1] != 0) & (t[1:] > t[:-1]))
    return Intervals(pixel[keep], t[keep], t[keep + 1], np.full(len(keep), body, dtype=np.int64), winding[keep])


def unbalanced(hits: Hits, origin: Integers) -> Mask:
    """(pixels,): mask of rays whose entries and exits of a body do not balance.

    Parameters
    ----------
    hits : Hits
        All surfaces of the body ahead of the origins, also behind what stops the rays: a ray may end inside a body, and
        what lies behind decides whether it has rightly come to be there.
    origin : (pixels,) int64
        As for `body_intervals`.
    """
    return np.asarray(sum_signs(hits.where(hits.distance >= 0), len(origin)) != -origin)


def sum_signs(hits: Hits, pixels: int) -> Integers:
    """(pixels,): entries minus exits on each ray."""
    return np.bincount(hits.pixel, hits.sign, pixels).astype(np.int64)


def origin_windings(body: Object, line: Hits, camera: Camera, pixels: int) -> Integers:
    """Winding number of a body around the origin of each ray, (pixels,).

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
    """Merge the intervals of several bodies into one list, sorted by pixel, then entry; at least one part."""
    arrays = {field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Intervals)}
    order = np.lexsort((arrays["body"], arrays["t_enter"], arrays["pixel"]))
    return Intervals(**{name: array[order] for name, array in arrays.items()})


def scene_intervals(
    scene: Scene, rays: Rays, hits: Sequence[Hits], solids: Sequence[int], end: Array
) -> tuple[Intervals, Mask]:
    """Intervals of bodies on rays of the scene's camera.

    Parameters
    ----------
    scene : Scene
    rays : Rays
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them.
    solids : sequence of int
        Indices into `Scene.objects`, each the surface of a solid.
    end : (pixels,) float64
        Where an opaque surface stops each ray, in metres; inf where none does.

    Returns
    -------
    intervals : Intervals
    defective : (pixels,) bool
        Rays on which some body shows a hole or faces wound wrongly: its entries and exits do not balance, also behind
        what stops the ray, unless all that is open of it lies behind there; or before that its surface winds around a
        place a negative number of times.
    """
    # Along the camera's axis.
    depth = end * (rays.directions @ scene.camera.forward)
    defective = np.zeros(len(end), dtype=bool)
    nothing = (np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
    parts = [Intervals(*nothing)]
    for index in solids:
        origin = origin_windings(scene.objects[index], hits[index], scene.camera, len(end))
        parts.append(body_intervals(hits[index].before(end), origin, end, index))
        defective |= unbalanced(hits[index], origin) & ~(depth < scene.objects[index].open_from(scene.camera))
    intervals = merge(parts)
    negative = np.bincount(intervals.pixel, np.minimum(intervals.thickness, 0.0), len(end))
    return intervals, defective | (negative < -ROUNDING * scene.diagonal)
