"""Diffusion between the cells of a body, as a linear system that is ready for any sources."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from translucent.arrays import Array
from translucent.diffusion.grid import BodyGrid
from translucent.diffusion.known_solutions import KnownSolutions
from translucent.errors import RenderError

#: Relative residual at which a solution is good enough: far below what diffusion itself gets wrong.
TOLERANCE = 1e-4

#: The same for factors that are near 1.
ROUGH = 1e-3

#: Steps after which conjugate gradients are given up.
MOST_STEPS = 4000


class CellSystem:
    """Fluence in cells between which light flows, in which it is absorbed, and from which it leaves.

    Parameters
    ----------
    grid : BodyGrid
    d : (cells,) float64
        Diffusion coefficient in m; between two cells it is that of their halves in series.
    absorbed : (cells,) float64
        Power for each fluence that a cell absorbs, in m^2: sigma_a times its volume.
    lost : (s,) float64
        Power for each fluence that leaves at the samples of the surface, in m^2.
    """

    def __init__(self, grid: BodyGrid, d: Array, absorbed: Array, lost: Array) -> None:
        matrix = _balance(grid, d, absorbed, lost)
        self._scale = 1.0 / np.sqrt(matrix.diagonal())
        self._matrix = sparse.csr_array(sparse.diags_array(self._scale) @ matrix @ sparse.diags_array(self._scale))
        self._known = KnownSolutions(self._matrix)

    def solved(self, source: Array) -> tuple[Array, int]:
        """Fluence (cells,) for powers (cells,), and iterations; none where sources of before are mixed anew.

        Raises
        ------
        RenderError
            If the solver does not get there.
        """
        wanted = source * self._scale
        found, steps = self._found(wanted, self._known.nearest(wanted), TOLERANCE)
        if steps:
            self._known.add(found)
        return np.asarray(found * self._scale), steps

    def forget(self) -> None:
        """Start the next solution from nothing."""
        self._known = KnownSolutions(self._matrix)

    def rough(self, source: Array) -> Array:
        """Fluence (cells,) for powers (cells,) up to a residual of `ROUGH`; no other solution starts from it."""
        return np.asarray(self._found(source * self._scale, None, ROUGH)[0] * self._scale)

    def _found(self, wanted: Array, near: Array | None, tolerance: float) -> tuple[Array, int]:
        steps = 0

        def count(_: Array) -> None:
            nonlocal steps
            steps += 1

        found, failed = cg(self._matrix, wanted, x0=near, rtol=tolerance, maxiter=MOST_STEPS, callback=count)
        if failed:
            raise RenderError(
                "diffusion in a body",
                f"the solver is not there after {MOST_STEPS} steps in {len(wanted)} cells",
                "render with scattering=tl.ScatteringLayer()",
            )
        return np.asarray(found), steps


def _balance(grid: BodyGrid, d: Array, absorbed: Array, lost: Array) -> sparse.csr_array:
    """Symmetric matrix of what flows between cells, is absorbed in them, and leaves through the surface."""
    first, second, ratio = grid.faces
    flow = 2.0 / (1.0 / d[first] + 1.0 / d[second]) * ratio
    # Crumbs that no sample reads would otherwise keep all of the light that is put into them.
    diagonal = absorbed + np.where(grid.crumbs, d * grid.cells.step, 0.0)
    diagonal += np.bincount(first, flow, grid.count) + np.bincount(second, flow, grid.count)
    between = sparse.coo_array(
        (np.concatenate([-flow, -flow]), (np.concatenate([first, second]), np.concatenate([second, first]))),
        (grid.count, grid.count),
    )
    read, _ = grid.below
    leaving = read.T @ sparse.diags_array(lost) @ read
    return sparse.csr_array(between + sparse.diags_array(diagonal) + leaving)
