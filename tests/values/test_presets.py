"""Named media: against the published table, complete, refused where wrong, and honest about scattering."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.formulas.color import to_hex
from translucent.formulas.diffuse_interface import diffuse_interface, half_space_reflectance
from translucent.formulas.phase import HenyeyGreenstein
from translucent.geometry.solids import Sphere
from translucent.media.preset import PAPERS, Preset

NAMES = sorted(tl.presets())
MEASURED = [name for name in NAMES if tl.preset(name).kind == "measured"]
ESTIMATED = [name for name in NAMES if tl.preset(name).kind == "estimated"]
DROPLETS = {"cloud": (0.4, 2e-5), "fog": (0.05, 1e-5)}  # g/m^3 of water, and metres

#: Names that were there from the start: other people's files use them.
FIRST = [
    *("marble", "skim_milk", "skin1", "ketchup", "merlot", "chardonnay", "beer", "apple_juice", "shampoo"),
    *("jade", "amber", "honey", "gummy", "bottle_glass", "soap", "crystal"),
]

#: Linear colors and distances in m of the absorption of estimated media, which are not to change.
COLORS = {
    "jade": ((0.18, 0.62, 0.35), 0.02),
    "amber": ((0.90, 0.42, 0.05), 0.02),
    "honey": ((0.80, 0.40, 0.04), 0.02),
    "gummy": ((0.75, 0.05, 0.04), 0.01),
    "bottle_glass": ((0.25, 0.55, 0.22), 0.01),
    "soap": ((0.97, 0.94, 0.87), 0.02),
    "crystal": ((0.93, 0.96, 0.95), 0.01),
    "clear_glass": ((0.977, 0.982, 0.971), 0.1),
    "lead_crystal": ((0.986, 0.987, 0.983), 0.1),
    "wax": ((0.97, 0.92, 0.76), 0.01),
    "sea_water": ((0.22, 0.74, 0.89), 5.0),
    "whisky": ((0.80, 0.45, 0.12), 0.03),
    "red_wine": ((0.50, 0.012, 0.03), 0.02),
    "rose_wine": ((0.90, 0.48, 0.36), 0.04),
    "white_wine": ((0.92, 0.82, 0.42), 0.06),
    "frosted_glass": ((0.977, 0.982, 0.971), 0.1),
    "ice": ((0.86, 0.95, 0.985), 0.1),
    "paraffin": ((0.965, 0.925, 0.84), 0.01),
    "resin": ((0.95, 0.90, 0.74), 0.03),
    "beeswax": ((0.95, 0.78, 0.25), 0.01),
}

#: Reduced scattering per mm of those that scatter, and the roughness of their surfaces.
SCATTERING = {
    "jade": ((0.20, 0.25, 0.22), 0.15),
    "wax": ((0.5, 0.5, 0.5), 0.35),
    "soap": ((0.6, 0.6, 0.6), 0.4),
    "paraffin": ((1.2, 1.2, 1.2), 0.35),
    "beeswax": ((0.5, 0.5, 0.5), 0.4),
}

#: Roughness of clear ones whose surfaces are not polished.
ROUGH = {"frosted_glass": 0.35}


@pytest.fixture(scope="module")
def table(assets: Path) -> list[dict[str, str]]:
    with (assets / "measured_media.csv").open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def triple(row: dict[str, str], column: str) -> list[float]:
    return [float(row[f"{column}_{channel}"]) for channel in "rgb"]


# Against the published table


def test_the_table_and_the_measured_presets_are_the_same_media(table: list[dict[str, str]]) -> None:
    assert len(table) == 47
    assert sorted(tl.preset(row["name"]).name for row in table) == MEASURED


def test_every_row_of_the_table_is_what_the_preset_says(table: list[dict[str, str]]) -> None:
    for row in table:
        found, unreduced = tl.preset(row["name"]), bool(row["sigma_s_r"])
        assert row["units"] == "mm^-1"
        assert found.absorption == pytest.approx(1e3 * np.array(triple(row, "sigma_a")), rel=1e-14, abs=0), row["name"]
        scattering = triple(row, "sigma_s" if unreduced else "sigma_s_prime")
        assert found.scattering == pytest.approx(1e3 * np.array(scattering), rel=1e-14, abs=0), row["name"]
        assert found.channel_anisotropy == (tuple(triple(row, "g")) if unreduced else (0, 0, 0)), row["name"]
        assert found.medium.ior == float(row["eta"])
        assert found.reduced == (not unreduced)
        assert PAPERS[found.source] == row["primary_paper"]


def test_reduced_scattering_agrees_with_the_table_within_its_printed_digits(table: list[dict[str, str]]) -> None:
    for row in table:
        found = tl.preset(row["name"])
        published = 1e3 * np.array(triple(row, "sigma_s_prime"))
        if found.reduced:
            assert found.reduced_scattering == pytest.approx(published, rel=1e-14, abs=0)
            continue
        # sigma_s has five s per mm, g three.
        rounding = 5e-3 * (1 - np.array(found.channel_anisotropy)) + 5e-4 * found.scattering
        assert (np.abs(found.reduced_scattering - published) <= 1.001 * rounding + 1e-4 * published).all(), row["name"]


def test_rows_on_which_the_sources_disagree_are_marked(table: list[dict[str, str]]) -> None:
    doubtful = {tl.preset(row["name"]).name for row in table if " vs " in row["crosscheck"]}
    assert doubtful == {"chicken1", "chicken2"}
    for name in MEASURED:
        assert ("unconfirmed" in tl.preset(name).note) == (name in doubtful)


@pytest.mark.parametrize("name", [name for name in MEASURED if "powder" in name or "coffee" in name] + ["espresso"])
def test_powders_and_coffee_say_that_their_concentration_is_not_that_of_the_drink(name: str) -> None:
    assert "concentrat" in tl.preset(name).note


# Units


def test_a_millimetre_of_ketchup() -> None:
    ketchup = tl.preset("ketchup")
    absorbing = tl.Medium(absorption=ketchup.absorption)
    assert absorbing.transmittance(1e-3)[2] == pytest.approx(0.2346, abs=5e-5)
    # Absorption 1.45 and scattering 0.03 per mm in blue: both are lost to a ray.
    assert ketchup.medium.transmittance(1e-3)[2] == pytest.approx(math.exp(-1.48), rel=1e-14)


def test_a_centimetre_of_merlot() -> None:
    assert tl.preset("merlot").medium.transmittance(1e-2) == pytest.approx((0.31, 0.08, 0.05), abs=5e-3)


def test_a_centimetre_of_chardonnay() -> None:
    # 2 % of the events in blue scatter: 0.79 is left by absorption alone.
    absorbing = tl.Medium(absorption=tl.preset("chardonnay").absorption)
    assert absorbing.transmittance(1e-2) == pytest.approx((0.90, 0.89, 0.79), abs=5e-3)


def test_estimated_presets_have_their_colors_at_their_distances() -> None:
    assert sorted([*COLORS, *DROPLETS, "skin", "carved_marble", "gummy_bear"]) == sorted(ESTIMATED)
    for name, (color, distance) in COLORS.items():
        found = tl.preset(name)
        assert np.exp(-found.absorption * distance) == pytest.approx(color, rel=4e-15), name
        scattering, roughness = SCATTERING.get(name, ((0, 0, 0), ROUGH.get(name, 0)))
        assert found.scattering == pytest.approx(1e3 * np.array(scattering), rel=1e-15), name
        assert (found.roughness, found.medium.anisotropy) == (roughness, 0), name
        assert found.reduced == found.medium.scatters == (name in SCATTERING), name


def test_skin_scatters_as_the_measured_one_and_has_the_color_of_light_skin() -> None:
    found, measured = tl.preset("skin"), tl.preset("skin2")
    np.testing.assert_array_equal(found.scattering, measured.scattering)
    assert (found.medium.ior, found.roughness) == (1.4, 0.45)
    body = tl.Object(Sphere((0, 0, 0), 0.1).tessellate(8), material="skin")
    assert body.surface is not None
    assert body.surface.color_texture is not None
    blotches = body.surface.color_texture.pixels.reshape(-1, 3)
    # sRGB (194, 150, 130) of the color chart of McCamy, Marcus and Davidson 1976
    np.testing.assert_allclose(found.diffuse_reflectance * blotches.mean(axis=0), (0.539, 0.305, 0.223), rtol=0.02)
    assert 0.04 < (blotches.std(axis=0) / blotches.mean(axis=0))[1] < 0.1


def test_recipes_of_marble_and_gummy_are_these_with_another_surface_and_with_haze() -> None:
    carved, marble, bear, clear = map(tl.preset, ("carved_marble", "marble", "gummy_bear", "gummy"))
    np.testing.assert_array_equal(carved.absorption, marble.absorption)
    np.testing.assert_array_equal(carved.scattering, marble.scattering)
    np.testing.assert_allclose(bear.absorption, clear.absorption, rtol=1e-5)
    assert (carved.roughness, bear.medium.anisotropy, clear.medium.scatters) == (0.3, 0.8, False)
    assert (marble.pattern, carved.pattern, tl.preset("ice").pattern) == ("veins", "", "bubbles")
    assert bear.regime == "single scattering"


@pytest.mark.parametrize("name", DROPLETS)
def test_clouds_and_fog_are_droplets_of_water(name: str) -> None:
    """They take twice the light that falls on them: twice their projected area in each cubic metre."""
    (grams, diameter), found = DROPLETS[name], tl.preset(name)
    number = 1e-6 * grams / (math.pi / 6 * diameter**3)
    assert found.scattering == pytest.approx(2 * number * math.pi / 4 * diameter**2, rel=1e-12)
    assert found.medium.phase == tl.WaterDroplets(diameter)
    assert found.channel_anisotropy == (found.medium.anisotropy,) * 3


def test_a_solid_that_scatters_is_translucent_over_millimetres() -> None:
    """Light forgets where it came from within 0.5 to 4 mm, so that bodies of centimetres are no clear glass."""
    for name in SCATTERING:
        assert (tl.preset(name).mean_free_path > 5e-4).all()
        assert (tl.preset(name).mean_free_path < 4e-3).all()


# The look of a thick slab


def test_a_thick_slab_that_absorbs_nothing_gives_back_what_enters() -> None:
    """All but Fresnel's 6 % of diffuse light at an index of 1.3; exact, whatever the scattering."""
    spectralon = tl.preset("spectralon")
    assert spectralon.diffuse_reflectance == pytest.approx(np.full(3, diffuse_interface(1.3).entering), abs=1e-8)
    assert diffuse_interface(1.3).entering == pytest.approx(0.939, abs=5e-4)


