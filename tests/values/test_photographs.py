"""Media from photographs: the truth lies within the error bars as often as they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.formulas.color import linear_to_srgb
from translucent.formulas.interface import slab_transmittance
from translucent.frames.photographs import Photograph, fit_photographs, parse_patches, read_photographs

SIGMA = np.array([300.0, 120.0, 40.0])
STEPS = np.array([1, 2, 3, 5, 8]) * 1e-3
SIDE, IOR, ROUNDS = 24, 1.5, 30
WHITE = (0, 0, SIDE, SIDE)
PATCHES = [((SIDE * (i + 1), 0, SIDE, SIDE), float(d)) for i, d in enumerate(STEPS)]


def photograph(
    rng: np.random.Generator | None,
    exposure: float = 0.8,
    noise: float = 0.02,
    thicknesses: np.ndarray = STEPS,
    sigma: np.ndarray = SIGMA,
) -> np.ndarray:
    """Linear picture of white and steps, between faces of ior 1.5: our slab, with shot noise."""
    depth = np.concatenate([[0.0], thicknesses])[:, None] * sigma
    passed = slab_transmittance(((IOR - 1) / (IOR + 1)) ** 2, depth)
    passed[0] = 1.0
    picture = exposure * np.repeat(np.repeat(passed[None], SIDE, axis=0), SIDE, axis=1)
    if rng is None:
        return picture
    return np.asarray(picture + noise * np.sqrt(picture) * rng.normal(size=picture.shape))


def encoded(picture: np.ndarray) -> np.ndarray:
    return np.round(255 * linear_to_srgb(np.clip(picture, 0.0, 1.0))).astype(np.uint8)


@pytest.mark.parametrize("ior", [None, IOR])
def test_a_picture_without_noise_gives_the_medium_back(ior: float | None) -> None:
    fit = fit_photographs([Photograph(photograph(None), WHITE, PATCHES)], ior)
    # A line cannot know of light that goes to and fro between the faces: R^2 = 0.0016 of the thinnest step.
    assert fit.medium.extinction == pytest.approx(SIGMA, rel=1e-6 if ior else 4e-3)
    assert fit.surface_loss == pytest.approx(2 * 0.04 / 1.04, abs=1e-12 if ior else 1e-3)


#: What simulated photographs suffer from, beside noise.
KINDS = ("noise", "8 bits", "JPEG", "two exposures, ior known", "thicknesses 0.03 mm off", "thicknesses 2 % off")


def drawn(kind: str, rng: np.random.Generator, folder: Path) -> tuple[list[Photograph], float | None]:
    """Random photographs of one type, and the index of refraction that is given."""
    exposures, ior, thicknesses = [0.8], None, STEPS
    if kind in ("8 bits", "JPEG"):
        exposures = [rng.uniform(0.4, 0.9)]
    if kind == "two exposures, ior known":
        exposures, ior = [0.2, 0.9], IOR
    if kind == "thicknesses 0.03 mm off":  # by a caliper, which the residuals alone tell; twice the same steps
        exposures, thicknesses = [0.4, 0.9], STEPS + 3e-5 * rng.normal(size=len(STEPS))
    if kind == "thicknesses 2 % off":
        thicknesses = STEPS * (1 + 0.02 * rng.normal(size=len(STEPS)))
    shots = []
    for exposure in exposures:
        noise = {"noise": 0.05, "8 bits": 0.001, "JPEG": 0.01}.get(kind, 0.03)
        picture: object = photograph(rng, exposure, noise, thicknesses)
        if kind == "8 bits":  # which round all alike, as noise is less than a level
            Image.fromarray(encoded(np.asarray(picture))).save(folder / "steps.png")
            picture = folder / "steps.png"
        if kind == "JPEG":
            Image.fromarray(encoded(np.asarray(picture))).save(folder / "steps.jpg", quality=92)
            picture = folder / "steps.jpg"
        shots.append(Photograph(picture, WHITE, PATCHES))  # type: ignore[arg-type]
    return shots, ior


def held(kind: str, rounds: int, seed: int, folder: Path) -> tuple[float, float]:
    """Share of intervals that hold the truth, and of those that are narrower than 10 % of it to either side."""
    rng, inside, narrow = np.random.default_rng(seed), [], []
    for _ in range(rounds):
        shots, ior = drawn(kind, rng, folder)
        fit = fit_photographs(shots, ior)
        # The bend by light between the faces is no error of a fit that leaves it out: 0.2 % at most here.
        inside.append(np.abs(fit.medium.extinction - SIGMA) <= fit.interval + (0 if ior else 2e-3 * SIGMA))
        narrow.append(fit.interval < 0.1 * SIGMA)
    return float(np.mean(inside)), float(np.mean(narrow))


@pytest.mark.parametrize("kind", KINDS[:5])
def test_the_truth_is_within_the_error_bars_in_95_of_100(kind: str, tmp_path: Path) -> None:
    inside, narrow = held(kind, ROUNDS, 7, tmp_path)
    # Three standard deviations of a share of 95 %; errors of a thickness are those of all three channels.
    counted = ROUNDS if kind.startswith("thick") else 3 * ROUNDS
    assert inside > 0.95 - 3 * (0.95 * 0.05 / counted) ** 0.5
    assert narrow > 0.9


def test_dark_and_saturated_patches_are_told_and_left_out() -> None:
    rng = np.random.default_rng(1)
    picture = photograph(rng, 0.99, sigma=10 * SIGMA)
    fit = fit_photographs([Photograph(picture, WHITE, PATCHES)])
    assert fit.samples[0] < fit.samples[2] == 5
    assert any("red" in line and line.endswith("left out, too dark") for line in fit.warnings)
    assert fit.medium.extinction[1:] == pytest.approx(10 * SIGMA[1:], rel=0.1)


def test_dust_counts_for_nothing_and_light_that_falls_off_is_no_noise() -> None:
    clean = photograph(np.random.default_rng(2))
    falling = clean * np.linspace(1.0, 0.9, SIDE)[:, None, None]
    dusty = falling.copy()
    dusty[::7, ::9] = 0.01
    one, other = (fit_photographs([Photograph(picture, WHITE, PATCHES)]) for picture in (clean, dusty))
    assert other.medium.extinction == pytest.approx(one.medium.extinction, abs=one.interval.max())
    assert other.interval == pytest.approx(one.interval, rel=1.0)


def test_what_is_no_line_and_photographs_that_differ_are_told() -> None:
    picture = photograph(np.random.default_rng(3))
    flare = Photograph(picture + 0.05, WHITE, PATCHES)
    assert "red falls off less than exponentially, as with multiple scattering" in fit_photographs([flare]).warnings[0]
    darker = Photograph(picture - 0.1, WHITE, PATCHES[:3])
    assert any("more than exponentially" in line for line in fit_photographs([darker]).warnings)
    curved = Photograph(picture**1.2, WHITE, PATCHES)
    told = fit_photographs([Photograph(picture, WHITE, PATCHES), curved]).warnings
    assert "red differs by 18 % between photograph 1 and photograph 2, perhaps by the tone curve" in told[0]
    for count, words in ((1, "with one thickness, reflection"), (2, "two thicknesses")):
        few = fit_photographs([Photograph(picture, WHITE, PATCHES[:count])])
        assert len(few.warnings) == 1
        assert words in few.warnings[0]


@pytest.mark.parametrize("ior", [None, IOR])
def test_steps_that_are_named_in_reverse_are_told(ior: float | None) -> None:
    reverse = [(where, float(d)) for (where, _), d in zip(PATCHES, STEPS[::-1], strict=True)]
    with pytest.raises(
        tl.InputError, match=r"all channels are brighter where the plate is thicker.*list the thicknesses from left"
    ):
        fit_photographs([Photograph(photograph(np.random.default_rng(3)), WHITE, reverse)], ior)


def test_steps_in_reverse_are_told_where_a_channel_is_clear() -> None:
    """Red, of noise alone, neither brightens nor darkens; named the right way round, green and blue are found."""
    clear = photograph(np.random.default_rng(3), sigma=np.array([0.0, *SIGMA[1:]]))
    reverse = [(where, float(d)) for (where, _), d in zip(PATCHES, STEPS[::-1], strict=True)]
    with pytest.raises(
        tl.InputError, match=r"green and blue are brighter where the plate is thicker.*no channel is darker"
    ):
        fit_photographs([Photograph(clear, WHITE, reverse)])


def test_patches_are_steps_or_a_wedge() -> None:
    assert parse_patches("1,2,30,4=2mm") == [((1, 2, 30, 4), 0.002)]
    assert parse_patches("0,5,300,20=1mm,2,4mm", "cm") == [
        ((20, 5, 60, 20), 0.001),
        ((120, 5, 60, 20), 0.02),
        ((220, 5, 60, 20), 0.004),
    ]
    assert parse_patches("5,0,20,100=1mm,2mm")[1] == ((5, 60, 20, 30), 0.002)
    wedge = parse_patches("0,0,160,9=1mm..9mm")
    assert wedge[0] == ((0, 0, 10, 9), pytest.approx(1.25e-3))
    assert wedge[-1] == ((150, 0, 10, 9), pytest.approx(8.75e-3))


def test_a_toml_file_names_photographs(tmp_path: Path) -> None:
    Image.fromarray(encoded(photograph(np.random.default_rng(4)))).save(tmp_path / "steps.jpg", quality=95)
    where = f"{SIDE},0,{5 * SIDE},{SIDE}=1mm,2mm,3mm,5mm,8mm"
    text = f'white = "2,2,20,20"\n[[photograph]]\nfile = "steps.jpg"\npatches = ["{where}"]\n'
    (tmp_path / "steps.toml").write_text(text)
    fit = fit_photographs(read_photographs(tmp_path / "steps.toml"), IOR)
    assert (np.abs(fit.medium.extinction - SIGMA) < 1.5 * fit.interval + 0.005 * SIGMA).all()
    assert fit.medium.ior == IOR
    for wrong, message in (
        (text.replace("white", "whit"), "number 1; 'whit' is not known"),
        (text.replace("patches", "#"), "'patches' is missing"),
        (text.replace('"2,2,20,20"', "2"), "a value is not a text"),
        (text.replace("=1mm", "=0mm"), "the length must be positive"),
        ("[[", r"the file is not valid TOML \("),
        ("white = 1", r"no table \[\[photograph\]\]"),
    ):
        (tmp_path / "steps.toml").write_text(wrong)
        with pytest.raises(tl.InputError, match=message):
            read_photographs(tmp_path / "steps.toml")


@pytest.mark.parametrize(
    ("white", "patches", "exposure", "message"),
    [
        (WHITE, [((0, 9, SIDE, SIDE), 0.001)], 0.8, "the rectangle lies outside the picture of 144 x 24 pixels"),
        (WHITE, [((-1, 0, SIDE, SIDE), 0.001)], 0.8, "the rectangle lies outside the picture of"),
        (WHITE, [((0, 0, 3, 9), 0.001)], 0.8, "3 x 9 pixels; use a rectangle of at least 4 x 4 pixels"),
        (PATCHES[1][0], PATCHES, 0.8, "patch 24,0,24,24 of steps.png; red .* is brighter than white"),
        (
            WHITE,
            PATCHES,
            1.1,
            "white of steps.png; 100 % of the pixels of the white rectangle are saturated; use a shorter exposure",
        ),
        (WHITE, PATCHES, 0.0, "white of steps.png; the white rectangle is black"),
        (WHITE, [(PATCHES[0][0], 0.0)], 0.8, r"the thickness is 0\.0 m; give a length above 0"),
        (WHITE, [], 0.8, "no patches"),
        (WHITE, PATCHES[4:], 0.005, "fit of red; every patch is too dark or saturated"),
    ],
)
def test_bad_input_is_told(tmp_path: Path, white: object, patches: object, exposure: float, message: str) -> None:
    Image.fromarray(encoded(photograph(None, exposure))).save(tmp_path / "steps.png")
    with pytest.raises(tl.InputError, match=message):
        fit_photographs([Photograph(tmp_path / "steps.png", white, patches)])  # type: ignore[arg-type]
    with pytest.raises(tl.InputError, match="no photograph is given"):
        fit_photographs([])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3,4", "no thickness"),
        ("1,2,3=2mm", "not four whole numbers"),
        ("1,-2,3,4=2mm", "the rectangle lies outside the picture"),
        ("1,2,0,4=2mm", "the rectangle lies outside the picture"),
        (f"1,2,{10**30},4=2mm,3mm", "the rectangle lies outside the picture"),
        ("1,2,3,4=2mm,", "length ''; the text is not a number"),
    ],
)
def test_a_patch_that_is_none_is_told(text: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        parse_patches(text)
