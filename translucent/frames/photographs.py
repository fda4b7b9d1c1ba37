"""Photographs of steps or wedges of known thickness before white light, and the medium that fits them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import read_text, shown, toml_value
from translucent.formulas.color import linear_to_srgb, srgb_to_linear
from translucent.media.colors import read_encoded
from translucent.media.conversion import CHANNELS
from translucent.media.fitting import PatchTransmittances, StepFit, fit_steps
from translucent.scene.environment_files import read_linear
from translucent.units import metres_per_unit, parse_length

#: Suffixes of linear pictures.
LINEAR = (".exr", ".hdr", ".pic")

#: Suffixes of pictures that are rounded by blocks.
LOSSY = (".jpg", ".jpeg", ".webp")


class LinearPicture(NamedTuple):
    """Photograph in linear values, with the size of its rounding errors.

    Attributes
    ----------
    linear : (h, w, 3)
    levels : int
        Largest level of the file, such as 255; 0 for a linear file.
    blocks : bool
        The file rounds whole blocks of pixels, as JPEG does, so that noise does not average the error out.
    """

    linear: Array
    levels: int
    blocks: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """Linear values at which a pixel may be black, and saturated: the last level but one, as JPEG rounds twice."""
        if not self.levels:
            return 0.0, math.inf
        low, high = srgb_to_linear(np.array([1.0, self.levels - 1.0]) / self.levels)
        return float(low), float(high)


def read_picture(path: str | Path) -> LinearPicture:
    """Read a picture, turned as its camera notes: .exr and .hdr are linear, all others sRGB-encoded.

    Raises
    ------
    InputError
        If there is no such file, or it is no picture.
    """
    if Path(path).suffix.lower() in LINEAR:
        return LinearPicture(read_linear(Path(path)), 0)
    encoded = read_encoded(path, f"picture {str(path)!r}")
    levels = int(np.iinfo(encoded.dtype).max)
    table = srgb_to_linear(np.arange(levels + 1) / levels).astype(np.float32)
    return LinearPicture(table[encoded], levels, Path(path).suffix.lower() in LOSSY)


#: Column and row of the top left pixel, width and height.
Rectangle = tuple[int, int, int, int]

#: Tiles along a side of a patch, from whose scatter its error is known, noise that neighbors share included.
TILES = 4

#: Fraction of a patch's pixels that may be at a limit of what the picture holds, and largest relative error of its
#: mean.
MOST_LIMITED, MOST_ERROR = 0.01, 0.1

#: Strips that a wedge is cut into, and the part of a step that counts: its edges are where steps touch.
STRIPS, INNER = 16, 0.6

#: Standard deviations, from the median of the deviations, beyond which a pixel is dust or a scratch.
_OUTLIER = 5.0

#: Pixels along the side of the largest picture.
MOST_PIXELS = 1 << 20


@checked
@dataclass(frozen=True)
class Photograph:
    """Photograph of patches of known thickness, lit from behind, and of the light beside them.

    Parameters
    ----------
    picture : str, Path or array_like (h, w, 3)
        8 bits, or PNG of 16 bits, sRGB-encoded; ``.exr`` or ``.hdr``, linear; or linear values.
    white : (x, y, width, height)
        Where the light is seen with nothing before it, in pixels from the top left.
    patches : sequence of (rectangle, thickness)
        Thickness in metres, > 0.
    """

    picture: str | Path | Array
    white: Rectangle
    patches: Sequence[tuple[Rectangle, float]]


class _Mean(NamedTuple):
    """Mean (3,) of a patch, its variance, and the fractions of pixels that are black and saturated."""

    mean: Array
    variance: Array
    black: Array
    saturated: Array


@checked
def fit_photographs(photographs: Sequence[Photograph], ior: float | None = None) -> StepFit:
    """Fit a medium to photographs of patches of known thickness, each against its own white.

    Parameters
    ----------
    photographs : sequence of Photograph
        One or more, each with an exposure of its own.
    ior : float, optional
        Index of refraction of the plates, if it is known. Default: the loss at their faces is fitted.

    Returns
    -------
    StepFit
        Its warnings name patches that are left out.

    Raises
    ------
    InputError
        If a picture cannot be read, a patch is outside of it or brighter than white, or white is saturated.
    """
    photographs = tuple(photographs)
    if not (photographs and all(isinstance(one, Photograph) for one in photographs)):
        raise InputError("fit to photographs", "no photograph is given", "give at least one tl.Photograph")
    left_out: list[str] = []
    fit = fit_steps([_steps(one, number, left_out) for number, one in enumerate(photographs)], ior)
    return dataclasses.replace(fit, warnings=(*left_out, *fit.warnings))


def parse_patches(text: str, unit: str = "m") -> list[tuple[Rectangle, float]]:
    """Patches of ``X,Y,W,H=2mm``, of equal steps in a row, ``X,Y,W,H=1mm,2mm,4mm``, or of a wedge, ``...=1mm..8mm``.

    Steps and wedges go along the longer side of the rectangle, from the left or the top.

    Raises
    ------
    InputError
        If it is none of these.
    """
    where, equals, lengths = text.partition("=")
    if not (equals and lengths.strip()):
        raise InputError(
            f"patch {text!r}",
            "the patch has no thickness",
            "write X,Y,W,H=2mm, or X,Y,W,H=1mm,2mm,4mm for steps of equal width",
        )
    x, y, width, height = whole = parse_rectangle(where)
    first, dots, last = lengths.partition("..")
    if dots:
        ends = parse_length(first, unit), parse_length(last, unit)
        steps = [float(s) for s in np.interp(np.arange(STRIPS) + 0.5, (0.0, STRIPS), ends)]
    else:
        steps = [parse_length(one, unit) for one in lengths.split(",")]
    if len(steps) == 1:
        return [(whole, steps[0])]
    along = width >= height
    edges = np.linspace(0.0, max(width, height), len(steps) + 1)
    margin = 0.0 if dots else 0.5 * (1.0 - INNER) * edges[1]
    found: list[tuple[Rectangle, float]] = []
    for step, near, far in zip(steps, edges[:-1] + margin, edges[1:] - margin, strict=True):
        a, b = round(float(near)), round(float(far))
        found.append(((x + a, y, b - a, height) if along else (x, y + a, width, b - a), step))
    return found


def parse_rectangle(text: str) -> Rectangle:
    """Rectangle of ``X,Y,W,H``; raises `InputError` if it is none."""
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"rectangle {text!r}", "the rectangle is not four whole numbers", "write X,Y,W,H in pixels"
        ) from None
    if min(x, y) < 0 or min(width, height) < 1 or max(x, y, width, height) > MOST_PIXELS:
        raise InputError(
            f"rectangle {text!r}",
            "the rectangle lies outside the picture",
            "give X,Y,W,H in pixels, counted from the top left corner",
        )
    return x, y, width, height


def read_photographs(path: Path, unit: str = "m") -> list[Photograph]:
    """Read a .toml file of photographs: tables ``[[photograph]]`` with ``file``, ``white`` and ``patches``.

    ``white = "X,Y,W,H"`` and ``patches = ["X,Y,W,H=1mm", ...]``, as `parse_patches` reads them, may stand above all
    tables, for tables without their own. Files are searched beside the .toml file.

    Raises
    ------
    InputError
        If it is no such file; the message says which photograph is wrong.
    """
    what_for = f"photographs {str(path)!r}"
    metres_per_unit(unit)
    try:
        shared = toml_value(read_text(path, what_for))
    except ValueError as error:
        raise InputError(
            what_for,
            f"the file is not valid TOML ({shown(error)})",
            "the documentation page on photographs shows an example",
        ) from None
    tables = shared.pop("photograph", None)
    if not (isinstance(tables, list) and tables and all(isinstance(table, dict) for table in tables)):
        raise InputError(
            what_for, "the file has no table [[photograph]]", 'write [[photograph]] and file = "steps.jpg" below it'
        )
    return [
        _photograph({**shared, **table}, f"{what_for}, number {n}", path, unit) for n, table in enumerate(tables, 1)
    ]


def _photograph(table: dict[str, Any], what_for: str, path: Path, unit: str) -> Photograph:
    wrong = sorted(table.keys() ^ {"file", "white", "patches"})
    if wrong:
        found = "is missing" if wrong[0] in ("file", "white", "patches") else "is not known"
        raise InputError(what_for, f"{wrong[0]!r} {found}", "each photograph needs the keys 'file', 'white', 'patches'")
    file, white, patches = table["file"], table["white"], table["patches"]
    texts = [file, white, *patches] if isinstance(patches, list) else [None]
    if not all(isinstance(text, str) for text in texts):
        raise InputError(
            what_for, "a value is not a text", 'write for example white = "10,10,60,60", patches = ["90,10,60,60=2mm"]'
        )
    listed = [patch for text in patches for patch in parse_patches(text, unit)]
    return Photograph(path.parent / file, parse_rectangle(white), listed)


def _steps(photograph: Photograph, number: int, left_out: list[str]) -> PatchTransmittances:
    """Transmittances of the patches of a photograph; `left_out` lists unusable patches."""
    given = photograph.picture
    if isinstance(given, str | Path):
        picture, name = read_picture(given), Path(given).name
    else:
        picture, name = LinearPicture(np.asarray(given, dtype=np.float64), 0), f"photograph {number + 1}"
    white = _measured(picture, photograph.white, f"white of {name}")
    if (white.saturated > MOST_LIMITED).any():
        percent = 100 * white.saturated.max()
        raise InputError(
            f"white of {name}",
            f"{percent:.0f} % of the pixels of the white rectangle are saturated",
            "use a shorter exposure",
        )
    if (white.black > MOST_LIMITED).any():
        raise InputError(
            f"white of {name}", "the white rectangle is black", "choose a rectangle in which nothing covers the light"
        )
    if not photograph.patches:
        raise InputError(name, "the photograph has no patches", "give at least one patch, with its thickness")
    rows = []
    for rectangle, thickness in photograph.patches:
        if not 0 < thickness < np.inf:
            raise InputError(f"patch of {name}", f"the thickness is {thickness} m", "give a length above 0")
        what = f"patch {','.join(map(str, rectangle))} of {name}"
        rows.append(_depth(_measured(picture, rectangle, what), white, what, left_out))
    depth, variance = (np.array(part) for part in zip(*rows, strict=True))
    thicknesses = np.array([float(thickness) for _, thickness in photograph.patches])
    return PatchTransmittances(name, thicknesses, depth, variance, white.variance / white.mean**2)


def _depth(patch: _Mean, white: _Mean, what: str, left_out: list[str]) -> tuple[Array, Array]:
    """-log(T) (3,) and its variance; NaN where a channel cannot be used."""
    bright = patch.mean > white.mean + 5.0 * np.sqrt(patch.variance + white.variance) + 0.02 * white.mean
    if (bright & (patch.saturated <= MOST_LIMITED)).any():
        channel = int(np.flatnonzero(bright)[0])
        found = f"{CHANNELS[channel]} {patch.mean[channel]:.3g} is brighter than white, {white.mean[channel]:.3g}"
        raise InputError(
            what, found, "choose a white rectangle beside the patches, where the bare backlight is visible"
        )
    noisy = patch.variance > (MOST_ERROR * patch.mean) ** 2
    for limited, why in (
        (patch.saturated > MOST_LIMITED, "saturated"),
        ((patch.black > MOST_LIMITED) | noisy, "too dark"),
    ):
        if limited.any():
            names = ", ".join(name for name, out in zip(CHANNELS, limited, strict=True) if out)
            left_out.append(f"{what}: {names} left out, {why}")
    out = (patch.saturated > MOST_LIMITED) | (patch.black > MOST_LIMITED) | noisy | (patch.mean <= 0)
    mean = np.where(out, 1.0, patch.mean)
    return np.where(out, np.nan, np.log(white.mean / mean)), patch.variance / mean**2


def _measured(picture: LinearPicture, rectangle: Rectangle, what: str) -> _Mean:
    x, y, width, height = rectangle
    high, wide = picture.linear.shape[:2]
    if min(x, y) < 0 or x + width > wide or y + height > high:
        raise InputError(
            what,
            f"the rectangle lies outside the picture of {wide} x {high} pixels",
            "give X,Y,W,H in pixels, counted from the top left corner",
        )
    if min(width, height) < TILES:
        raise InputError(
            what,
            f"the rectangle has only {width} x {height} pixels",
            f"use a rectangle of at least {TILES} x {TILES} pixels",
        )
    pixels = np.asarray(picture.linear[y : y + height, x : x + width], dtype=np.float64)
    if not np.isfinite(pixels).all():
        raise InputError(what, "a pixel of the rectangle is not a finite number", "choose another rectangle")
    low, high_limit = picture.limits
    black, saturated = (pixels <= low).mean(axis=(0, 1)), (pixels >= high_limit).mean(axis=(0, 1))
    median = np.median(pixels, axis=(0, 1))
    step = _step(median, picture.levels)
    deviation = np.maximum(1.4826 * np.median(np.abs(pixels - median), axis=(0, 1)), step)
    kept = (np.abs(pixels - median) <= _OUTLIER * deviation) | (deviation == 0)
    tiles, level = _tiles(pixels, kept)
    # Rounding to levels is wrong by the same everywhere, unless noise spreads it over several: without, two at most are
    # met, and their variance is at most a quarter of a level squared.
    spread = np.where(kept, (pixels - level) ** 2, 0.0).mean(axis=(0, 1))
    rounding = np.where(picture.blocks | (spread < 0.3 * step**2), step**2 / 12.0, 0.0)
    return _Mean(level, tiles + rounding, black, saturated)


def _tiles(pixels: Array, kept: Array) -> tuple[Array, Array]:
    """Variance of a patch's mean by the scatter of its tiles about a plane, as light may fall off; and that mean."""
    height, width = pixels.shape[:2]
    rows, columns = (np.arange(TILES) * size // TILES for size in (height, width))

    def sums(values: Array) -> Array:
        return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1).reshape(-1, 3)

    means = sums(np.where(kept, pixels, 0.0)) / np.maximum(sums(kept.astype(np.float64)), 1.0)
    down, across = np.stack(np.divmod(np.arange(TILES**2), TILES)) - 0.5 * (TILES - 1)
    plane = np.stack([np.ones(TILES**2), down, across], axis=-1)
    fitted = np.linalg.lstsq(plane, means, rcond=None)[0]
    scatter = ((means - plane @ fitted) ** 2).sum(axis=0) / (len(plane) - 3)
    return scatter / len(plane), fitted[0]


def _step(linear: Array, levels: int) -> Array:
    """Difference (3,) of neighboring levels of an sRGB-encoded picture about a linear value; 0 of linear pictures."""
    if not levels:
        return np.zeros(3)
    encoded = np.clip(linear_to_srgb(np.clip(linear, 0.0, 1.0)), 0.5 / levels, 1.0 - 0.5 / levels)
    return np.asarray(srgb_to_linear(encoded + 0.5 / levels) - srgb_to_linear(encoded - 0.5 / levels))
