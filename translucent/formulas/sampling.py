"""Positions of samples within a pixel, and the footprint of a pixel on refracted rays.

Positions are low-discrepancy points. Differentials of rays are those of Igehy 1999, "Tracing ray differentials". The
environment is averaged over an ellipse of directions by lookups along its longer axis (McCormack et al. 1999, "Feline:
fast elliptical lines for anisotropic texture mapping"), each in a map that is blurred for the shorter one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas.stored import stored

#: Number of points of each stored sequence: as many samples as a pixel may have.
MOST_POINTS = 4096

#: Pixels across which differentials are taken, for one sample of a pixel; for several, over the square root of their
#: number. Over a whole pixel the footprint of a ray that has hit several curved surfaces is far from an ellipse: twice
#: the bias for a twentieth less noise.
FOOTPRINT_STEP = 0.5

#: Least cosine to a face that differentials are divided by.
LEAST_ACROSS = 0.02

#: Most lookups along an ellipse.
MOST_LOOKUPS = 2

#: Least shorter axis that the number of lookups counts with, in radians: about a pixel of the blurred maps' finest.
LEAST_BREADTH = 1e-3

#: Alpha of the microfacets of a mirror, over the standard deviation of a normal distribution of directions: half of
#: the light of both is as near to the middle. A GGX lobe has half of it within 2 alpha, the other within 1.177.
ALPHA_OF_DEVIATION = 0.59


def sample_shifts(samples: int) -> npt.NDArray[np.float64]:
    """(samples, 2): sub-pixel shifts in -0.5..0.5, spread evenly (Sobol points)."""
    shifts = sobol_points(samples) + 0.5 / samples - 0.5
    return np.asarray(shifts - shifts.mean(axis=0))


def sobol_points(count: int, *, scrambled: bool = False) -> npt.NDArray[np.float64]:
    """(count, 2): the first points in 0..1 of a Sobol sequence in two dimensions.

    Those of `scipy.stats.qmc.Sobol`, stored by ``tools/make_tables.py``: importing ``scipy.stats`` takes longer than
    drawing a small picture.

    Parameters
    ----------
    count : int
        0 to 4096; numbers other than powers of 2 lose the balance of the sequence, but are still well spread.
    scrambled : bool
        A sequence scrambled once and for all (Matousek 1998), in which no point lies in a corner.

    Raises
    ------
    ValueError
        If so many are not stored.
    """
    if not 0 <= count <= MOST_POINTS:
        raise ValueError(f"{count} points of a sequence of {MOST_POINTS}")
    points = stored("sobol_scrambled" if scrambled else "sobol")
    return np.asarray(points[:count] / float(1 << 8 * points.itemsize))
