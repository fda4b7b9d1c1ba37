"""Half-spaces of medium that scatters more to one side than to the other: what they give back, by discrete ordinates.

References
----------
Chandrasekhar 1960, "Radiative transfer", chapter VI; Stamnes et al. 1988, "Numerically stable algorithm for discrete-
ordinate-method radiative transfer", for the modes; Wiscombe 1977, "The delta-M method", for phase functions that are
sharper than the quadrature.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.formulas.phase import PhaseFunction

#: Even and odd Legendre moments.
_PARTS = slice(0, None, 2), slice(1, None, 2)


@np.errstate(under="ignore")
def bare_half_space(albedo: float, phase: PhaseFunction, cosine: Array, weight: Array, moments: int) -> Array:
    """Matrix (n, n) that turns radiance into a half-space without an interface into that out of it, around the normal.

    What goes up and what goes down are modes that decay with the depth, each with its own length: together they go
    down at the surface as what comes in, which says how much there is of each, and so what goes up.

    Parameters
    ----------
    albedo : float
        Of single scattering, 0 to 1.
    phase : PhaseFunction
    cosine, weight : (n,)
        Quadrature over 0 to 1.
    moments : int
        Legendre moments of the phase function, as many as the quadrature can tell apart: twice the nodes of a part of
        it. The forward peak beyond them counts as unscattered.
    """
    from scipy.linalg import eigh  # late: a window opens without it

    known = phase.moments(moments + 1)
    peak = float(known[-1])
    albedo = albedo * (1.0 - peak) / (1.0 - albedo * peak)
    order = np.arange(moments)
    share = (2 * order + 1) * (known[:-1] - peak) / (1.0 - peak)
    root = np.sqrt(weight)
    values = root[:, None] * np.polynomial.legendre.legvander(cosine, moments - 1)
    one = np.eye(len(cosine))
    # What is alike up and down meets even moments alone, what is opposite odd ones: with s = up + down, t = up - down,
    # mu s' = odd t and mu t' = even s. Both are symmetric, as the radiance carries the roots of the weights.
    even, odd = (one - albedo * (values[:, part] * share[part]) @ values[:, part].T for part in _PARTS)
    along = np.linalg.solve(odd, np.diag(cosine))
    rates, sums = eigh(even, cosine[:, None] * along)  # looks at one triangle of each alone
    differences = along @ sums * np.sqrt(np.maximum(rates, 0.0))
    back = np.linalg.solve((sums + differences).T, (sums - differences).T).T
    return np.asarray(back / root[:, None] * root)
