"""Fits of an absorbing medium to measured colors: a photographed wedge, or swatches of known thickness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.media.colors import parse_color
from translucent.media.conversion import CHANNELS
from translucent.media.medium import Medium
from translucent.media.preset import check_cells, read_table
from translucent.units import metres_per_unit

#: Probability at which a scatter is more than noise, and a line is bent, or differs from photograph to photograph.
SCATTER_LEVEL, DOUBT_LEVEL = 0.05, 0.01

#: Share by which the slope has to change from thin to thick, or from photograph to photograph, to be spoken of.
BEND, DISAGREEMENT = 0.1, 0.03

#: Standard errors, and -log(T) from the thinnest step to the thickest, by which a channel clearly brightens.
_CLEAR, _BRIGHTER = 3.0, 0.1

#: Smallest relative error of a transmittance: that of numbers in float32.
_FLOOR = 1e-6

#: Largest error of a step's optical depth, and halvings of the interval that holds its logarithm.
_MOST, _HALVINGS = 1e3, 24


class PatchTransmittances(NamedTuple):
    """Transmittances of the patches of one photograph.

    Attributes
    ----------
    name : str
    thickness : (n,) float64
        Metres, > 0.
    depth : (n, 3) float64
        -log(T) against white; NaN where it is left out.
    variance : (n, 3) float64
        Of `depth`, by each patch's own noise.
    white_variance : (3,) float64
        Of `depth`, by the noise of the white that all patches share.
    """

    name: str
    thickness: Array
    depth: Array
    variance: Array
    white_variance: Array


@dataclass(frozen=True, eq=False)
class StepFit:
    """An absorbing medium fitted to transmittances, with error bars.

    Attributes
    ----------
    medium : Medium
        Its absorption is the fitted extinction, at least 0.
    standard_error : (3,) float64
        Of the extinction, in 1/m.
    interval : (3,) float64
        Half width in 1/m of the interval that holds the extinction with a probability of 95 %.
    surface_loss : (3,) float64
        Fraction of light that the faces keep back by the fit, 1 - exp(-k); with a known index of refraction, by that.
    chi2_per_degree : (3,) float64 or NaN
        About 1 where noise alone scatters the residuals; NaN with as many unknowns as samples. Where it is above, the
        errors have grown.
    samples : (3,) int
        Patches of all photographs that count, per channel.
    distance : float
        Median thickness in metres.
    warnings : tuple of str
    """

    medium: Medium
    standard_error: Array
    interval: Array
    surface_loss: Array
    chi2_per_degree: Array
    samples: Array
    distance: float
    warnings: tuple[str, ...]

    def _repr_html_(self) -> str:
        """Swatches of the fitted medium, for notebooks."""
        return self.medium._repr_html_()


class _Line(NamedTuple):
    best: Array
    errors: Array
    chi2: float
    degrees: int

    @property
    def scale(self) -> float:
        return max(1.0, np.sqrt(self.chi2 / self.degrees)) if self.degrees else 1.0


class _ChannelSamples(NamedTuple):
    """Samples of one channel: thickness and depth (n,), their covariance, and the photograph of each."""

    thickness: Array
    depth: Array
    covariance: Array
    photograph: npt.NDArray[np.int64]

    def line(self, degree: int, fixed: bool, of: int | None = None) -> _Line:
        """Least-squares polynomial, its constant last unless `fixed` to 0, of one photograph or of all."""
        kept = np.ones(len(self.depth), bool) if of is None else self.photograph == of
        d = self.thickness[kept]
        powers = range(degree, 0 if fixed else -1, -1)
        design = np.stack([(d / self.thickness.max()) ** power for power in powers], axis=-1)
        root = np.linalg.cholesky(self.covariance[np.ix_(kept, kept)])
        a, b = np.linalg.solve(root, design), np.linalg.solve(root, self.depth[kept])
        inverse = np.linalg.inv(a.T @ a)
        best = inverse @ (a.T @ b)
        scale = self.thickness.max() ** np.array(powers, dtype=np.float64)
        chi2 = float(((b - a @ best) ** 2).sum())
        return _Line(best / scale, np.sqrt(np.diag(inverse)) / scale, chi2, len(d) - len(best))

    def repeated(self) -> tuple[float, int]:
        """chi2 of photographs about their common mean at each step, and its degrees of freedom."""
        steps, index = np.unique(self.thickness, return_inverse=True)
        root = np.linalg.cholesky(self.covariance)
        a, b = np.linalg.solve(root, np.eye(len(steps))[index]), np.linalg.solve(root, self.depth)
        best = np.linalg.lstsq(a, b, rcond=None)[0]
        return float(((b - a @ best) ** 2).sum()), len(index) - len(steps)

    def scattered(self, fixed: bool, chi2: float) -> _Line:
        """Line for which each step has an error in all photographs alike, as large as leaves this chi2."""
        shared = (self.thickness[:, None] == self.thickness).astype(np.float64)
        low, high = np.log(_FLOOR), np.log(_MOST)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            line = self._replace(covariance=self.covariance + np.exp(2.0 * middle) * shared).line(1, fixed)
            low, high = (middle, high) if line.chi2 > chi2 else (low, middle)
        return line


def fit_steps(photographs: Sequence[PatchTransmittances], ior: float | None = None) -> StepFit:
    """Fit a medium to the transmittances of all photographs together.

    Parameters
    ----------
    photographs : sequence of Steps
    ior : float, optional
        Index of refraction of the plates, whose loss at both faces is then divided out. Default: it is fitted, where
        there are two thicknesses.

    Raises
    ------
    InputError
        If no sample of a channel is left, or the index is none, or some channel brightens with thickness and none
        darkens.
    """
    index = Medium(ior=1.0 if ior is None else ior).ior  # one that is none is refused before it is calculated with
    channels = [_channel(photographs, channel, ior) for channel in range(3)]
    slopes = [_slope(samples) for samples in channels]
    if min(slopes) < 0 and max(slopes) <= 0:
        which = [name for name, slope in zip(CHANNELS, slopes, strict=True) if slope < 0]
        who = "all channels are" if len(which) == 3 else f"{' and '.join(which)} {'is' if len(which) == 1 else 'are'}"
        rest = "" if len(which) == 3 else ", and no channel is darker"
        do = "list the thicknesses from left to right, or from top to bottom in an upright patch"
        raise InputError(
            "fit to photographs", f"{who} brighter where the plate is thicker, which is physically impossible{rest}", do
        )
    found = [_fit_channel(photographs, samples, number, ior) for number, samples in enumerate(channels)]
    sigma, error, interval, loss, chi2, samples = (np.array(row) for row in list(zip(*found, strict=True))[:6])
    warnings = [line for one in found for line in one[6]]
    warnings += [
        f"{name} brightens with thickness, so its extinction is set to 0"
        for name, value in zip(CHANNELS, sigma, strict=True)
        if value < 0
    ]
    medium = Medium(absorption=np.maximum(sigma, 0.0), ior=index)
    distance = float(np.median(np.concatenate([one.thickness for one in photographs])))
    return StepFit(medium, error, interval, loss, chi2, samples, distance, tuple(dict.fromkeys(warnings)))


def _slope(samples: _ChannelSamples) -> int:
    """-1 where light clearly grows with thickness, 1 where it clearly falls, else 0."""
    if len(np.unique(samples.thickness)) < 2:
        return 0
    line = samples.line(1, fixed=False)
    loss = line.best[0]
    clear = abs(loss) > _CLEAR * line.errors[0] and abs(loss) * np.ptp(samples.thickness) > _BRIGHTER
    return int(np.sign(loss)) if clear else 0


def _fit_channel(
    photographs: Sequence[PatchTransmittances], samples: _ChannelSamples, channel: int, ior: float | None
) -> tuple[float, float, float, float, float, int, list[str]]:
    from scipy.special import chdtrc, stdtrit

    steps = len(np.unique(samples.thickness))
    fixed = ior is not None or steps == 1
    line = samples.line(1, fixed)
    chi2 = line.chi2 / line.degrees if line.degrees else np.nan
    repeated, repeats = samples.repeated()
    unfit, degrees, quantile = line.chi2 - repeated, steps - len(line.best), 1.96
    if degrees and unfit > degrees:
        line = samples.scattered(fixed, repeated + degrees)
        quantile = stdtrit(degrees, 0.975) if chdtrc(degrees, unfit) < SCATTER_LEVEL else quantile
    error = line.errors[0] * (max(1.0, np.sqrt(repeated / repeats)) if repeats else 1.0)
    warnings = [] if steps > 2 - fixed else [_few(steps, ior)]
    if steps > 2:
        warnings += _bent(samples, fixed, channel, line.best[0])
    if len(photographs) > 1 and steps > 1:
        warnings += _disagreeing(photographs, samples, fixed, channel, line.best[0])
    loss = _reflected(ior) if ior is not None else -np.expm1(-line.best[1]) if not fixed else 0.0
    return line.best[0], error, quantile * error, float(loss), chi2, len(samples.depth), warnings


def _channel(photographs: Sequence[PatchTransmittances], channel: int, ior: float | None) -> _ChannelSamples:
    kept = [np.isfinite(one.depth[:, channel]) for one in photographs]
    counts = [int(use.sum()) for use in kept]
    if not sum(counts):
        do = "change the exposure, or photograph thinner steps"
        raise InputError(f"fit of {CHANNELS[channel]}", "every patch is too dark or saturated in this channel", do)
    pairs = list(zip(photographs, kept, strict=True))
    depth = np.concatenate([one.depth[use, channel] for one, use in pairs])
    noise = np.concatenate([one.variance[use, channel] for one, use in pairs]) + _FLOOR**2
    number = np.repeat(np.arange(len(photographs)), counts)
    shared = np.array([one.white_variance[channel] for one in photographs])[number]
    covariance = np.diag(noise) + np.where(number[:, None] == number, shared, 0.0)
    thickness = np.concatenate([one.thickness[use] for one, use in pairs])
    return _ChannelSamples(thickness, _inside(depth, ior), covariance, number)


def _reflected(ior: float) -> float:
    """Fraction of light that both faces of a clear slab reflect: 2 R / (1 + R)."""
    r = _reflectance(ior)
    return 2.0 * r / (1.0 + r)


def _reflectance(ior: float) -> float:
    """Fraction of perpendicular light that one face reflects (Fresnel)."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def _inside(depth: Array, ior: float | None) -> Array:
    """Optical depth tau of a slab from the -log(T) of all that it lets through.

    The inverse of T = (1 - R)^2 x / (1 - R^2 x^2), x = exp(-tau) (`slab_transmittance`).
    """
    if ior is None or ior == 1.0:
        return depth
    r, t = _reflectance(ior), np.exp(-depth)
    clear = (1.0 - r) ** 2
    return np.asarray(-np.log(2.0 * t / (clear + np.sqrt(clear**2 + 4.0 * r * r * t * t))))