def test_a_thick_slab_that_scatters_ahead_gives_back_less() -> None:
    """Than by its reduced albedo, unless little is absorbed."""
    through_air = half_space_reflectance(100 / 101, 1.0)
    assert medium(1, 100).diffuse_reflectance == pytest.approx(np.full(3, through_air), rel=1e-6)
    exact = half_space_reflectance(1000 / 1001, 1.0, HenyeyGreenstein(0.9))
    assert medium(1, 1000, 0.9).diffuse_reflectance == pytest.approx(np.full(3, exact), rel=1e-6)
    assert exact == pytest.approx(through_air, rel=1e-3)
    assert medium(1, 1, 0.9).diffuse_reflectance[0] < 0.95 * half_space_reflectance(0.1 / 1.1, 1.0)


@pytest.mark.parametrize("name", ["gummy", "amber", "honey", "sea_water"])
def test_what_does_not_scatter_gives_nothing_back(name: str) -> None:
    found = tl.preset(name)
    assert not found.diffuse_reflectance.any()
    assert found.diffuse_color() == ""
    assert found.summary()["diffuse_color"] is None


def test_what_stone_wax_and_soap_look_like() -> None:
    red, green, blue = tl.preset("jade").diffuse_reflectance
    assert green > 1.5 * blue > 2 * red
    assert 0.15 < green < 0.3
    for name in ("wax", "soap"):
        red, green, blue = tl.preset(name).diffuse_reflectance
        assert 0.9 > red > green > blue > 0.2
    assert tl.preset("wax").diffuse_color() == to_hex(tl.preset("wax").diffuse_reflectance)
    assert tl.preset("wax").summary()["diffuse_reflectance"] == tl.preset("wax").diffuse_reflectance.tolist()


