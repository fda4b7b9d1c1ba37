"""Spherical harmonics of light from all directions: what reads a bake of scattered light takes of an environment."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from translucent.arrays import Array
from translucent.formulas.spherical_harmonics import COUNT, real_harmonics
from translucent.scene.environment_map import row_blocks, row_solid_angles, texel_directions

#: Rows of the picture over which formulas and coarse pictures are integrated: good to 1e-4 of the light.
LEAST_HEIGHT = 128


def radiance_harmonics(radiance: Callable[[Array], Array], height: int) -> Array:
    """(9, 3): integrals over all directions of a function of unit vectors (..., 3), times each of `real_harmonics`.

    Parameters
    ----------
    radiance : callable
    height : int
        Rows of a picture that resolves it; sums are no coarser than that.
    """
    height = max(height, LEAST_HEIGHT)
    angles, directions = row_solid_angles(height, 2 * height), texel_directions(height, 2 * height)
    found = np.zeros((COUNT, 3))
    for rows in row_blocks(height, 2 * height):
        basis = real_harmonics(directions[rows]) * angles[rows, None, None]
        found += np.einsum("yxi,yxc->ic", basis, radiance(directions[rows]))
    return found
