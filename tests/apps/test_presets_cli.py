"""``translucent presets``: the table, one medium in full, JSON, swatches on terminals only, unknown names."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run, one_error_line, strict_json

ESCAPE = "\x1b["


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "presets")


@pytest.fixture
def pretend_a_terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """To be called by the test itself, with variables: the captured output of a fixture's time is another one."""

    def _pretend(**variables: str) -> None:
        monkeypatch.delenv("NO_COLOR", raising=False)
        for name, value in {"TERM": "xterm-256color", **variables}.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)

    return _pretend


def rows(text: str) -> dict[str, str]:
    """Lines of ``show``, by label."""
    return dict(re.split(r" +", line, maxsplit=1) for line in text.splitlines())


# The table


def test_the_table_has_every_medium(run: Run) -> None:
    result = run()
    head, *lines = result.out.splitlines()
    assert (result.code, result.err) == (0, "")
    assert head.split() == ["name", "kind", "regime", *["1", "mm", "1", "cm", "10", "cm"], "thick", "source"]
    assert [line.split()[0] for line in lines] == list(tl.presets())
    for line, one in zip(lines, tl.presets().values(), strict=True):
        cells = re.split(r" {2,}", line)
        assert cells == [one.name, one.kind, one.regime, *one.colors().values(), one.diffuse_color() or "-", one.source]
    assert ESCAPE not in result.out


def test_the_columns_line_up(run: Run) -> None:
    head, *lines = run().out.splitlines()
    for column, pattern in (
        ("kind", "measured|estimated"),
        ("1 mm", "#"),
        ("thick", "#|-"),
        ("source", "Jensen|Narasimhan|by eye|by theory|by data sheet"),
    ):
        at = head.index(column)
        assert all(re.match(pattern, line[at:]) for line in lines), column


def test_the_table_as_json(run: Run) -> None:
    result = run("--json")
    listed = strict_json(result.out)["presets"]
    assert [entry["name"] for entry in listed] == list(tl.presets())
    keys = ("name", "kind", "group", "regime", "colors", "diffuse_color", "source")
    assert {tuple(entry) for entry in listed} == {keys}
    merlot = next(entry for entry in listed if entry["name"] == "merlot")
    assert merlot["regime"] == "absorbing"
    assert merlot["colors"] == tl.preset("merlot").colors()
    thick = {entry["name"]: entry["diffuse_color"] for entry in listed}
    assert (thick["marble"], thick["gummy"]) == (tl.preset("marble").diffuse_color(), None)


# One medium


def test_a_measured_medium_in_full(run: Run) -> None:
    result = run("show", "coke")
    found = rows(result.out)
    assert (result.code, result.err) == (0, "")
    assert (found["name"], found["kind"], found["regime"]) == ("coke", "measured", "absorbing")
    assert found["source"].endswith("Acquiring Scattering Properties of Participating Media by Dilution, SIGGRAPH 2006")
    assert " ".join(found["absorption"].split()) == "0.10014 0.16503 0.2468 1/mm 100.14 165.03 246.8 1/m"
    assert " ".join(found["scattering"].split()) == "0.00254 0.00299 0 1/mm 2.54 2.99 0 1/m"
    assert found["anisotropy"].split()[:3] == ["0.965", "0.972", "0"]
    assert found["ior"].strip() == "1.33"
    assert "warning" not in found
    assert re.search(r"mean free path +9\.739 +5\.9517 +4\.0519 mm", result.out)
    assert re.search(r"after 1 cm +#a17852 +\(absorption alone #a37952\)", result.out)
    assert ESCAPE not in result.out


def test_a_medium_that_scatters_warns(run: Run) -> None:
    out = run("show", "marble").out
    assert re.search(r"^warning +scattering dominates.* 8\.51 mm, 5\.57 mm, 3\.95 mm \(red, green, blue\)$", out, re.M)
    assert re.search(r"^scattering\* +2\.19 +2\.62 +3 1/mm", out, re.M)
    assert "* reduced, sigma_s (1 - g)" in out
    slab = tl.preset("marble").diffuse_color()
    assert re.search(rf"^thick slab +{slab} +\(scattered back in white light; no mirror image\)$", out, re.M)


def test_an_estimated_medium_shows_what_there_is(run: Run) -> None:
    out = run("show", "gummy").out
    assert re.search(r"^source +by eye$", out, re.M)
    assert all(text not in out for text in ("note", "scattering ", "absorption alone", "roughness", "thick slab"))


