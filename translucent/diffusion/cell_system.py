"""Linear system of diffusion between the cells of a grid, and its solver.

References
----------
Nicolaides 1987, "Deflation of conjugate gradients with applications to boundary value problems"; Fischer 1998,
"Projection techniques for iterative solution of Ax = b with successive right-hand sides".
"""

from __future__ import annotations

from itertools import count

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from translucent.arrays import Array
from translucent.diffusion.grid import BodyGrid
from translucent.errors import RenderError

#: Solutions that are kept, and numbers in all of them together.
MOST, MOST_NUMBERS = 32, 1 << 23

#: Fraction of the largest energy of mixtures below which one of unit size is rounding.
ROUNDING = 1e-13


class KnownSolutions:
    """Subspace of the last solutions, in which the solver finds its starting point (Fischer 1998).

    Diffusion is linear in the light: once environments and lights have been solved for, mixtures of them, dimmed or
    tinted, need no more steps; and as diffusion is smooth, rotations of an environment need few.

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
        self._next = self._count = 0

    def nearest(self, right_side: Array) -> Array:
        """(n,): the mixture of known solutions nearest in energy to the one for a right-hand side (n,)."""
        known, energies = self._solutions[: self._count], self._energies[: self._count, : self._count]
        mixture = np.linalg.lstsq(energies, known @ right_side, rcond=ROUNDING)[0]
        return np.asarray(mixture @ known)

    def add(self, solution: Array) -> None:
        """Take in a solution (n,) of unit energy, in place of the oldest."""
        pushed = self._matrix @ solution
        if (energy := float(solution @ pushed)) <= 0.0:
            return
        size = np.sqrt(energy)
        place, most = self._next % len(self._solutions), len(self._solutions)
        self._next += 1
        self._count = min(self._next, most)
        self._solutions[place] = solution / size
        with_others = self._solutions[: self._count] @ pushed / size
        self._energies[place, : self._count], self._energies[: self._count, place] = with_others, with_others


#: Relative residual at which a solution is good enough: far below what diffusion itself gets wrong.
TOLERANCE = 1e-4

#: Steps after which conjugate gradients are given up.
MOST_STEPS = 4000


class CellSystem:
    """Linear system of diffusion between grid cells, with absorption and losses at the surface.

    Parameters
    ----------
    grid : BodyGrid
    d : (cells,) float64
        Diffusion coefficient in m; between two cells it is that of their halves in series.
    absorbed : (cells,) float64
        Power for each fluence that a cell absorbs, in m^2: sigma_a times its volume.
    lost : (s + i,) float64
        Power for each fluence that leaves at the samples of the surface, and at those of inclusions, in m^2.
    """

    def __init__(self, grid: BodyGrid, d: Array, absorbed: Array, lost: Array) -> None:
        pattern, values = grid.pattern, _balance(grid, d, absorbed, lost)
        self._matrix = sparse.csr_array((values, pattern.columns, pattern.starts), (grid.count, grid.count))
        # SciPy makes columns of vectors before it multiplies a matrix by them.
        self._operator = LinearOperator(self._matrix.shape, self._matrix.__matmul__, dtype=np.float64)
        self._approximate_inverse = _approximate_inverse(grid, self._matrix)
        self._known = KnownSolutions(self._matrix)
        self._taken = float(absorbed.sum() + lost.sum())

    def even(self, source: Array) -> Array:
        """Constant fluence (cells,) that loses as much power as `source` (cells,) adds."""
        return np.full(len(source), source.sum() / max(self._taken, np.finfo(np.float64).tiny))

    def solved(self, source: Array, near: Array | None = None, tolerance: float = TOLERANCE) -> tuple[Array, int]:
        """Solve for the fluence (cells,) of powers (cells,); also returns the number of iterations.

        Iterations start from a fluence `near` (cells,). Default: from the nearest mixture of known solutions; if the
        powers are a mixture of known ones, no iteration is needed.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        if near is not None:
            return self._found(source, near, tolerance)
        found, steps = self._found(source, self._known.nearest(source), tolerance)
        if steps:
            self._known.add(found)
        return found, steps

    def forget(self) -> None:
        """Start the next solution from nothing."""
        self._known = KnownSolutions(self._matrix)

    def _found(self, right_side: Array, near: Array, tolerance: float) -> tuple[Array, int]:
        steps = count()
        found, failed = cg(
            self._operator,
            right_side,
            near,
            rtol=tolerance,
            maxiter=MOST_STEPS,
            M=self._approximate_inverse,
            callback=lambda _: next(steps),
        )
        if failed:
            raise RenderError(
                "diffusion in a body",
                f"the diffusion solver has not converged after {MOST_STEPS} steps in {len(right_side)} cells",
                "render with scattering=tl.ScatteringLayer()",
            )
        return found, next(steps)


def _approximate_inverse(grid: BodyGrid, matrix: sparse.csr_array) -> LinearOperator:
    """Preconditioner of a system: its diagonal, and a coarse correction that is constant in each block of cells.

    Errors that single cells see vanish in a few steps of conjugate gradients, and those as wide as the body in many:
    with the second part they need no more than others (Nicolaides 1987).
    """
    of, blocks = grid.blocks, int(grid.blocks.max(initial=-1)) + 1
    coarse = np.linalg.inv(np.bincount(grid.block_pairs, matrix.data, blocks * blocks).reshape(blocks, blocks))
    diagonal, tiny = 1.0 / matrix.data[grid.pattern.diagonal], np.finfo(np.float64).tiny
    # In single precision, which has no room for the powers of all sizes of bodies: in units of the largest number.
    unit = np.abs(coarse).max(initial=tiny)
    coarse = (coarse / unit).astype(np.float32)

    def apply(right_side: Array) -> Array:
        sums = np.bincount(of, right_side, blocks)
        size = np.abs(sums).max(initial=tiny)
        return np.asarray(diagonal * right_side + ((unit * size) * (coarse @ (sums / size).astype(np.float32)))[of])

    return LinearOperator(matrix.shape, apply, dtype=np.float64)


def _balance(grid: BodyGrid, d: Array, absorbed: Array, lost: Array) -> Array:
    """Numbers of the symmetric matrix of flow between cells, absorption, and losses through the surface."""
    (first, second, ratio), pattern = grid.faces, grid.pattern
    flow = 2.0 / (1.0 / d[first] + 1.0 / d[second]) * ratio
    # Crumbs that no sample reads would otherwise keep all of the light that is put into them.
    diagonal = absorbed + np.where(grid.crumbs, d * grid.cells.step, 0.0)
    diagonal += np.bincount(first, flow, grid.count) + np.bincount(second, flow, grid.count)
    values = np.asarray(pattern.losses @ lost)
    values[pattern.diagonal] += diagonal
    values[pattern.between] -= flow
    return values
