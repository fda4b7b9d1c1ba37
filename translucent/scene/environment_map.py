"""Pictures of all directions in equirectangular projection: their pixels, lookups and reductions."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Frozen, Integers
from translucent.errors import InputError, TranslucentWarning
from translucent.scene.lights import MAX_RADIANCE


@dataclass(frozen=True, eq=False)
class EnvironmentMap(Frozen):
    """Equirectangular map of linear radiance from all directions.

    Row 0 is straight up (+Y), the center of the picture is -Z, and +X is to the right of it. Pixels are samples at
    their centers; between them lookups are bilinear, around the sides without a seam, and constant beyond the first
    and the last row.

    Parameters
    ----------
    pixels : array_like (h, w, 3)
        Linear radiance, kept as float32. Numbers that are not finite or below 0 become 0, and those above 1e18 that,
        with a `TranslucentWarning` that counts them; another one reports a shape that is not 2:1.

    Raises
    ------
    InputError
        If the shape is another, there is no pixel, or none that can be used.
    """

    pixels: npt.NDArray[np.floating[Any]]

    def __post_init__(self) -> None:
        try:
            given = np.asarray(self.pixels)
            if given.dtype.kind not in "biuf":
                given = given.astype(np.float64)
        except (TypeError, ValueError):
            raise InputError("environment image", "the pixels are not numbers", "give an array of floats") from None
        if given.ndim != 3 or given.shape[2] != 3 or given.size == 0:
            raise InputError(
                "environment image",
                f"the array has shape {given.shape}",
                "give linear radiance in an array of shape (h, w, 3)",
            )
        usable, doubts = _usable(given)
        if usable.shape[1] != 2 * usable.shape[0]:
            size = f"{usable.shape[1]}x{usable.shape[0]} pixels"
            doubts.append(f"{size}: a picture of all directions is twice as wide as high, so this picture is stretched")
        for doubt in doubts:
            # The caller of tl.Environment.image, past this function, the constructor and `image`.
            warnings.warn(f"environment image: {doubt}", TranslucentWarning, stacklevel=5)
        usable.setflags(write=False)
        object.__setattr__(self, "pixels", usable)

    def __repr__(self) -> str:
        return f"EnvironmentMap({self.size[0]}x{self.size[1]})"

    @classmethod
    def from_formula(cls, radiance: Callable[[Array], npt.ArrayLike], height: int) -> EnvironmentMap:
        """Map from a function of unit vectors (n, 2n, 3) to radiance (n, 2n, 3), n rows high."""
        return cls(np.asarray(radiance(texel_directions(height, 2 * height))).astype(np.float32))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @cached_property
    def mean(self) -> Array:
        """(3,): mean over all directions; each pixel counts as much as its solid angle."""
        height, width = self.pixels.shape[:2]
        rows = self.pixels.mean(axis=1, dtype=np.float64)
        return np.asarray(row_solid_angles(height, width) @ rows * (width / (4.0 * np.pi)))

    def at(self, uv: npt.ArrayLike) -> Array:
        """(..., 3) float64: bilinear lookups at positions (..., 2), as `environment.equirectangular_uv` has them."""
        return bilinear(self.pixels[None], np.zeros(np.shape(uv)[:-1], np.intp), uv)

    def reduced(self, height: int, width: int) -> Array:
        """(height, width, 3) float64: means over the solid angle of larger pixels; smaller ones are left as they are.

        The integral over all directions stays what it is.
        """
        own_height, own_width = self.pixels.shape[:2]
        pixels = self.pixels.reshape(own_height, -1)
        rows = _overlaps(-np.cos(np.linspace(0, np.pi, own_height + 1)), -np.cos(np.linspace(0, np.pi, height + 1)))
        columns = _overlaps(np.linspace(0, 1, own_width + 1), np.linspace(0, 1, width + 1))
        with np.errstate(under="ignore"):
            # Most of these fractions are 0, and in a large picture rows are by far the most work.
            lower = np.stack([row[part] @ pixels[part] for row, part in zip(rows, map(_held, rows), strict=True)])
            lower = lower.reshape(height, own_width, 3)
            return np.asarray(np.einsum("xj,yjc->yxc", columns, lower, optimize=True))


def bilinear(maps: npt.NDArray[np.floating[Any]], number: Integers, uv: npt.ArrayLike) -> Array:
    """(..., 3) float64: lookups as of `EnvironmentMap.at` in those of the maps (m, h, w, 3) with a number (...)."""
    height, width = maps.shape[1:3]
    u, v = np.moveaxis(np.asarray(uv, dtype=np.float64), -1, 0)
    column, across = _split(u * width - 0.5)
    row, down = _split(np.clip(v * height - 0.5, 0.0, height - 1.0))
    left, right = column % width, (column + 1) % width
    upper, lower = ((number * height + at) * width for at in (row, np.minimum(row + 1, height - 1)))
    pixels = maps.reshape(-1, 3)
    with np.errstate(under="ignore"):
        top = _mix(pixels.take(upper + left, axis=0), pixels.take(upper + right, axis=0), across)
        bottom = _mix(pixels.take(lower + left, axis=0), pixels.take(lower + right, axis=0), across)
        return _mix(top, bottom, down)


def row_blocks(height: int, width: int) -> Iterator[slice]:
    """Slices of rows to be processed at a time: about a million pixels."""
    step = max(1, (1 << 20) // max(width, 1))
    return (slice(row, row + step) for row in range(0, height, step))


def row_solid_angles(height: int, width: int) -> Array:
    """(height,): exact solid angle in sr of a pixel in each row of an equirectangular picture."""
    edges = np.linspace(0.0, np.pi, height + 1)
    # cos a - cos b as a product: near the poles the difference would cancel.
    return 4.0 * np.pi / width * np.sin(0.5 * (edges[1:] + edges[:-1])) * np.sin(0.5 * np.diff(edges))


def texel_directions(height: int, width: int) -> Array:
    """(height, width, 3): unit vectors through the centers of the pixels of an equirectangular picture."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = 2.0 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    return np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)), axis=-1
    )


