"""Errors of a frame against ground truth, on a stated mask."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.errors import InputError
from translucent.frames.frame import Frame

Quantity = Literal["thickness", "transmittance", "optical_depth", "radiance"]


@dataclass(frozen=True)
class Errors:
    """Errors of one quantity, result minus truth, over the pixels of a mask (and the channels of a color).

    Attributes
    ----------
    quantity : str
        What was compared; errors are in its unit: metres for thickness.
    rms, median, p99, p999, max : float
        Of the absolute error; p999 is the 99.9th percentile.
    bias : float
        Mean signed error.
    invalid : float
        Fraction of the covered pixels that the frame marks invalid.
    coverage_mismatch : float
        Pixels that only one of the two covers, as a fraction of the covered ones.
    pixels : int
        How many pixels the mask keeps.
    mask : str
        What the mask keeps, in words.
    """

    quantity: str
    rms: float
    median: float
    p99: float
    p999: float
    max: float
    bias: float
    invalid: float
    coverage_mismatch: float
    pixels: int
    mask: str

    def __str__(self) -> str:
        return (
            f"{self.quantity}: median {self.median:.2g}, p99 {self.p99:.2g}, p99.9 {self.p999:.2g}, "
            f"max {self.max:.2g}, rms {self.rms:.2g}, bias {self.bias:+.2g}; invalid {self.invalid:.4%}; "
            f"coverage differs on {self.coverage_mismatch:.4%} ({self.pixels} pixels: {self.mask})"
        )


@np.errstate(under="ignore")  # of squares of what a dense medium leaves
@checked
def compare(
    frame: Frame, truth: Frame, quantity: Quantity = "thickness", mask: npt.NDArray[np.bool_] | None = None
) -> Errors:
    """Errors of `frame` against `truth`.

    Parameters
    ----------
    frame, truth : Frame
        Of the same size.
    quantity : {"thickness", "transmittance", "optical_depth", "radiance"}
    mask : (h, w) bool, optional
        Pixels to look at, for example `interior`; of these, the ones that both frames cover and call valid count.

    Raises
    ------
    InputError
        If the sizes differ, or no pixel is left.
    """
    if quantity not in get_args(Quantity):
        raise InputError(
            f"quantity {quantity!r}", "no quantity has this name", f"use one of {', '.join(get_args(Quantity))}"
        )
    if frame.size != truth.size:
        raise InputError(
            "compare",
            f"the frame has size {frame.size}, and the truth has size {truth.size}",
            "render both at the same size",
        )
    covered = frame.coverage | truth.coverage
    used = frame.coverage & truth.coverage & frame.valid & truth.valid
    words = "covered and valid in both"
    if mask is not None:
        if np.shape(mask) != used.shape or np.asarray(mask).dtype != bool:
            raise InputError(
                "compare",
                f"the mask is not an array {used.shape} of bool",
                "give a mask of this shape, as `interior` returns it",
            )
        used &= mask
        words += ", and inside the mask"
    if not used.any():
        raise InputError(
            "compare",
            f"no pixel is {words}: the frame covers {int(frame.coverage.sum())} pixels ({int((~frame.valid).sum())} "
            f"invalid), the truth {int(truth.coverage.sum())} ({int((~truth.valid).sum())} invalid)",
            "check that both pictures show the body, and that the mesh of the body is closed",
        )
    error = (
        np.asarray(getattr(frame, quantity), np.float64)[used] - np.asarray(getattr(truth, quantity), np.float64)[used]
    )
    size = np.abs(error)
    median, p99, p999 = np.quantile(size, (0.5, 0.99, 0.999))
    return Errors(
        quantity=quantity,
        rms=float(np.sqrt(np.mean(error**2))),
        median=float(median),
        p99=float(p99),
        p999=float(p999),
        max=float(size.max()),
        bias=float(error.mean()),
        invalid=float((~frame.valid & covered).sum() / covered.sum()),
        coverage_mismatch=float((frame.coverage != truth.coverage).sum() / covered.sum()),
        pixels=int(used.sum()),
        mask=words,
    )


@checked
def interior(hit_counts: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """(h, w) bool: pixels whose 3 x 3 neighborhood has equal hit counts, away from every silhouette.

    At a silhouette a rasterizer decides coverage on a grid of sub-pixels, so it and a ray tracer may disagree there
    about which surfaces a pixel center sees: a matter of coverage, not of thickness.
    """
    hit_counts = np.asarray(hit_counts)
    if hit_counts.ndim != 2 or not hit_counts.size:
        raise InputError(
            f"hit counts of shape {hit_counts.shape}", "the array is not a picture", "give an array of shape (h, w)"
        )
    padded = np.pad(hit_counts, 1, mode="edge")
    height, width = hit_counts.shape
    shifted = [padded[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    return np.asarray(np.all([layer == hit_counts for layer in shifted], axis=0))
