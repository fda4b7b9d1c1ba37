"""Sampled directions of the light of an environment, for shadows."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from translucent.arrays import Array, Integers
from translucent.formulas.color import luminance
from translucent.formulas.sampling import sobol_points
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap, row_solid_angles, texel_directions

#: Rows and columns of the picture whose pixels are divided among the directions: 1.4 degrees each.
SIZE = (128, 256)

#: Fraction of the directions that are spread evenly, wherever the light comes from.
EVEN = 0.25

#: Rounds that spread the directions. Errors of shadows fall by a quarter, and no further with more rounds.
ROUNDS = 10

#: Pixels that are compared with all directions at a time.
_BLOCK = 1 << 10

#: Number of environments whose directions are cached.
KEPT = 8


def shadow_directions(environment: Environment, count: int) -> tuple[Array, Array]:
    """Directions towards the light of an environment, and how much light comes from each.

    The directions are the centers of a Voronoi diagram of the sphere (Lloyd 1982), from Sobol points that fall by
    luminance and, a quarter of them, evenly; each has the light of its cell, so that all of it is counted. Of
    the light that reaches a surface with normal n where T_i of each direction gets through, the fraction is ::

        sum_i w_i max(n . l_i, 0) T_i  /  sum_i w_i max(n . l_i, 0)

    by channel, and 1 where the divisor is 0. Its error falls a little faster than 1 / sqrt(count).

    Parameters
    ----------
    environment : Environment
        A backdrop fixed to the picture lights like the mean of its squares. An image takes its directions along when
        it is rotated.
    count : int
        At least 1: `Scene.environment_shadows`.

    Returns
    -------
    directions : (count, 3) float64
        Unit vectors in the world. The same for the same environment; read-only. Every n-th of them are spread as all.
    irradiance : (count, 3) float64
        In W/m^2, on a surface that faces the direction: w_i. Their sum is the integral of radiance over all directions.
    """
    directions, irradiance = _shared_out(environment.light_map, count)
    if environment.map is None:
        return directions, irradiance
    turned, bright = directions @ _turn(environment.turn), environment.scale * irradiance
    for values in (turned, bright):
        values.setflags(write=False)
    return turned, bright


def _turn(rotation: float) -> Array:
    """(3, 3): rotation of row vectors about +Y, counterclockwise as seen from above."""
    cosine, sine = np.cos(2.0 * np.pi * rotation), np.sin(2.0 * np.pi * rotation)
    return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])


@lru_cache(maxsize=KEPT)
def _shared_out(source: EnvironmentMap, count: int) -> tuple[Array, Array]:
    """Directions (count, 3), and integrals of a picture's radiance over their cells, before rotation and exposure."""
    from translucent.scene.environment_map import sized  # scenes without shadows of the environment need no SciPy

    solid_angles = np.repeat(row_solid_angles(*SIZE), SIZE[1])
    texels = texel_directions(*SIZE).reshape(-1, 3)
    with np.errstate(under="ignore"):
        flux = sized(source, SIZE).reshape(-1, 3) * solid_angles[:, None]
        fractions = _fractions(luminance(flux), solid_angles)
        directions = texels[_drawn(fractions, count)]
        for _ in range(ROUNDS):
            directions = _centered(directions, texels, fractions)
        cell, _ = _nearest(directions, texels)
        irradiance = _sums(cell, flux, count)
    for values in (directions, irradiance):
        values.setflags(write=False)
    return directions, irradiance


def _fractions(light: Array, solid_angles: Array) -> Array:
    """(n,): fraction of the directions for each pixel; they sum to 1."""
    even, total = solid_angles / solid_angles.sum(), light.sum()
    return np.asarray(EVEN * even + (1.0 - EVEN) * light / total if total > 0 else even)


def _drawn(fractions: Array, count: int) -> Integers:
    """(count,): pixels by their fractions, row first and then column, from low-discrepancy points."""
    points = sobol_points(count, scrambled=True)[_strided(count)]
    table = fractions.reshape(SIZE)
    rows = np.cumsum(table.sum(axis=1))
    row = np.minimum(np.searchsorted(rows, points[:, 0] * rows[-1], side="right"), SIZE[0] - 1)
    columns = np.cumsum(table[row], axis=1)
    column = np.minimum((columns <= points[:, 1:] * columns[:, -1:]).sum(axis=1), SIZE[1] - 1)
    return np.asarray(row * SIZE[1] + column)


def _strided(count: int) -> Integers:
    """(count,): order of the points of a Sobol sequence in which every n-th of them are as even as points in a row.

    In a row each of 2^k points is in another of 2^k slices of the square, and every 2^k-th is in the same one. With
    the digits of their numbers reversed (van der Corput 1935) it is the other way round.
    """
    digits = max(count - 1, 1).bit_length()
    number = np.arange(1 << digits)
    reverse = np.zeros_like(number)
    for digit in range(digits):
        reverse |= ((number >> digit) & 1) << (digits - 1 - digit)
    return reverse[reverse < count]


def _centered(directions: Array, texels: Array, fractions: Array) -> Array:
    """Centers of the cells of directions; empty cells move to the texels farthest from theirs."""
    cell, apart = _nearest(directions, texels)
    middle = _sums(cell, texels * fractions[:, None], len(directions))
    length = np.linalg.norm(middle, axis=1)
    # All directions of a lone cell may cancel.
    centers = np.where(length[:, None] > 1e-9, middle / np.maximum(length, 1e-9)[:, None], directions)
    empty = np.flatnonzero(np.bincount(cell, minlength=len(directions)) == 0)
    if empty.size:
        centers[empty] = texels[np.argsort(-fractions * apart * apart, kind="stable")[: len(empty)]]
    return np.asarray(centers)


def _nearest(directions: Array, texels: Array) -> tuple[Integers, Array]:
    """Number (n,) of the direction nearest to each of `texels` (n, 3), and the distance (n,)."""
    # Few directions: their products with blocks that stay in a cache are found faster than a tree is gone through.
    cell = np.concatenate(
        [(texels[i : i + _BLOCK] @ directions.T).argmax(axis=1) for i in range(0, len(texels), _BLOCK)]
    )
    return cell, np.linalg.norm(texels - directions[cell], axis=1)


def _sums(cell: Integers, values: Array, count: int) -> Array:
    """(count, 3): sums of values (n, 3) by cell."""
    return np.stack([np.bincount(cell, values[:, channel], count) for channel in range(3)], axis=1)