# Complete


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_complete(name: str) -> None:
    found = tl.preset(name)
    assert found.name == name
    assert re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name)
    assert (
        found.source in PAPERS
        if found.kind == "measured"
        else found.source.startswith(("by eye", "by theory", "by data sheet"))
    )
    assert (found.medium.extinction > 0).all()
    assert found.medium.extinction.shape == found.reduced_scattering.shape == (3,)
    assert 1 < found.medium.ior < 2 or name in DROPLETS
    assert 0 <= found.medium.anisotropy < 1


@pytest.mark.parametrize("name", NAMES)
def test_one_anisotropy_keeps_the_sum_of_reduced_scattering(name: str) -> None:
    found = tl.preset(name)
    kept = (found.scattering * (1 - found.medium.anisotropy)).sum()
    assert kept == pytest.approx(found.reduced_scattering.sum(), rel=1e-12, abs=1e-12)


def test_an_anisotropy_of_channels_that_do_not_scatter_does_not_count() -> None:
    # Red alone scatters in the published table; green and blue have g = 0 for want of a measurement.
    assert tl.preset("merlot").medium.anisotropy == pytest.approx(0.974, rel=1e-14)


# Names


@pytest.mark.parametrize("name", FIRST)
def test_the_first_names_keep_working(name: str) -> None:
    assert tl.preset(name).name == name


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("Skim Milk", "skim_milk"),
        ("skim-milk", "skim_milk"),
        ("SKIM_MILK", "skim_milk"),
        ("Skimmilk", "skim_milk"),
        ("budweiser", "beer"),
        ("Head & Shoulders Shampoo", "head_shoulders_shampoo"),
        ("whiskey", "whisky"),
        (" jade ", "jade"),
        ("Wine", "red_wine"),
        ("milk", "whole_milk"),
        ("glass", "clear_glass"),
        ("seawater", "sea_water"),
    ],
)
def test_a_name_can_be_written_so(written: str, name: str) -> None:
    assert tl.preset(written) is tl.preset(name)


