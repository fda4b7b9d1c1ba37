"""Solutions of a linear system for earlier right-hand sides, from which that for another one starts."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from translucent.arrays import Array

#: Solutions that are kept, and numbers in all of them together.
MOST, MOST_NUMBERS = 32, 1 << 23

#: Share of the largest energy of mixtures below which one of unit size is rounding.
ROUNDING = 1e-13


class KnownSolutions:
    """Span of the last solutions, for a starting point that is nearest in energy (Fischer 1998).

    Diffusion is linear in the light: once environments and lamps have been solved for, mixtures of them, dimmed or
    tinted, need no more steps; and as diffusion is smooth, turns of an environment need few.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric, positive definite.
    """

    def __init__(self, matrix: sparse.csr_array) -> None:
        self._matrix = matrix
        count = matrix.shape[0]
        most = max(2, min(MOST, MOST_NUMBERS // max(count, 1)))
        self._solutions = np.zeros((most, count))
        self._energies = np.zeros((most, most))
        self._oldest = 0

    def nearest(self, wanted: Array) -> Array:
        """(n,): of the span, what is nearest in energy to the solution for a right-hand side (n,)."""
        mixture = np.linalg.lstsq(self._energies, self._solutions @ wanted, rcond=ROUNDING)[0]
        return np.asarray(mixture @ self._solutions)

    def add(self, solution: Array) -> None:
        """Take in a solution (n,) of unit energy, in place of the oldest."""
        pushed = self._matrix @ solution
        if (energy := float(solution @ pushed)) <= 0.0:
            return
        size = np.sqrt(energy)
        self._solutions[self._oldest] = solution / size
        with_others = self._solutions @ pushed / size
        self._energies[self._oldest], self._energies[:, self._oldest] = with_others, with_others
        self._oldest = (self._oldest + 1) % len(self._solutions)