def _few(steps: int, ior: float | None) -> str:
    if ior is not None:
        return "one thickness cannot show whether light falls off exponentially; photograph more thicknesses"
    if steps == 1:
        return "with one thickness, reflection (8 % at ior 1.5) counts as absorption; state the ior, or photograph more"
    return "two thicknesses cannot show whether light falls off exponentially; photograph three"


def _bent(samples: _ChannelSamples, fixed: bool, channel: int, slope: float) -> list[str]:
    """Warning where a parabola fits clearly better than a line."""
    from scipy.special import stdtrit

    curve = samples.line(2, fixed)
    limit = stdtrit(curve.degrees, 1.0 - 0.5 * DOUBT_LEVEL) if curve.degrees else 3.0
    reach = samples.thickness.max() - samples.thickness.min()
    change = 2.0 * curve.best[0] * reach
    if abs(curve.best[0]) <= limit * curve.scale * curve.errors[0] or abs(change) <= BEND * abs(slope):
        return []
    why = (
        "less than exponentially, as with multiple scattering or stray light in the lens"
        if change < 0
        else "more than exponentially, as with clipped dark values or wrong thicknesses"
    )
    return [f"{CHANNELS[channel]} falls off {why}: the extinction is right only near the photographed thicknesses"]


def _disagreeing(
    photographs: Sequence[PatchTransmittances], samples: _ChannelSamples, fixed: bool, channel: int, slope: float
) -> list[str]:
    """Warning where the photographs have slopes of their own."""
    from scipy.special import chdtrc

    usable = [i for i in range(len(photographs)) if len(np.unique(samples.thickness[samples.photograph == i])) > 1]
    lines = [samples.line(1, fixed, i) for i in usable]
    slopes, weights = np.array([one.best[0] for one in lines]), np.array([one.errors[0] ** -2.0 for one in lines])
    if len(lines) < 2:
        return []
    chi2 = float((weights * (slopes - np.average(slopes, weights=weights)) ** 2).sum())
    spread = float(np.ptp(slopes))
    if chdtrc(len(lines) - 1, chi2) >= DOUBT_LEVEL or spread <= DISAGREEMENT * abs(slope):
        return []
    ends = [photographs[usable[i]].name for i in (int(slopes.argmin()), int(slopes.argmax()))]
    percent = 100.0 * spread / max(abs(slope), 1e-300)
    return [
        f"{CHANNELS[channel]} differs by {percent:.0f} % between {ends[0]} and {ends[1]}, perhaps by the tone curve "
        "of the camera: develop raw files without a tone curve, or save linear .exr"
    ]


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


