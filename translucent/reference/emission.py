"""Emission of mixtures of media with different varying densities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from translucent.arrays import Array, Integers
from translucent.formulas import optics
from translucent.reference.quadrature import integrate
from translucent.reference.rays import Rays
from translucent.reference.volume import Segments, Volume, points_on

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
        share = optics.mean_transmittance(segments.extinction[found] * length)
    # Of a medium so deep that the share vanishes, nothing is seen either.
    emission[found] = exact / (length * np.maximum(share, np.finfo(np.float64).tiny))
    return replace(segments, emission=emission)