def test_an_estimated_medium_that_scatters_has_a_surface(run: Run) -> None:
    out = run("show", "jade").out
    assert re.search(r"^source +by eye, polished", out, re.M)
    assert re.search(r"^scattering\* +0\.2 +0\.25 +0\.22 1/mm", out, re.M)
    assert re.search(r"^roughness +0\.15$", out, re.M)
    assert strict_json(run("show", "jade", "--json").out)["roughness"] == 0.15


def test_aliases_are_shown(run: Run) -> None:
    assert rows(run("show", "Budweiser").out)["name"] == "beer, budweiser, budweiser_beer"


@pytest.mark.parametrize("name", list(tl.presets()))
def test_every_medium_can_be_shown(run: Run, name: str) -> None:
    result = run("show", name)
    assert (result.code, result.err) == (0, "")
    assert "nan" not in result.out
    found = strict_json(run("show", name, "--json").out)
    one = tl.preset(name)
    assert (found["name"], found["regime"], found["warning"]) == (name, one.regime, one.warning)
    assert found["extinction"] == one.medium.extinction.tolist()
    assert np.add(found["absorption"], found["scattering"]).tolist() == found["extinction"]
    assert found["colors"] == one.colors()
    assert found["diffuse_color"] == (one.diffuse_color() or None)
    assert (found["diffuse_color"] is None) == (not one.medium.scatters)


def test_json_has_no_infinities(run: Run) -> None:
    assert strict_json(run("show", "spectralon", "--json").out)["diffusion_length"] == [None] * 3


def test_json_may_be_asked_for_before_the_verb(run: Run) -> None:
    assert run("--json", "show", "merlot").out == run("show", "merlot", "--json").out


# Swatches


def test_slabs_on_white_and_black_are_told(run: Run) -> None:
    out, told = run("show", "whole_milk").out, strict_json(run("show", "whole_milk", "--json").out)
    assert told["slab_colors"] == tl.preset("whole_milk").slab_colors()
    for card, row in told["slab_colors"].items():
        words = "  ".join(f"{color} {thickness}" for thickness, color in row.items())
        assert re.search(rf"^on {card} +{re.escape(words)}", out, re.MULTILINE)


def test_a_terminal_shows_swatches(run: Run, pretend_a_terminal: Callable[..., None]) -> None:
    pretend_a_terminal()
    assert re.search(r"after 1 cm +\x1b\[48;2;161;120;82m  \x1b\[0m #a17852", run("show", "coke").out)
    head, *lines = run().out.splitlines()
    for line, one in zip(lines, tl.presets().values(), strict=True):
        assert line.count("#") == (4 if one.medium.scatters else 3)
        assert line.count(f"{ESCAPE}48;2;") == line.count("#") + 6  # slabs on white and black have no room for words
    plain = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in lines]
    source = "Jensen|Narasimhan|by eye|by theory|by data sheet"
    assert all(re.match(source, line[head.index("source") :]) for line in plain)


@pytest.mark.parametrize(("variable", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_a_terminal_without_colors_shows_none(
    run: Run, pretend_a_terminal: Callable[..., None], variable: str, value: str
) -> None:
    pretend_a_terminal()
    assert ESCAPE in run("show", "coke").out
    pretend_a_terminal(**{variable: value})
    assert ESCAPE not in run("show", "coke").out + run().out


def test_an_empty_no_color_asks_for_nothing(run: Run, pretend_a_terminal: Callable[..., None]) -> None:
    pretend_a_terminal(NO_COLOR="")
    assert ESCAPE in run("show", "coke").out


def test_json_has_no_swatches(run: Run, pretend_a_terminal: Callable[..., None]) -> None:
    pretend_a_terminal()
    assert ESCAPE not in run("--json").out + run("show", "coke", "--json").out


# Refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "honney"], "error: preset 'honney'; no preset has this name; did you mean honey? 'translucent"),
        (["--search", "["], "error: --search '['; the search text has no letters or digits; give words, such as wine"),
        (["show", "unobtainium"], "error: preset 'unobtainium'; no preset has this name; use one of marble"),
        (["show"], "error: Missing argument 'NAME'"),
        (["shw", "merlot"], "error: No such command 'shw'"),
        (
            ["wine"],
            "error: No such command 'wine'; 'translucent presets show red_wine' prints red_wine, 'translucent presets "
            "--search wine' lists red_wine, ",
        ),
        (["--jsn"], "error: No such option"),
    ],
)
def test_what_cannot_be_shown_is_one_line(run: Run, arguments: list[str], message: str) -> None:
    assert one_error_line(run(*arguments)).startswith(message)


@pytest.mark.parametrize("arguments", [["--help"], ["show", "--help"]])
def test_help_has_an_example(run: Run, arguments: list[str]) -> None:
    result = run(*arguments)
    assert result.code == 0
    assert "Example: translucent presets" in result.out
    assert "--json" in result.out
