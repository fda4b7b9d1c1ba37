"""Absorption and emission of ordered media along rays (Max 1995)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from translucent.arrays import Array, Integers
from translucent.formulas import optics
from translucent.reference.segments import Segments


@np.errstate(over="ignore", under="ignore")
def composite(segments: Segments, pixels: int) -> tuple[Array, Array]:
    """Composite emitted radiance and optical depth of rays, front to back; exact for media that are constant in each
    segment.

    Max 1995, section 4: each segment adds what it emits times the transmittance of all before it.

    Parameters
    ----------
    segments : Segments
    pixels : int
        Number of rays.

    Returns
    -------
    emitted, optical_depth : (pixels, 3) float64
        The depth is inf where it overflows.
    """
    emitted, depth = np.zeros((pixels, 3)), np.zeros((pixels, 3))
    for layer in _layers(segments.pixel):
        pixel, length = segments.pixel[layer], segments.length[layer, None]
        extinction = segments.extinction[layer]
        own = optics.emitted_radiance(segments.emission[layer], extinction, length)
        emitted[pixel] += optics.transmittance(depth[pixel]) * own
        depth[pixel] += extinction * length
    return emitted, depth


def _layers(pixel: Integers) -> Iterator[Integers]:
    """Indices of the first segments of all rays, then of the second ones, and so on; `pixel` (k,) ascends."""
    _, first, counts = np.unique(pixel, return_index=True, return_counts=True)
    rank = np.arange(len(pixel)) - np.repeat(first, counts)
    ends = np.cumsum(np.bincount(rank))
    yield from np.split(np.argsort(rank, kind="stable"), ends[:-1]) if len(pixel) else ()
