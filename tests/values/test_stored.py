"""Stored tables against what they were made of, and pictures without the library that they took the place of."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

from tools.brdf_quadrature import albedo
from translucent.formulas.bsdf import TABLE_SIZE, brdf_table
from translucent.formulas.sampling import MOST_POINTS, sobol_points

#: Script that makes all that a picture of an own mesh on a stage is drawn from.
PREPARED = """
import sys, translucent as tl
from translucent.assets import mesh_path
from translucent.formulas.bsdf import brdf_table
from translucent.formulas.sampling import sample_shifts
from translucent.scene.environment import filtered
from translucent.scene.shadow_directions import shadow_directions
scene = tl.staged(tl.showcase(tl.load_mesh(mesh_path("bear")), tl.Medium(absorption=1.0), size=(64, 64), stage="none"))
filtered(scene.environment), shadow_directions(scene.environment, 128), brdf_table(), sample_shifts(16)
print("scipy.stats" in sys.modules)
"""


@pytest.mark.parametrize("scrambled", [False, True])
def test_points_are_those_of_scipy(scrambled: bool) -> None:
    from scipy.stats import qmc

    points = sobol_points(MOST_POINTS, scrambled=scrambled)
    if not scrambled:  # with a seed they are those of the version that made them
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert np.array_equal(points, qmc.Sobol(2, scramble=False).random(MOST_POINTS))
    for rows in (1, 8, 64, 512, 4096):  # a (0, 12, 2)-net: one point in each box of that area (Sobol 1967)
        box = np.floor(points * (rows, MOST_POINTS // rows)).astype(int)
        assert len(np.unique(box, axis=0)) == MOST_POINTS


def test_no_more_points_than_are_stored() -> None:
    with pytest.raises(ValueError, match="4097 points of a sequence of 4096"):
        sobol_points(MOST_POINTS + 1)


def test_the_stored_table_is_what_is_integrated() -> None:
    i, j = np.array([(0, 0), (1, 63), (7, 20), (31, 5), (63, 63), (50, 1)]).T
    found = albedo(j / (TABLE_SIZE - 1), i / (TABLE_SIZE - 1))
    assert np.abs(brdf_table()[i, j] - found).max() <= 1e-7


def test_a_small_picture_needs_no_scipy() -> None:
    done = subprocess.run([sys.executable, "-c", PREPARED], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