def _overlaps(fine: Array, coarse: Array) -> Array:
    """(coarse cells, fine cells): the fraction of each coarse cell that a fine one covers; rows sum to 1."""
    low = np.maximum(coarse[:-1, None], fine[None, :-1])
    high = np.minimum(coarse[1:, None], fine[None, 1:])
    return np.asarray(np.maximum(high - low, 0.0) / np.diff(coarse)[:, None])


def _held(fractions: Array) -> slice:
    """From the first to the last of the fractions that are not 0."""
    found = np.flatnonzero(fractions)
    return slice(found[0], found[-1] + 1)


def _split(position: Array) -> tuple[npt.NDArray[np.intp], Array]:
    whole = np.floor(position)
    return whole.astype(np.intp), (position - whole)[..., None]


def _mix(first: npt.NDArray[Any], second: npt.NDArray[Any], fraction: Array) -> Array:
    return np.asarray(first * (1.0 - fraction) + second * fraction)


def _usable(given: npt.NDArray[Any]) -> tuple[npt.NDArray[np.float32], list[str]]:
    """Pixels with all values that are no radiance replaced, and a description of the replacements.

    In blocks of rows: a large picture is in memory once, and not once for each step.
    """
    pixels, any_right, counts = np.empty(given.shape, dtype=np.float32), False, np.zeros(3, dtype=np.int64)
    for rows in row_blocks(*given.shape[:2]):
        with np.errstate(invalid="ignore"):  # of signaling NaNs
            values = given[rows].astype(np.float64)
            least, most = values.min(), values.max()
        if least >= 0.0 and most <= MAX_RADIANCE:  # of NaN neither is true
            with np.errstate(under="ignore"):
                pixels[rows], any_right = values, True
            continue
        unknown = ~np.isfinite(values)
        negative, high = (values < 0) & ~unknown, (values > MAX_RADIANCE) & ~unknown
        wrong = unknown | negative
        any_right |= not wrong.all()
        counts += [np.count_nonzero(where.any(axis=2)) for where in (unknown, negative, high)]
        with np.errstate(under="ignore"):
            pixels[rows] = np.minimum(np.where(wrong, 0.0, values), MAX_RADIANCE)
    if not any_right:
        raise InputError(
            "environment image", "no pixel has a finite radiance of 0 or above", "check how this image was made"
        )
    count = given.shape[0] * given.shape[1]
    words = (("not finite", "0"), ("below 0", "0"), (f"above {MAX_RADIANCE:g}", "that"))
    doubts = [
        f"{found} of {count} pixels are {what}, taken as {become}"
        for found, (what, become) in zip(counts.tolist(), words, strict=True)
        if found
    ]
    return pixels, doubts


#: Rows and columns of the irradiance map, which changes slowly.
IRRADIANCE_SIZE = (64, 128)

#: Rounds of `_balanced`: each halves the imbalance.
BALANCING_ROUNDS = 50

#: Pairs of rows that are transformed at a time.
_PAIRS = 128

#: Number of pictures whose blurred versions are cached.
KEPT = 8


