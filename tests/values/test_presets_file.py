"""The format of the file of presets: what an entry may say, and how one that is wrong is named."""

from __future__ import annotations

import re

import numpy as np
import pytest

import translucent as tl
from translucent.media.preset import read_presets

ENTRY = """
[ink]
aliases = ["dye"]
kind = "measured"
source = "a paper"
unit = "mm"
absorption = [1, 2.0, 3.0]
scattering = [0.5, 0.0, 0.5]
anisotropy = [0.8, 0.0, 0.4]
ior = 1.33
note = "stains"
"""
COLOR_ENTRY = '[glass]\nkind = "estimated"\nsource = "by eye"\ncolor = [0.5, 0.6, 0.7]\ndistance = "2cm"\nior = 1.5\n'
STONE_ENTRY = f'{COLOR_ENTRY}unit = "cm"\nreduced_scattering = [0.4, 0.5, 0.6]\nroughness = 0.25\n'


def test_an_entry_is_read() -> None:
    ink = read_presets(ENTRY)["ink"]
    assert ink.absorption == pytest.approx((1e3, 2e3, 3e3), rel=1e-15)
    assert ink.scattering == pytest.approx((500, 0, 500), rel=1e-15)
    assert ink.medium.anisotropy == pytest.approx(0.6, rel=1e-15)
    assert ink.medium.ior == 1.33
    assert (ink.note, ink.aliases, ink.channel_anisotropy) == ("stains", ("dye",), (0.8, 0.0, 0.4))
    glass = read_presets(COLOR_ENTRY)["glass"]
    assert glass.medium == tl.Medium.from_color((0.5, 0.6, 0.7), 0.02, ior=1.5)
    assert (glass.note, glass.aliases, glass.reduced, glass.roughness) == ("", (), False, 0.0)


def test_a_color_is_that_of_absorption_alone() -> None:
    stone = read_presets(STONE_ENTRY)["glass"]
    assert stone.absorption == pytest.approx(-np.log((0.5, 0.6, 0.7)) / 0.02, rel=1e-15)
    assert stone.scattering == pytest.approx((40, 50, 60), rel=1e-15)
    assert stone.reduced_scattering.tolist() == stone.scattering.tolist()
    assert (stone.reduced, stone.medium.anisotropy, stone.medium.ior) == (True, 0.0, 1.5)
    assert stone.roughness == stone.summary()["roughness"] == 0.25


