"""The user's own presets: read from a folder, what is wrong told with its line, and saved such that they come back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from translucent.media.preset import Preset, preset_text, read_presets
from translucent.media.presets import grouped, matching, preset_name, read_own_presets, save_own_preset

GOOD = '[mint]\nkind = "estimated"\nsource = "by eye"\ncolor = [0.4, 0.9, 0.7]\ndistance = "1cm"\nior = 1.4\n'
BAD = f'{GOOD}\n[tea]\nkind = "estimated"\nsource = "by eye"\ncolour = [0.8, 0.4, 0.1]\ndistance = "1cm"\nior = 1.33\n'


@pytest.fixture
def folder(tmp_path: Path, own_config: Path) -> Path:
    found = tmp_path / "translucent" / "presets"
    found.mkdir(parents=True)
    return found


def test_every_preset_comes_back_from_its_text() -> None:
    for name, one in tl.presets().items():
        again = read_presets(preset_text(one))[name]
        np.testing.assert_allclose(again.medium.extinction, one.medium.extinction, rtol=1e-15)
        assert again.medium.anisotropy == pytest.approx(one.medium.anisotropy, rel=1e-14)
        told = [(p.kind, p.group, p.source, p.note, p.aliases, p.roughness, p.reduced) for p in (again, one)]
        assert told[0] == told[1]


def test_a_medium_that_shines_is_kept() -> None:
    lava = Preset("lava", tl.Medium((1, 2, 3), emission=(5, 1, 0)), "estimated", 'a "hot" one \\ here')
    assert read_presets(preset_text(lava))["lava"].medium == lava.medium


def test_what_is_wrong_is_told_with_its_line_and_the_others_are_read(folder: Path) -> None:
    (folder / "a.toml").write_text(BAD)
    (folder / "b.toml").write_text("[x\n")
    (folder / "c.toml").write_text(GOOD.replace("mint", "basil"))
    (folder / "d.toml").write_text(GOOD)
    (folder / "e.toml").write_bytes(b"\xff\xfe\x00")
    (folder / "notes.txt").write_text("no preset")
    found, wrong = read_own_presets()
    assert sorted(found) == ["basil", "mint"]
    tea, broken, twice, binary = map(str, wrong)
    assert "a.toml', line 11, [tea]; unknown key 'colour'; did you mean 'color'?" in tea
    assert "b.toml" in broken
    assert "line 1" in broken
    assert "d.toml'; the preset [mint] is also defined in another file" in twice
    assert "not UTF-8" in binary
    assert read_own_presets(folder / "none") == ({}, [])


def test_own_presets_are_found_by_name_and_listed(folder: Path, run: Run) -> None:
    with pytest.raises(tl.InputError, match="no preset has this name"):
        tl.preset("Green mint")
    mint = read_presets(GOOD)["mint"]
    save_own_preset(Preset(preset_name("Green mint!"), mint.medium, "estimated", "by eye", group="own"))
    assert tl.preset("green mint").medium == mint.medium
    (folder / "bad.toml").write_text("[x\n")
    result = run("presets", "--group", "own")
    assert [line.split()[0] for line in result.out.splitlines()] == ["name", "green_mint"]
    assert "bad.toml" in result.err
    (folder / "bad.toml").write_text("[tea]\nior = 1\n")
    for name, words in (
        ("bad", "your own preset of this name cannot be read"),
        ("tea", "your own preset of this name cannot be read"),
        ("cup", "one of your own presets could not be read"),
    ):
        told = run("presets", "show", name).err
        assert words in told
        assert "bad.toml', line 1, [tea]; " in told
    assert run("presets", "--search", "red wine").out.splitlines()[1].startswith("red_wine ")
    assert run("presets", "--group", "paper").code == run("presets", "--search", "paper bag").code == 2


@pytest.mark.parametrize("words", ["", "  ", "3 eggs", "§"])
def test_a_name_begins_with_a_letter(words: str) -> None:
    with pytest.raises(tl.InputError, match="begin with a letter"):
        preset_name(words)


def test_every_preset_has_a_group_and_a_search_finds_it() -> None:
    groups = grouped(tl.presets())
    assert sorted(groups) == [
        "clouds and fog",
        "food",
        "glass and liquids",
        "milk and coffee",
        "skin",
        "stone and resin",
        "wax and soap",
    ]
    assert sum(map(len, groups.values())) == len(tl.presets())
    assert set(matching(tl.presets(), "Skin")) >= {"skin1", "skin2"}
    assert matching(tl.presets(), "measured estimated") == {}


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("wax", "wax"),
        ("glass", "clear_glass"),
        ("milk", "whole_milk"),
        ("whole milk", "whole_milk"),
        ("jade", "jade"),
    ],
)
def test_a_search_finds_names_before_groups(words: str, first: str) -> None:
    found = list(matching(tl.presets(), words))
    assert found[0] == first
    named = [words.split()[0] in " ".join([name, *tl.preset(name).aliases]) for name in found]
    assert named == sorted(named, reverse=True)


def test_a_value_is_told_once_with_the_line_of_its_key(folder: Path) -> None:
    (folder / "a.toml").write_text(
        '[tea]\nkind = "estimated"\nsource = "me"\ncolor = [0.5, 0.4, 0.3]\ndistance = 0.01\nior = 1.3\n'
    )
    (error,) = read_own_presets()[1]
    told = 'a.toml\', line 5, [tea]; distance = 0.01; give a length with its unit, for example "1cm"'
    assert str(error).endswith(told)
    assert str(error).count("a.toml") == 1
