"""Fit of an absorbing medium to measured colors: a photographed wedge, or swatches of known thickness."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.colors import parse_color
from translucent.media.conversion import CHANNELS
from translucent.media.medium import Medium
from translucent.media.tables import check_cells, read_table
from translucent.units import metres_per_unit


@dataclass(frozen=True, eq=False)
class Fit:
    """An absorbing medium fitted to samples.

    Attributes
    ----------
    medium : Medium
        Its absorption is the least-squares one, per channel, and at least 0.
    standard_error : (3,) float64 or None
        Of the absorption, in 1/m, from the scatter of the samples; None with a single one, which has no scatter.
    residuals : (n, 3) float64
        log(color) + sigma_a d: how much brighter a sample is than the fit, in log space; 0.01 is 1 %.
    distances : (n,) float64
        Metres.
    colors : (n, 3) float64
        Linear.
    weights : (n,) float64
    clipped : tuple of str
        Channels whose best absorption was negative and became 0: their samples brighten with distance.
    """

    medium: Medium
    standard_error: Array | None
    residuals: Array
    distances: Array
    colors: Array
    weights: Array
    clipped: tuple[str, ...]

    def _repr_html_(self) -> str:
        """Swatches of the fitted medium, for notebooks."""
        return self.medium._repr_html_()


def fit_medium(
    distances: npt.ArrayLike,
    colors: npt.ArrayLike,
    weights: npt.ArrayLike | None = None,
    ior: float = 1.0,
) -> Fit:
    """Fit an absorbing medium to colors at distances: weighted least squares in log space, per channel.

    The sigma_a >= 0 that minimizes sum w (log t + sigma_a d)^2. The line goes through white at distance 0, so
    reflection at the surface should be divided out first.

    Parameters
    ----------
    distances : array_like (n,)
        Metres, > 0.
    colors : array_like (n, 3), or a sequence of n colors
        Transmitted: hex and names are sRGB, bare triples linear; > 0. Noise above 1 is welcome: it averages out.
    weights : array_like (n,), optional
        Relative, >= 0 and not all 0: inverse variances of log t. Default: 1 each. A sample of weight 0 is left out.
    ior : float
        Index of refraction of the medium.

    Raises
    ------
    InputError
        If there is no sample, or a value is outside its range.
    """
    d, t, w = _samples(distances, colors, weights)
    best, residuals, error = _least_squares(d, -np.log(t), w)
    clipped = tuple(name for name, value in zip(CHANNELS, best, strict=True) if value < 0)
    return Fit(Medium(absorption=np.maximum(best, 0.0), ior=ior), error, residuals, d, t, w, clipped)


def fit_wedge(path: str | Path, unit: str = "m") -> Fit:
    """Fit an absorbing medium to a table of a photographed wedge: CSV, or a JSON list of objects.

    Parameters
    ----------
    path : str or Path
        Columns ``distance``, ``color`` (as `parse_color` reads it) or ``r``, ``g``, ``b`` (linear), and, if the samples
        differ in trust, ``weight``.
    unit : str
        Of distances that name none.

    Raises
    ------
    InputError
        If the table cannot be used; the message names the line.
    """
    metres_per_unit(unit)
    samples = []
    for row in read_table(path, needs=[("distance",), ("color", "r"), ("color", "g"), ("color", "b")]):
        try:
            check_cells(row)
            weight = row.number("weight") if "weight" in row.cells else 1.0
            distance, color = row.length("distance", unit), row.color()
            _samples([distance], [color], None)
        except InputError as error:
            raise InputError(f"{row.location}: {error}") from None
        samples.append((distance, color, weight))
    distances, colors, weights = zip(*samples, strict=True)
    return fit_medium(distances, colors, weights)


def _least_squares(d: Array, depth: Array, w: Array) -> tuple[Array, Array, Array | None]:
    """Least-squares slopes (3,), residuals (n, 3) to those of 0 and above, and the slopes' standard errors (3,)."""
    longest = d.max()
    share = (d / longest)[:, None]  # of the longest distance, so that no square overflows
    with np.errstate(under="ignore"):
        spread = (w[:, None] * share**2).sum()
        best = (w[:, None] * share * depth).sum(axis=0) / spread
        residuals = share * np.maximum(best, 0.0) - depth
        count = int((w > 0).sum())
        if count == 1:
            return best / longest, residuals, None
        variance = (w[:, None] * residuals**2).sum(axis=0) / (count - 1)
        return best / longest, residuals, np.sqrt(variance / spread) / longest


def _samples(
    distances: npt.ArrayLike, colors: npt.ArrayLike, weights: npt.ArrayLike | None
) -> tuple[Array, Array, Array]:
    """Checked distances (n,), linear colors (n, 3) and weights (n,), largest 1."""
    d = np.asarray(distances, dtype=np.float64)
    listed = colors if isinstance(colors, np.ndarray) else list(colors)  # type: ignore[arg-type]
    t = np.array([parse_color(color) for color in listed], dtype=np.float64).reshape(-1, 3)
    w = np.ones(len(t)) if weights is None else np.asarray(weights, dtype=np.float64)
    if not (d.shape == w.shape == t.shape[:1] and d.size):
        raise InputError(
            f"fit to {d.size} distances, {len(t)} colors and {w.size} weights", "not as many, or none", "pair them up"
        )
    if not (np.isfinite(d).all() and (d > 0).all()):
        raise InputError("fit", "a distance is not above 0 and finite", "give metres")
    if not (t > 0).all():
        raise InputError(
            f"fit to color {t[(t <= 0).any(axis=1)][0].tolist()}", "a channel is not above 0", "leave it out"
        )
    if not (np.isfinite(w).all() and (w >= 0).all() and (w > 0).any()):
        raise InputError("weights of a fit", "negative, not finite or all 0", "give numbers of 0 and above")
    with np.errstate(under="ignore"):
        return d, t, w / w.max()
