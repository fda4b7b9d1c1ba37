"""Directions of the rays: scrambled Sobol points in a cone around the inward normal, another set at each point."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats
from translucent.bake.rays import CACHED_RAYS
from translucent.bake.settings import BakeSettings
from translucent.bake.surface import Points
from translucent.formulas.sampling import MOST_POINTS, sobol_points
from translucent.geometry.normals import CREASE

#: Number of independently scrambled sets, and largest number of values in all of them.
SETS, TABLE = 256, 1 << 22

#: Largest multiple of the requested rays from one point, where a tolerance needs more.
MOST_MULTIPLE, MOST_ADDED = 64, 8192

#: Binary digits of the points, as in float32.
DIGITS = 24

#: A sphere that touches the surface where a ray along w has its exit is seen from its center under pi - 2 theta: beyond
#: this theta the exit belongs to the smooth surface around the point, see `inscribed`.
SPHERE_CONE = 0.5 * (math.pi - CREASE)

#: Rays that a first sphere comes from: more take longer than the faces that they spare.
SPHERE_RAYS = 3

#: Distance, as a share of the radius, within which points have the same set: the same point of two charts, rounded
#: twice.
SAME_POINT = 2.0**-24


@dataclass(frozen=True, eq=False)
class Directions:
    """Ray directions of a bake, independent of the order of points and the number of threads.

    Attributes
    ----------
    table : (3, sets, rays) float32
        Along tangent, bitangent and inward normal; as many rays as a point may ever need.
    seed : int
    """

    table: Floats
    seed: int

    @classmethod
    def of(cls, settings: BakeSettings) -> Directions:
        """Directions for these settings: one down the normal, or Sobol points in the cone."""
        if settings.mode == "inscribed":
            points = _sobol(min(settings.rays, SPHERE_RAYS), SETS, settings.seed)
            return cls(_in_cone(points, SPHERE_CONE, "uniform"), settings.seed)
        if settings.mode == "normal":
            return cls(np.array([0.0, 0.0, 1.0], np.float32).reshape(3, 1, 1), settings.seed)
        count = settings.rays
        if settings.tolerance is not None:
            count = max(count, min(MOST_MULTIPLE * count, MOST_ADDED))
        sets = max(1, min(SETS, TABLE // count))
        points = _sobol(count, sets, settings.seed)
        return cls(_in_cone(points, math.radians(settings.spread / 2.0), settings.weighting), settings.seed)

    @property
    def most(self) -> int:
        """Largest number of rays of a point."""
        return int(self.table.shape[2])

    def at(self, points: Points, begin: int, end: int) -> Floats:
        """(3, k, end - begin): world directions of rays `begin` to `end` of each point."""
        sets = self.table.shape[1]
        chosen = _hash(points.exact, self.seed, sets) if sets > 1 else np.zeros(len(points), dtype=np.int64)
        inward = -points.normal
        frame = [axis.astype(np.float32) for axis in (*_tangents(inward), inward)]
        table, rays = self.table[:, :, begin:end], end - begin
        world = np.empty((3, len(points), rays), dtype=np.float32)
        step = max(1, CACHED_RAYS // rays)
        for first in range(0, len(points), step):
            some = slice(first, first + step)
            local = np.take(table, chosen[some], axis=1)
            product = np.empty(local.shape[1:], dtype=np.float32)
            for axis in range(3):
                into = world[axis, some]
                np.multiply(local[0], frame[0][some, axis, None], out=into)
                for component in (1, 2):
                    np.multiply(local[component], frame[component][some, axis, None], out=product)
                    into += product
        return world


@lru_cache(maxsize=1)  # a batch asks for the same ones again and again
def _sobol(count: int, sets: int, seed: int) -> Array:
    """(sets, count, 2): the first points of the Sobol sequence in 0..1, scrambled independently (Owen 1995).

    SciPy scrambles by a linear map and a shift, which leave blocks of the sequence so alike that they may have equal
    means; nested scrambling, in which each digit is turned or not by a coin of all digits before it, does not.
    """
    digits = np.round(_plain_sobol(count) * 2**DIGITS).astype(np.uint64)
    keys = _mix(np.arange(2 * sets, dtype=np.uint64) + _mix(np.full(2 * sets, seed, dtype=np.uint64)))
    coins = keys.reshape(sets, 1, 2)
    scrambled = np.zeros((sets, count, 2), dtype=np.uint64)
    for digit in range(DIGITS):
        # The leading 1 tells prefixes of different lengths apart.
        prefix = (digits + np.uint64(2**DIGITS)) >> np.uint64(DIGITS - digit)
        own = (digits >> np.uint64(DIGITS - 1 - digit)) & np.uint64(1)
        turned = _mix(coins ^ prefix) >> np.uint64(63)
        scrambled = (scrambled << np.uint64(1)) | (own ^ turned)
    found = np.asarray((scrambled + 0.5) / 2.0**DIGITS)
    found.setflags(write=False)
    return found


def _plain_sobol(count: int) -> Array:
    """(count, 2): the first points in 0..1 of the Sobol sequence: stored ones, as SciPy's statistics load slowly."""
    if count <= MOST_POINTS:
        return sobol_points(count)
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns that numbers other than powers of 2 lose the balance of the sequence; they are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(qmc.Sobol(2, scramble=False).random(count))


def _in_cone(points: Array, half_angle: float, weighting: str) -> Floats:
    """(3, sets, rays): points (sets, rays, 2) of the square as directions within `half_angle` of the z axis."""
    height, turn = points[..., 0], 2.0 * np.pi * points[..., 1]
    if weighting == "cosine":
        # The projected solid angle is uniform in sin^2.
        sine = np.sqrt(height) * math.sin(half_angle)
        cosine = np.sqrt(1.0 - sine * sine)
    else:
        # The solid angle is uniform in 1 - cos.
        fall = height * 2.0 * math.sin(half_angle / 2.0) ** 2
        cosine, sine = 1.0 - fall, np.sqrt(fall * (2.0 - fall))
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine]).astype(np.float32)


def _tangents(normal: Array) -> tuple[Array, Array]:
    """(k, 3), (k, 3): two axes that complete unit normals (k, 3) to a frame (Duff et al. 2017, listing 3)."""
    x, y, z = normal.T
    sign = np.where(z < 0, -1.0, 1.0)
    with np.errstate(under="ignore"):
        a = -1.0 / (sign + z)
        b = x * y * a
        tangent = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
        return tangent, np.stack([b, sign + y * y * a, -y], axis=1)


def _hash(points: Array, seed: int, sets: int) -> npt.NDArray[np.int64]:
    """(k,): a set for each point, by its position alone."""
    cells = np.round(points / SAME_POINT).astype(np.int64).view(np.uint64)
    mixed = np.full(len(points), seed, dtype=np.uint64)
    for axis in range(3):
        mixed = _mix(mixed + cells[:, axis])
    return (mixed % np.uint64(sets)).astype(np.int64)


def _mix(keys: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """A random number for each key: the step of SplitMix64 (Steele, Lea and Flood 2014)."""
    mixed = keys + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))