@pytest.mark.parametrize("roughness", ["0", "1", "0.5"])
def test_every_entry_may_have_a_roughness(roughness: str) -> None:
    assert read_presets(f"{ENTRY}roughness = {roughness}")["ink"].roughness == float(roughness)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("absorption", "absorbtion", "media.toml, [ink]; unknown key 'absorbtion'; did you mean 'absorption'?"),
        ("note", "zzz", "media.toml, [ink]; unknown key 'zzz'; use one of absorption, aliases, "),
        ('kind = "measured"\n', "", "media.toml, [ink]; the preset has no key 'kind'; add this key"),
        ('unit = "mm"\n', "", "media.toml, [ink]; the preset has no key 'unit'; add this key"),
        ("scattering = [0.5, 0.0, 0.5]\n", "", "media.toml, [ink]; the preset has no key 'scattering'; add this key"),
        (
            "scattering =",
            "reduced_scattering =",
            "[ink]; the keys 'anisotropy' and 'reduced_scattering' exclude each other; use one or the other",
        ),
        ('kind = "measured"', 'kind = "guessed"', '[ink]; kind = \'guessed\'; give "measured" or "estimated"'),
        ('"a paper"', '""', "media.toml, [ink]; source = ''; give a text"),
        ('"a paper"', "2001", "media.toml, [ink]; source = 2001; give a text"),
        ('"stains"', "true", "media.toml, [ink]; note = True; give a text"),
        ('["dye"]', '"dye"', "media.toml, [ink]; aliases = 'dye'; give a list of names"),
        ('["dye"]', '["ink"]', "media.toml, [ink]; the alias 'ink' is already the name of a preset; choose another"),
        ('["dye"]', '["a", "a"]', "media.toml, [ink]; the alias 'a' is already the name of a preset"),
        ("[1, 2.0, 3.0]", "[1, 2.0]", "[ink]; absorption = [1, 2.0]; give three numbers [r, g, b]"),
        ("[1, 2.0, 3.0]", '[1, 2.0, "3"]', "[ink]; absorption = [1, 2.0, '3']; give a number"),
        ("[1, 2.0, 3.0]", "[1, 2.0, true]", "[ink]; absorption = [1, 2.0, True]; give a number"),
        ("[1, 2.0, 3.0]", "1.0", "[ink]; absorption = 1.0; give three numbers"),
        (
            "[1, 2.0, 3.0]",
            "[1, -2, 3]",
            "media.toml, [ink]; medium absorption (1000.0, -2000.0, 3000.0); a value is negative or not finite",
        ),
        (
            "[1, 2.0, 3.0]",
            "[1, nan, 3]",
            "media.toml, [ink]; medium absorption (1000.0, nan, 3000.0); a value is negative or not finite",
        ),
        ("0.8, 0.0", "1.0, 0.0", "[ink]; anisotropy = [1.0, 0.0, 0.4]; give between -1 and 1"),
        ('"mm"', '"furlong"', "media.toml, [ink]; unit 'furlong'; no unit of length has this name"),
        ("1.33", "0.9", "media.toml, [ink]; medium ior 0.9; the index of refraction must lie in 1 to 100"),
        ("1.33", '"1.33"', "media.toml, [ink]; ior = '1.33'; give a number"),
        ("[ink]", "[Ink]", "media.toml, [Ink]; the name is not in lower_snake_case"),
        ("[ink]", "ink = 3\n[other]", "media.toml, [ink]; the value is not a table"),
        ("[ink]", "[ink", "media.toml; the file is not valid TOML: "),
    ],
)
def test_an_entry_that_is_wrong_is_named(old: str, new: str, message: str) -> None:
    assert old in ENTRY
    with pytest.raises(tl.InputError, match=re.escape(message)) as caught:
        read_presets(ENTRY.replace(old, new, 1), "media.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('distance = "2cm"\n', "", "presets.toml, [glass]; the preset has no key 'distance'; add this key"),
        ("color = [0.5, 0.6, 0.7]\n", "", "presets.toml, [glass]; the preset has no key 'color'; add this key"),
        (
            '"2cm"',
            '"2cm"\nabsorption = [1.0, 1.0, 1.0]',
            "[glass]; the keys 'absorption' and 'color' exclude each other; use one or the other",
        ),
        ("0.5, 0.6", "0.0, 0.6", "presets.toml, [glass]; color (0.0, 0.6, 0.7); red = 0 is not in 0 < t <= 1"),
        ('"2cm"', '"2 parsec"', "presets.toml, [glass]; unit 'parsec'; no unit of length has this name"),
        ('unit = "cm"\n', "", "presets.toml, [glass]; the preset has no key 'unit'; add this key"),
        ('"cm"', '"furlong"', "presets.toml, [glass]; unit 'furlong'; no unit of length has this name"),
        (
            "reduced_scattering = [0.4, 0.5, 0.6]\n",
            "",
            "[glass]; the key 'unit' cannot be combined with 'color'; omit 'unit': the text of 'distance' contains",
        ),
        (
            "reduced_scattering",
            "scattering",
            "[glass]; the key 'scattering' cannot be combined with 'color'; give 'reduced_scattering', sigma_s (1 -",
        ),
        (
            "roughness = 0.25",
            "anisotropy = [0, 0, 0]",
            "[glass]; the key 'anisotropy' cannot be combined with 'color'; give 'reduced_scat",
        ),
        ("[0.4, 0.5, 0.6]", "[0.4, 0.5]", "[glass]; reduced_scattering = [0.4, 0.5]; give three numbers [r, g, b]"),
        (
            "[0.4, 0.5, 0.6]",
            "[0.4, -1, 0.6]",
            "presets.toml, [glass]; medium scattering (40.0, -100.0, 60.0); a value is negative or not finite",
        ),
        (
            "[0.4, 0.5, 0.6]",
            "[0.4, inf, 0.6]",
            "presets.toml, [glass]; medium scattering (40.0, inf, 60.0); a value is negative or not finite",
        ),
        ("0.25", "1.25", "presets.toml, [glass]; roughness = 1.25; give 0 (polished) to 1"),
        ("0.25", "-0.1", "presets.toml, [glass]; roughness = -0.1; give 0 (polished) to 1"),
        ("0.25", "nan", "presets.toml, [glass]; roughness = nan; give 0 (polished) to 1"),
        ("0.25", '"dull"', "presets.toml, [glass]; roughness = 'dull'; give a number"),
        ("roughness", "rougness", "presets.toml, [glass]; unknown key 'rougness'; did you mean 'roughness'?"),
    ],
)
def test_an_entry_with_a_color_that_is_wrong_is_named(old: str, new: str, message: str) -> None:
    assert old in STONE_ENTRY
    with pytest.raises(tl.InputError, match=re.escape(message)):
        read_presets(STONE_ENTRY.replace(old, new, 1))


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)])
def test_coefficients_are_per_unit(unit: str, metres: float) -> None:
    ink = read_presets(ENTRY.replace('unit = "mm"', f'unit = "{unit}"'))["ink"]
    assert ink.absorption == pytest.approx(np.array([1, 2, 3]) / metres, rel=1e-15)
