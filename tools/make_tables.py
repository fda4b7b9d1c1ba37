"""Make the tables in translucent/formulas/stored: ``python tools/make_tables.py``. The same numbers on every run.

They are what small pictures would wait for: points of Sobol sequences, for which SciPy's statistics are loaded, and the
reflectance of rough interfaces, which is integrated.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc

from tools.brdf_quadrature import integrated_table
from translucent.formulas.sampling import MOST_POINTS

FOLDER = Path(__file__).resolve().parents[1] / "translucent" / "formulas" / "stored"


def sobol(*, scrambled: bool) -> npt.NDArray[np.float64]:
    """(4096, 2): points in 0..1, multiples of 1 / 65536, or of 2^-30 if scrambled."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the seed's name changes in later versions of SciPy
        return np.asarray(qmc.Sobol(2, scramble=scrambled, seed=0).random(MOST_POINTS))


def tables() -> dict[str, npt.NDArray[Any]]:
    """Tables by their names."""
    return {
        "sobol": (sobol(scrambled=False) * 2.0**16).astype("<u2"),
        "sobol_scrambled": (sobol(scrambled=True) * 2.0**32).astype("<u4"),
        "brdf": integrated_table().astype("<f4"),
    }


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, table in tables().items():
        np.save(FOLDER / f"{name}.npy", table)