@lru_cache(maxsize=KEPT)
def irradiance_map(source: EnvironmentMap) -> EnvironmentMap:
    """Irradiance map by normal: the integral over all directions of radiance times cosine; made once.

    Its lookups differ from the integral by a thousandth of the contrast, and within 1.4 degrees of a pole, where all
    that is known are the pixels around it, by a hundredth.
    """
    color = source.pixels[0, 0]
    if (source.pixels == color).all():  # which blurring leaves as it is
        return EnvironmentMap(np.full((*IRRADIANCE_SIZE, 3), np.pi * color))
    pixels = sized(source, IRRADIANCE_SIZE)
    return EnvironmentMap(np.pi * convolved(pixels, lambda cosines: np.maximum(cosines, 0.0)))


def sized(source: EnvironmentMap, size: tuple[int, int]) -> Array:
    """Resample a picture to this height and width: the means of smaller pixels, lookups between larger ones."""
    height, width = size
    if source.size[0] >= width and source.size[1] >= height:
        return source.reduced(height, width)
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return source.at(np.stack(np.meshgrid(u, v), axis=-1))


def convolved(pixels: Array, lobe: Callable[[Array], Array]) -> Array:
    """(h, w, 3): mean of the pixels around each, weighted by a lobe, a function of the cosine of the angle; h is even.

    What a picture has in common with its mirror image in the equator, and what it has not, are blurred apart.
    """
    height, width = pixels.shape[:2]
    half = height // 2
    near, far = _spectra(height, width, lobe)
    solid_angles = row_solid_angles(height, width)[:half]
    balance = _balanced((near[0] + far[0]) * solid_angles)
    scale = 0.5 * balance[:, None] * balance * solid_angles
    # The spectra are real: real and imaginary parts of the picture's are columns of their own.
    transformed = np.ascontiguousarray(np.fft.rfft(pixels, axis=1)).view(np.float64).swapaxes(0, 1)
    upper, lower = transformed[:, :half], transformed[:, : half - 1 : -1]
    even = ((near + far) * scale) @ (upper + lower)
    odd = ((near - far) * scale) @ (upper - lower)
    blurred = np.concatenate([even + odd, (even - odd)[:, ::-1]], axis=1).swapaxes(0, 1)
    found = np.fft.irfft(np.ascontiguousarray(blurred).view(np.complex128), n=width, axis=1)
    return np.ascontiguousarray(np.maximum(found, 0.0))


def _spectra(height: int, width: int, lobe: Callable[[Array], Array]) -> tuple[Array, Array]:
    """(width / 2 + 1, height / 2, height / 2) each: Fourier transforms in longitude of a lobe, for pairs of upper rows,
    and of an upper row and the mirror image of one in the equator.

    They are the same for two rows in turn and for their mirror images, so a quarter of all pairs is made.
    """
    cosines, near, far = _cosines_between(height, width)
    found = np.empty((width // 2 + 1, len(cosines)))
    for begin in range(0, len(cosines), _PAIRS):  # that stay in a cache
        weights = lobe(cosines[begin : begin + _PAIRS])
        # A lobe is even in longitude: its transform is real.
        both = np.concatenate([weights, weights[:, -2:0:-1]], axis=1)
        found[:, begin : begin + _PAIRS] = np.fft.rfft(both, axis=1).real.T
    return found.take(near, axis=1), found.take(far, axis=1)


@lru_cache(maxsize=2)
def _cosines_between(height: int, width: int) -> tuple[Array, Integers, Integers]:
    """Cosines (n, width / 2 + 1) of the angles from a pixel of one row to those of another and some columns on, for a
    quarter of all pairs of rows, and the numbers (height / 2, height / 2) of these pairs: of two upper rows, and of one
    and the mirror image of another in the equator.
    """
    half = height // 2
    first, second = np.triu_indices(half)
    pairs = np.concatenate([[first, second], [first, height - 1 - second]], axis=1)
    near, far = np.zeros((2, half, half), np.intp)
    near[first, second] = near[second, first] = np.arange(len(first))
    far[:] = near + len(first)
    theta = np.pi * (np.arange(height) + 0.5) / height
    across = np.cos(2.0 * np.pi * np.arange(width // 2 + 1) / width)
    (cosine, other), (sine, other_sine) = np.cos(theta)[pairs], np.sin(theta)[pairs]
    return (cosine * other)[:, None] + (sine * other_sine)[:, None] * across, near, far


def _balanced(weights: Array) -> Array:
    """(h,): factors s of rows and columns after which s_i w_ij s_j has rows of sum 1.

    A lobe in steps of whole pixels has not quite the same integral around each of them. With one factor for rows and
    columns it stays symmetric, so that a pixel's light is as much after as before; dividing rows by their sums would
    keep uniform light only. Symmetric scaling: Knight, Ruiz & Ucar 2014.
    """
    balance = np.ones(len(weights))
    for _ in range(BALANCING_ROUNDS):
        balance = np.sqrt(balance / (weights @ balance))
    return balance