def test_aliases_are_not_listed_as_media_of_their_own() -> None:
    assert "budweiser" in tl.presets()["beer"].aliases
    assert "budweiser" not in tl.presets()


def test_the_list_is_the_callers_own() -> None:
    tl.presets().clear()
    assert len(tl.presets()) == len(NAMES)


@pytest.mark.parametrize("name", ["unobtainium", "", "&"])
def test_an_unknown_name_without_a_like_gives_some(name: str) -> None:
    message = f"preset {name!r}; no preset has this name; use one of marble, skim_milk, merlot, honey, jade and 67 more"
    with pytest.raises(tl.InputError, match=re.escape(message)):
        tl.preset(name)


@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("honney", "honey?"),
        ("Merlo", "merlot?"),
        ("budwiser", "budweiser or budweiser_beer?"),
        ("merlot wine", "merlot or rose_wine?"),
        ("coffee", "mint_mocha_coffee?"),
    ],
)
def test_an_unknown_name_gives_what_it_may_mean(name: str, guess: str) -> None:
    with pytest.raises(
        tl.InputError, match=re.escape(f"preset {name!r}; no preset has this name; did you mean {guess}")
    ):
        tl.preset(name)


# Regimes


@pytest.mark.parametrize(
    ("name", "regime"),
    [
        ("marble", "scattering dominated"),
        ("skim_milk", "scattering dominated"),
        ("whole_milk", "scattering dominated"),
        ("regular_milk", "scattering dominated"),
        ("skin1", "scattering dominated"),
        ("spectralon", "scattering dominated"),
        ("ketchup", "scattering dominated"),  # red scatters three times as often as it is absorbed
        ("espresso", "single scattering"),  # absorbed before it scatters often
        ("gatorade", "single scattering"),
        ("clorox", "single scattering"),
        ("merlot", "absorbing"),
        ("beer", "absorbing"),
        ("apple_juice", "absorbing"),  # a sixth of the events scatters, but once in 40 cm
        ("jade", "scattering dominated"),
        ("wax", "scattering dominated"),
        ("soap", "scattering dominated"),
        ("gummy", "absorbing"),
        ("crystal", "absorbing"),
    ],
)
def test_a_regime(name: str, regime: str) -> None:
    found = tl.preset(name)
    assert found.regime == regime
    assert bool(found.warning) == (regime == "scattering dominated")