@checked
def fit_medium(
    distances: npt.ArrayLike,
    colors: npt.ArrayLike | Sequence[str],
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


@checked
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
    relative = (d / longest)[:, None]  # of the longest distance, so that no square overflows
    with np.errstate(under="ignore"):
        spread = (w[:, None] * relative**2).sum()
        best = (w[:, None] * relative * depth).sum(axis=0) / spread
        residuals = relative * np.maximum(best, 0.0) - depth
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
    if np.ndim(colors) == 0:
        raise InputError("fit to colors", "a single number is not a color", "give one color for each distance")
    listed = colors if isinstance(colors, np.ndarray) else list(colors)  # type: ignore[arg-type]
    t = np.array([parse_color(color) for color in listed], dtype=np.float64).reshape(-1, 3)
    w = np.ones(len(t)) if weights is None else np.asarray(weights, dtype=np.float64)
    if not (d.shape == w.shape == t.shape[:1] and d.size):
        raise InputError(
            f"fit to {d.size} distances, {len(t)} colors and {w.size} weights",
            "the numbers of distances, colors and weights differ, or are 0",
            "give one color and one weight for each distance",
        )
    if not (np.isfinite(d).all() and (d > 0).all()):
        raise InputError("fit", "a distance is not finite, or not above 0", "give distances in metres")
    if not (t > 0).all():
        raise InputError(
            f"fit to color {t[(t <= 0).any(axis=1)][0].tolist()}",
            "a channel of the color is not above 0",
            "remove this color from the data",
        )
    if not (np.isfinite(w).all() and (w >= 0).all() and (w > 0).any()):
        raise InputError(
            "weights of a fit", "a weight is negative or not finite, or all weights are 0", "give weights of 0 or above"
        )
    with np.errstate(under="ignore"):
        return d, t, w / w.max()
