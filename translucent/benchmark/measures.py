"""Errors of a picture against the truth of its scene, and signs of typical mistakes in the picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import affine_transform, uniform_filter

from translucent.arrays import Array, Mask
from translucent.bench.judgement import JUST_NOTICEABLE, lab
from translucent.bench.truth import bias, block_error, nrmse
from translucent.benchmark.truth import TruthPicture
from translucent.errors import RenderError
from translucent.extras import require_package
from translucent.formulas.color import linear_to_srgb, srgb_to_linear

#: nRMSE below which a picture is near enough, so that nothing is suspected.
NEAR = 0.06

#: A picture is suspected where a change makes its error less than this part of what it was.
SUSPICIOUS = 0.5

#: Fraction of the scenes that must be suspected of one thing before it is said of all.
MOST = 0.5

#: Factors by which a picture may be zoomed, and stops by which the exposure must be off, to be suspected.
ZOOMS = (0.5, 0.67, 0.75, 0.8, 0.9, 1.1, 1.25, 1.33, 1.5, 2.0)
STOPS = 0.25

#: Pixels of sub-pixel position that a shift must exceed: half a pixel is a matter of where centers are.
SHIFTED = 1.5


@dataclass(frozen=True)
class Score:
    """Errors of one picture.

    Attributes
    ----------
    nrmse : float
        Root mean square error of the radiance, freed of the truth's noise, as a fraction of the truth's mean.
    block : float
        The same, of means over blocks of 4 x 4 pixels: noise and edges count less, wrong light as much.
    bias : (float, float, float)
        Mean of each channel by the truth's, less 1.
    flip : float
        Mean FLIP (HDR), 0 to 1: how visible the differences are when one flips between the two pictures.
    visible : float
        Fraction of pixels whose color is off by more than is just noticed (2.3 in CIELAB), in means over 3 x 3.
    own_flip, own_visible : float
        What a perfect picture would get of both, for the truth's own noise.
    thickness : ThicknessScore, optional
    suspicions : tuple of str
        What the picture seems to be instead.
    """

    nrmse: float
    block: float
    bias: tuple[float, float, float]
    flip: float
    visible: float
    own_flip: float
    own_visible: float
    thickness: ThicknessScore | None = None
    suspicions: tuple[str, ...] = ()


@dataclass(frozen=True)
class ThicknessScore:
    """Errors of thickness, as fractions of the largest thickness of the scene.

    Attributes
    ----------
    median, p99, p999 : float
        Of the absolute error, over pixels that both cover and the renderer does not mark (NaN).
    missed : float
        Fraction of the covered pixels where only one of the two finds a body.
    marked : float
        Fraction of the covered pixels that the renderer marks as not known.
    """

    median: float
    p99: float
    p999: float
    missed: float
    marked: float


def score_thickness_alone(thickness: Array, truth: TruthPicture) -> Score:
    """Score of a renderer that has thickness (h, w) in metres and no light."""
    none = math.nan
    scored = None if truth.thickness is None else score_thickness(thickness, truth.thickness)
    return Score(none, none, (none, none, none), none, none, none, none, scored)


def score_picture(picture: Array, truth: TruthPicture, thickness: Array | None = None) -> Score:
    """Errors of linear radiance (h, w, 3), and of thickness (h, w) in metres, of the size of the truth."""
    picture = np.nan_to_num(picture.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    used = truth.mask
    one, other = (half.astype(np.float64) for half in truth.halves)
    right = truth.radiance
    return Score(
        nrmse=nrmse(picture, truth.halves, used),
        block=block_error(picture, truth.halves, used),
        bias=bias(picture, truth.halves, used),
        flip=flip(picture, right, used),
        visible=_visible(picture, right, used),
        own_flip=flip(right + 0.5 * (one - other), right, used),
        own_visible=_visible(right + 0.5 * (one - other), right, used),
        thickness=None if thickness is None or truth.thickness is None else score_thickness(thickness, truth.thickness),
        suspicions=tuple(suspicions(picture, truth)),
    )


def flip(picture: Array, right: Array, used: Mask) -> float:
    """Mean FLIP of HDR pictures (Andersson et al. 2021) over some pixels; NaN where the package is not installed."""
    try:
        package = require_package("flip_evaluator", "FLIP")
    except RenderError:  # without the extra, tables and pages say that FLIP is missing
        return math.nan
    pair = [np.ascontiguousarray(np.clip(each, 0.0, 1e4), np.float32) for each in (right, picture)]
    found, _, _ = package.evaluate(*pair, "HDR", inputsRGB=False, applyMagma=False, computeMeanError=False)
    return float(np.asarray(found)[..., 0][used].mean())


def _visible(one: Array, other: Array, used: Mask) -> float:
    smooth = [uniform_filter(each, size=(3, 3, 0), mode="nearest") for each in (one, other)]
    off = np.linalg.norm(lab(smooth[0]) - lab(smooth[1]), axis=-1)
    return float((off[used] > JUST_NOTICEABLE).mean())


def score_thickness(thickness: Array, right: Array) -> ThicknessScore:
    """Errors of thickness (h, w) in metres; NaN marks what is not known, on either side."""
    known = np.isfinite(right)
    covered = known & (right > 0)
    marked = ~np.isfinite(thickness)
    found = np.where(marked, 0.0, thickness) > 0
    both = covered & found
    largest = max(float(right[covered].max()), 1e-12) if covered.any() else 1.0
    count = max(int(covered.sum()), 1)
    off = np.abs(thickness[both].astype(np.float64) - right[both]) / largest if both.any() else np.array([math.nan])
    median, p99, p999 = np.quantile(off, (0.5, 0.99, 0.999)).tolist()
    missed = float((known & ~marked & (found != covered)).sum()) / count
    return ThicknessScore(median, p99, p999, missed, float((covered & marked).sum()) / count)


# --- pictures that are wrong -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Suspect:
    """A mistake that people make, and how to undo it."""

    said: str
    undo: Callable[[Array], Array]
    within: tuple[float, float] = field(default=(-math.inf, math.inf))


def _zoomed(picture: Array, factor: float) -> Array:
    """The picture, enlarged about its center; what lies outside repeats the edge."""
    h, w = picture.shape[:2]
    center = np.array([(h - 1) / 2, (w - 1) / 2])
    planes = [
        affine_transform(picture[..., i], [1 / factor] * 2, center - center / factor, order=1, mode="nearest")
        for i in range(picture.shape[-1])
    ]
    return np.stack(planes, axis=-1)


def _moved(picture: Array, down: int, right: int) -> Array:
    return np.roll(picture, (down, right), axis=(0, 1))


def _best_shift(picture: Array, right: Array) -> tuple[int, int]:
    """Shift (down, right) in whole pixels of the best correlation with the truth."""
    one, two = (each.mean(axis=-1) - each.mean() for each in (picture, right))
    together = np.fft.ifft2(np.fft.fft2(two) * np.conj(np.fft.fft2(one))).real
    down, across = np.unravel_index(int(together.argmax()), together.shape)
    h, w = together.shape
    return int((down + h // 2) % h - h // 2), int((across + w // 2) % w - w // 2)


_SUSPECTS = (
    _Suspect("flipped upside down: row 0 is the top row", lambda p: p[::-1]),
    _Suspect("mirrored left to right", lambda p: p[:, ::-1]),
    _Suspect("rotated by 180 degrees", lambda p: p[::-1, ::-1]),
    _Suspect("red and blue are exchanged", lambda p: p[..., ::-1]),
    _Suspect(
        "sRGB-encoded, not linear: save radiance without a transfer function",
        lambda p: srgb_to_linear(np.clip(p, 0.0, 1e30)),
    ),
    _Suspect(
        "decoded from sRGB although the values were already linear", lambda p: linear_to_srgb(np.clip(p, 0.0, 1e30))
    ),
)


def suspicions(picture: Array, truth: TruthPicture) -> list[str]:
    """Most likely mistake in a picture: the one whose correction reduces the error most, and at least halves it.

    Errors are those of means over blocks, so that noise is not taken for a mistake: an encoding would reduce it.
    Undone are flips, exchanged channels, transfer functions, a wrong exposure, a shift and a zoom (a crop).
    """
    if nrmse(picture, truth.halves, truth.mask) < NEAR:
        return []
    if picture.max() <= 0.0:
        return ["black"]

    def off(one: Array) -> float:
        return block_error(one, truth.halves, truth.mask)

    before = off(picture)
    found = [(off(one.undo(picture)), one.said) for one in _SUSPECTS]
    used, right = truth.mask, truth.radiance
    product, square = float((picture[used] * right[used]).sum()), float((picture[used] ** 2).sum())
    if product > 0 and abs(math.log2(factor := product / square)) > STOPS:
        other = "brighter" if factor > 1 else "darker"
        stops = abs(math.log2(factor))
        said = f"the exposure may be wrong: with {stops:.2g} stops {other}, the error is half as large"
        found.append((off(factor * picture), said))
    down, across = _best_shift(picture, right)
    if math.hypot(down, across) > SHIFTED:
        said = f"shifted by {-across} pixels to the right and {-down} pixels down"
        found.append((off(_moved(picture, down, across)), said))
    for zoom in ZOOMS:
        how = "because the field of view is too large" if zoom > 1 else "because the field of view is too small"
        said = f"cropped, or another field of view: objects are {1 / zoom:.2g} times as large, {how}"
        found.append((off(_zoomed(picture, zoom)), said))
    after, said = min(found, key=lambda one: one[0])
    return [said] if after < SUSPICIOUS * before else []


def common_suspicions(scores: Sequence[Score]) -> list[str]:
    """Suspicions that hold for most scenes of a renderer, without the numbers that differ from scene to scene."""
    suspected = [said.split(":")[0] for score in scores for said in score.suspicions]
    wrong = sum(score.nrmse >= NEAR for score in scores)
    return sorted({said for said in suspected if suspected.count(said) > MOST * max(wrong, 1)})
