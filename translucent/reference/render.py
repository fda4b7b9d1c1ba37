"""The ground truth of a picture: float64, on the CPU, from exact intervals."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent import optics
from translucent.camera import check_size
from translucent.frame import ARRAYS, Frame
from translucent.plan import plan
from translucent.reference.compositing import composite
from translucent.reference.hits import Hits, line_hits
from translucent.reference.intervals import scene_intervals
from translucent.reference.opaque import nearest_opaque, reflected_radiance
from translucent.reference.rays import Rays, pixel_rays
from translucent.reference.segments import scene_segments
from translucent.reference.sheets import scene_crossings, sheet_hits, sheet_thicknesses
from translucent.scene import Scene
from translucent.thickness import Method, ThinLayer

#: Surfaces, times objects, that are put in order at a time: the working arrays stay below 500 MB.
CHUNK = 1 << 24


def render(scene: Scene, size: tuple[int, int], method: Method | None = None) -> Frame:
    """True thickness, transmittance and radiance of a scene.

    Parameters
    ----------
    scene : Scene
    size : (width, height)
        In pixels.
    method : Method, optional
        `ThinLayer` makes every surface of a medium a sheet; a sheet's own declared thickness goes first. All other
        methods are ways to the same true thickness.

    Returns
    -------
    Frame
        Of float64 arrays; `shade_hits` tells what is valid.

    Raises
    ------
    InputError
        If the size is not one, or the planner refuses the scene.
    """
    start = time.perf_counter()
    size = check_size(size)
    chosen = plan(scene, method if isinstance(method, ThinLayer) else None)
    hits = _scene_hits(scene, size)
    crossed = time.perf_counter()
    rays, sheets = pixel_rays(scene.camera, size), sheet_thicknesses(scene, method)
    parts = [
        shade_hits(scene, rays.where(part), [_along(line, part) for line in hits], sheets)
        for part in _parts(hits, len(rays))
    ]
    arrays = {name: np.concatenate([part[name] for part in parts]) for name in ARRAYS}
    end = time.perf_counter()
    return Frame(
        **{name: array.reshape(size[::-1] + array.shape[1:]) for name, array in arrays.items()},
        plan=chosen,
        seconds={"intersect": crossed - start, "shade": end - crossed, "total": end - start},
        provenance={"backend": "reference", "numpy": np.__version__},
    )


def shade_hits(
    scene: Scene, rays: Rays, hits: Sequence[Hits], sheets: Sequence[float | None]
) -> dict[str, npt.NDArray[Any]]:
    """What rays see, from all surfaces on them, wherever these come from.

    Parameters
    ----------
    scene : Scene
    rays : Rays
        Of the scene's camera: all of a picture, or any of them.
    hits : sequence of Hits
        Of each of `Scene.objects`, as `line_hits` gives them: the surfaces behind the origins, too, and sorted.
        `Hits.pixel` is a number among `rays`; `Hits.barycentric` is not read.
    sheets : sequence of float or None
        Thickness in metres of the sheet that each object is, or None for a solid: see `sheet_thicknesses`.

    Returns
    -------
    dict of str to ndarray
        The arrays of a frame by their names, (n,) or (n, 3), float64 and bool. Covered is a ray that crosses a medium
        before an opaque surface stops it. Invalid is one that ends inside a solid though nothing stops it, that a
        solid's faces wind around a negative number of times, or whose optical depth overflows.
    """
    wall = nearest_opaque(scene, hits, len(rays))
    solids = [i for i, body in enumerate(scene.objects) if body.medium is not None and sheets[i] is None]
    intervals, defective = scene_intervals(scene, hits, solids, wall.distance)
    crossings = scene_crossings(scene, rays, hits, sheets, wall.distance)
    segments = scene_segments(scene, intervals, crossings)
    emitted, depth = composite(segments, len(rays))
    transmittance = optics.transmittance(depth)
    behind = np.where(
        np.isinf(wall.distance)[:, None],
        scene.environment.radiance(rays.directions, rays.backdrop),
        reflected_radiance(scene, rays, wall),
    )
    coverage = defective.copy()
    coverage[segments.pixel] = True
    with np.errstate(under="ignore"):
        radiance = behind * transmittance + emitted
    return {
        "radiance": radiance,
        "transmittance": transmittance,
        "optical_depth": depth,
        "thickness": np.bincount(segments.pixel, segments.count * segments.length, len(rays)).astype(np.float64),
        "coverage": coverage,
        "valid": ~defective & np.isfinite(depth).all(axis=1),
    }


def hit_counts(scene: Scene, size: tuple[int, int]) -> npt.NDArray[np.int64]:
    """(h, w): how many surfaces of media each pixel's ray crosses before an opaque one stops it."""
    width, height = check_size(size)
    hits = _scene_hits(scene, (width, height))
    end = nearest_opaque(scene, hits, width * height).distance
    counts = np.zeros(width * height, dtype=np.int64)
    for body, line in zip(scene.objects, hits, strict=True):
        if body.medium is not None:
            crossed = line.before(end) if body.sheet_thickness is None else sheet_hits(scene, line, end)
            counts += np.bincount(crossed.pixel, minlength=len(counts))
    return counts.reshape(height, width)


def _scene_hits(scene: Scene, size: tuple[int, int]) -> list[Hits]:
    return [line_hits(body.mesh, body.matrix, scene.camera, size) for body in scene.objects]


def _parts(hits: Sequence[Hits], pixels: int) -> Iterator[slice]:
    """Runs of pixels, each with at most `CHUNK` surfaces times objects, or of one pixel."""
    crossed = np.cumsum(np.sum([np.bincount(line.pixel, minlength=pixels) for line in hits], axis=0))
    cuts = np.searchsorted(crossed, np.arange(0, crossed[-1], max(CHUNK // len(hits), 1)), side="right")
    bounds = np.unique(np.concatenate([[0], cuts[1:], [pixels]]))
    for begin, end in itertools.pairwise(bounds):
        yield slice(int(begin), int(end))


def _along(line: Hits, part: slice) -> Hits:
    """The hits on a run of rays, these numbered from 0."""
    begin, end = np.searchsorted(line.pixel, [part.start, part.stop])
    own = line.where(slice(begin, end))
    return Hits(own.pixel - part.start, own.distance, own.sign, own.face, own.barycentric)
