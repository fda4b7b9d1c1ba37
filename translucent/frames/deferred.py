"""Arrays of a frame that are made when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt


class Deferred:
    """Array that is made when it is first asked for, from values that nobody changes.

    Parameters
    ----------
    make : callable
        Of the arguments.
    arguments
        Read-only arrays and numbers.
    """

    def __init__(self, make: Callable[..., npt.NDArray[Any]], *arguments: object) -> None:
        self._make, self._arguments = make, arguments

    def made(self) -> npt.NDArray[Any]:
        """The array, a new one at each call."""
        return self._make(*self._arguments)


def thickness_of(marked: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w): magnitude of a thickness whose sign bit marks what is not valid."""
    found: npt.NDArray[np.float32] = np.abs(marked)
    return found


def valid_of(marked: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """(h, w): whether the sign bit is clear."""
    return np.asarray(marked.view(np.int32) >= 0)


def coverage_of(marked: npt.NDArray[np.float32], floor: float) -> npt.NDArray[np.bool_]:
    """(h, w): whether there is a thickness above `floor`, or none that is valid."""
    return (marked > np.float32(floor)) | np.signbit(marked)


def optical_depth_of(marked: npt.NDArray[np.float32], extinction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): thickness times the extinction (3,) of the one medium."""
    thickness = thickness_of(marked)
    depth = np.empty((*thickness.shape, 3), dtype=np.float32)
    with np.errstate(under="ignore"):
        for channel, value in enumerate(extinction):
            np.multiply(thickness, value, out=depth[..., channel])
    return depth


def transmitted_of(marked: npt.NDArray[np.float32], extinction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): transmittance of thickness in one medium with this extinction (3,)."""
    thickness = thickness_of(marked)
    through, depth = np.empty((*thickness.shape, 3), dtype=np.float32), np.empty_like(thickness)
    with np.errstate(under="ignore"):
        for channel, value in enumerate(extinction):
            np.multiply(thickness, -value, out=depth)
            np.exp(depth, out=depth)
            through[..., channel] = depth
    return through


def transmittance_of(depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w, 3): exp(-tau) of optical depths (Beer-Lambert)."""
    through = np.negative(depth)
    with np.errstate(under="ignore"):
        return np.asarray(np.exp(through, out=through))


def copied(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Copy of an array."""
    return values.copy()
