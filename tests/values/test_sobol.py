"""Sobol points without `scipy.stats`: those of SciPy, digit by digit."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

from translucent.formulas.sobol import sobol_points


@pytest.mark.parametrize("seed", [None, 0, 5])
def test_points_are_those_of_scipy(seed):
    from scipy.stats import qmc

    scrambled = seed is not None
    for count in (1, 2, 7, 1024):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of numbers that are no powers of 2
            expected = qmc.Sobol(2, scramble=scrambled, seed=seed).random(count)
        np.testing.assert_array_equal(sobol_points(count, seed), expected)


def test_samples_and_shadows_do_not_wait_for_scipy_stats():
    code = (
        "import sys, translucent as tl\n"
        "from translucent.bake.directions import _sobol\n"
        "from translucent.formulas.sampling import sample_shifts\n"
        "from translucent.scene.shadow_directions import shadow_directions\n"
        "sample_shifts(4), shadow_directions(tl.Environment.constant((1, 1, 1)), 4), _sobol(4, 1, 0)\n"
        "sys.exit('scipy.stats' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
