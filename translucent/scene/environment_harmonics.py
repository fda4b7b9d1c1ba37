"""Spherical harmonics of an environment: what reads a bake of scattered light takes of it."""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.formulas.spherical_harmonics import COUNT, real_harmonics
from translucent.scene.environment import Environment
from translucent.scene.environment_map import row_blocks, row_solid_angles, texel_directions

#: Rows of the picture over which formulas and coarse pictures are integrated: good to 1e-4 of the light.
LEAST_HEIGHT = 128


def environment_harmonics(environment: Environment) -> Array:
    """(9, 3): integrals of the radiance from all directions, times each of `real_harmonics`."""
    height = LEAST_HEIGHT if environment.map is None else max(LEAST_HEIGHT, environment.map.size[1])
    angles, directions = row_solid_angles(height, 2 * height), texel_directions(height, 2 * height)
    found = np.zeros((COUNT, 3))
    for rows in row_blocks(height, 2 * height):
        basis = real_harmonics(directions[rows]) * angles[rows, None, None]
        found += np.einsum("yxi,yxc->ic", basis, environment.lighting(directions[rows]))
    return found
