"""Compositing of media and of partly transparent layers along rays (Porter & Duff 1984; Max 1995)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from translucent.arrays import Array, Integers
from translucent.errors import InputError
from translucent.formulas import optics
from translucent.reference.hits import Rays
from translucent.reference.quadrature import integrate
from translucent.reference.volume import Segments, Volume, points_on


@dataclass(frozen=True, eq=False)
class ColorLayer:
    """Color and opacity of a layer or a step.

    Attributes
    ----------
    color : (k, 3) float64
    optical_depth : (k, 3) float64
        -log(1 - opacity), which keeps its digits near an opacity of 0 and of 1.
    """

    color: Array
    optical_depth: Array

    @property
    def transmittance(self) -> Array:
        """(k, 3): 1 - opacity."""
        return optics.transmittance(self.optical_depth)

    @property
    def opacity(self) -> Array:
        """(k, 3)."""
        return optics.opacity(self.optical_depth)


@np.errstate(under="ignore", over="ignore")
def over(front: ColorLayer, back: ColorLayer) -> ColorLayer:
    """Composite of two layers of associated colors: C = C_f + (1 - a_f) C_b."""
    return ColorLayer(front.color + front.transmittance * back.color, front.optical_depth + back.optical_depth)


@np.errstate(under="ignore", over="ignore")
def over_unassociated(front: ColorLayer, back: ColorLayer) -> ColorLayer:
    """Composite of two layers of unassociated colors: C = (a_f C_f + (1 - a_f) a_b C_b) / a."""
    both = front.opacity * front.color + front.transmittance * back.opacity * back.color
    depth = front.optical_depth + back.optical_depth
    return ColorLayer(_divided(both, optics.opacity(depth)), depth)


@np.errstate(under="ignore")
def associated(layer: ColorLayer) -> ColorLayer:
    """Layer with its unassociated color converted to the associated color, a C."""
    return ColorLayer(layer.opacity * layer.color, layer.optical_depth)


@np.errstate(under="ignore")
def unassociated(layer: ColorLayer) -> ColorLayer:
    """Layer with its associated color converted to the unassociated color, C / a.

    Raises
    ------
    InputError
        If something without opacity has a color: it has no unassociated color.
    """
    if ((layer.opacity == 0) & (layer.color > 0)).any():
        raise InputError(
            "unassociated colors", "a step of the ray emits light, although its opacity is 0", "use associated colors"
        )
    return ColorLayer(_divided(layer.color, layer.opacity), layer.optical_depth)


def _divided(color: Array, opacity: Array) -> Array:
    """Quotient color / opacity; 0 where there is no opacity."""
    return np.asarray(np.where(opacity > 0, color / np.where(opacity > 0, opacity, 1.0), 0.0))


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


#: Relative error of the emission of each segment: far below that of anything to compare with.
TOLERANCE = 1e-12


def emission_of_mixtures(volume: Volume, rays: Rays, segments: Segments, filling: Array) -> Segments:
    """Segments with equivalent constant emission, where the emission of a mixture has no closed form.

    Emission and extinction of a single medium vary together, and their means will do. Those of mixtures need an
    integral, of T(t) q(t) over the segment (Max 1995, section 4).

    Parameters
    ----------
    volume : Volume
    rays : Rays
    segments : Segments
        Of `volume_segments`, and so is `filling`.
    filling : (k, n) float64
    """
    varied = (filling[:, volume.varied] > 0).any(axis=1) & ((filling > 0).sum(axis=1) > 1)
    found = np.flatnonzero(varied & (segments.emission > 0).any(axis=1))
    if not found.size:
        return segments

    def emitted(index: Integers, u: Array) -> Array:
        owner = np.repeat(found[index], u.shape[1])
        ray, enter, t = segments.pixel[owner], segments.t_enter[owner], u.ravel()
        points = points_on(rays, ray, t)
        own = volume.at(filling[owner], points) @ volume.emission
        extinction = volume.between(filling[owner], points_on(rays, ray, enter), points) @ volume.extinction
        with np.errstate(under="ignore", over="ignore"):
            return np.asarray((own * optics.transmittance(extinction * (t - enter)[:, None])).reshape(*u.shape, 3))

    one_by_one = np.arange(len(found))
    exact = integrate(emitted, segments.t_enter[found], segments.t_exit[found], one_by_one, len(found), TOLERANCE).value
    length = segments.length[found, None]
    emission = segments.emission.copy()
    with np.errstate(over="ignore", under="ignore"):
        mean_transmittance = optics.mean_transmittance(segments.extinction[found] * length)
    # A medium so deep that the mean transmittance vanishes emits nothing visible either.
    emission[found] = exact / (length * np.maximum(mean_transmittance, np.finfo(np.float64).tiny))
    return replace(segments, emission=emission)