def medium(absorption: float, scattering: float, g: float = 0.0) -> Preset:
    """A medium of these coefficients per metre."""
    return Preset("x", tl.Medium(absorption, scattering, anisotropy=g), "estimated", "", channel_anisotropy=(g, g, g))


@pytest.mark.parametrize(
    ("absorption", "scattering", "g", "regime"),
    [
        (100, 100, 0, "scattering dominated"),  # as much scattering as absorption, twice within 1 cm
        (101, 100, 0, "single scattering"),
        (50, 50, 0, "scattering dominated"),  # one event in 1 cm
        (49, 50, 0, "single scattering"),
        (0, 100, 0, "scattering dominated"),
        (0, 99, 0, "single scattering"),
        (100, 1001, 0.9, "scattering dominated"),  # forward scattering counts by its reduced share
        (100, 999, 0.9, "single scattering"),
        (90.1, 10, 0, "absorbing"),  # less than a tenth of the events
        (90, 10, 0, "single scattering"),
        (0, 4.99, 0, "absorbing"),  # less than a twentieth of the light in 1 cm
        (0, 5, 0, "single scattering"),
        (0, 0, 0, "absorbing"),
    ],
)
def test_the_limits_of_the_regimes(absorption: float, scattering: float, g: float, regime: str) -> None:
    assert medium(absorption, scattering, g).regime == regime


@pytest.mark.parametrize(
    ("scattering", "regime"),
    [((0, 0, 0), "absorbing"), ((0, 0, 20), "single scattering"), ((200, 0, 0), "scattering dominated")],
)
def test_the_channel_that_scatters_most_decides(scattering: tuple[float, float, float], regime: str) -> None:
    assert Preset("x", tl.Medium(100, scattering), "estimated", "").regime == regime


def test_marble_spreads_light_by_millimetres() -> None:
    marble = tl.preset("marble")
    assert 1e3 * marble.diffusion_length == pytest.approx((8.5, 5.6, 4.0), abs=0.05)
    assert marble.diffusion_length[0] == pytest.approx(1e-3 / math.sqrt(3 * 0.0021 * (0.0021 + 2.19)), rel=1e-14)
    assert "absorption along the view ray alone does not show the look" in marble.warning
    assert "1/sigma_tr: 8.51 mm, 5.57 mm, 3.95 mm" in marble.warning
    assert 1e3 * tl.preset("skin1").diffusion_length == pytest.approx((3.7, 1.4, 0.7), abs=0.05)


def test_the_diffusion_length_goes_by_reduced_scattering() -> None:
    # 1000 at g = 0.9 spreads light as 100 does at g = 0.
    assert medium(1, 1000, 0.9).diffusion_length == pytest.approx(medium(1, 100).diffusion_length, rel=1e-14)


def test_without_absorption_light_spreads_without_end() -> None:
    spectralon = tl.preset("spectralon")
    assert spectralon.diffusion_length.tolist() == [math.inf] * 3
    assert spectralon.albedo.tolist() == [1.0] * 3
    assert "no end" in spectralon.warning


def test_a_medium_of_nothing_has_no_events() -> None:
    nothing = medium(0, 0)
    assert nothing.albedo.tolist() == nothing.reduced_albedo.tolist() == [0.0] * 3
    assert nothing.mean_free_path.tolist() == [math.inf] * 3
    assert nothing.summary()["mean_free_path"] == [None] * 3
    assert set(nothing.colors().values()) == {"#ffffff"}


def test_colors_after_distances() -> None:
    merlot = tl.preset("merlot")
    assert merlot.colors()["1 cm"] == to_hex(np.exp([-1.1713, -2.5191, -2.9434]))
    marble = tl.preset("marble")
    assert marble.colors()["1 cm"] == "#000000"
    assert marble.absorption_colors()["1 cm"] == to_hex(np.exp([-0.021, -0.041, -0.071]))


def test_a_notebook_shows_swatches() -> None:
    shown = tl.preset("merlot")._repr_html_()
    assert "merlot (measured)" in shown
    assert shown.count("background:#") == 5 + 6  # light that passes; slabs on a white and on a black card
