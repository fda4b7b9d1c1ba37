"""``translucent extinction``: one color, tables, fits, and what is refused, each in one line."""

from __future__ import annotations

import csv
import json
import math
import sys
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from translucent.cli import main
from translucent.commands.extinction import TARGETS

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # the command line sets its own

    def _run(*arguments: object) -> tuple[int, str, str]:
        code = main(["extinction", *(str(argument) for argument in arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return _run


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_words_name_each_length_apart(run: Run) -> None:
    code, out, err = run("linear(0.25,0.5,1)", "2", "--unit", "cm", "--unit-out", "mm")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert "0.069315   0.034657          0 1/mm" in lines[2]
    assert [float(v) for v in lines[4].split()[1:4]] == pytest.approx([0.01, 0.02, math.inf])
    assert lines[4].startswith("half-value ")
    assert "light has the color at 0.02 m, 1/e (37 %) at a mean free path, half at a half-value" in lines[5]
    assert lines[-1].startswith("warning         blue is 1 (saturated)")
    assert "\x1b" not in out


@pytest.mark.parametrize("no_color", ["", "1"])
def test_swatches_are_for_terminals_that_want_them(run: Run, monkeypatch: pytest.MonkeyPatch, no_color: str) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", no_color)
    _, out, _ = run("#808080", "1cm")
    assert ("\x1b[48;2;128;128;128m" in out) == (not no_color)


def test_json_has_all_numbers(run: Run) -> None:
    code, out, err = run("#800000", "1cm", "--clamp", "--unit-out", "cm", "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["color"][1:] == [1e-4, 1e-4]
    assert told["extinction_per_unit"][1] == pytest.approx(-math.log(1e-4), rel=1e-14)
    assert told["half_value_thickness"][1] == pytest.approx(told["mean_free_path"][1] * math.log(2), rel=1e-14)
    assert told["warnings"][0] == "color clamped to 0.0001 where it was below"


def test_for_an_engine_only_the_block_is_printed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def text_block(target: str, medium: Any, color: np.ndarray, distance: float) -> str:
        assert medium.transmittance(distance) == pytest.approx(color, rel=1e-14)
        return f"block for {target}"

    module = types.ModuleType("translucent.materials")
    module.text_block = text_block  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "translucent.materials", module)
    code, out, err = run("linear(0.25,0.5,1)", "2cm", "--as", "unreal")
    assert (code, out) == (0, "block for unreal\n")
    assert err.startswith("warning: blue is 1 (saturated)")


@pytest.mark.parametrize("target", TARGETS)
def test_every_engine_has_a_block(run: Run, target: str) -> None:
    code, out, err = run("#7b1e3a", "1cm", "--as", target)
    assert (code, err) == (0, "")
    assert len(out) > 20


TABLE = """name,color,distance,unit
wine,#7b1e3a,1cm,
red,red,1,cm
jade,"linear(.18,.62,.35)",20,mm
mist,gray,far,m
"""


def test_a_bad_row_does_not_stop_the_others(run: Run, here: Path) -> None:
    (here / "in.csv").write_text(TABLE)
    code, out, err = run("--batch", "in.csv", "-o", "out.json")
    assert (code, out) == (1, "")
    lines = err.splitlines()
    assert lines[0].startswith("error: in.csv line 3: color (1.0, 0.0, 0.0); green = 0 is not in 0 < t <= 1")
    assert lines[1].startswith("error: in.csv line 5: length 'far'; not a number with a unit")
    assert lines[2:] == ["error: 2 of 4 rows failed; the others are in out.json"]
    told = json.loads((here / "out.json").read_text())
    assert [record["name"] for record in told] == ["wine", "jade"]
    assert told[1]["extinction"] == pytest.approx(-np.log([0.18, 0.62, 0.35]) / 0.02, rel=1e-14)
    assert sorted(path.name for path in here.iterdir()) == ["in.csv", "out.json"]


def test_a_table_to_csv_with_clamping(run: Run, here: Path) -> None:
    (here / "in.json").write_text('[{"name": "red", "color": [1, 0, 0], "distance": 1}]')
    assert run("--batch", "in.json", "-o", "out.csv", "--clamp", "--unit", "cm")[0] == 0
    with (here / "out.csv").open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["mean_free_path_r"], row["extinction_r"]) == ("inf", "0.0")
    assert float(row["extinction_g"]) == pytest.approx(-math.log(1e-4) / 0.01, rel=1e-14)
    assert row["warnings"].startswith("color clamped to 0.0001 where it was below | red is 1")


def test_without_an_output_the_table_goes_to_stdout(run: Run, here: Path) -> None:
    (here / "in.csv").write_text("name,color,distance\na,gray,1cm\n")
    code, out, err = run("--batch", "in.csv")
    assert (code, err) == (0, "")
    assert json.loads(out)[0]["name"] == "a"


def test_a_wedge_is_fitted(run: Run, here: Path) -> None:
    (here / "wedge.csv").write_text("distance,r,g,b\n1,0.5,0.9,0.99\n2,0.25,0.81,0.98\n")
    told = json.loads(run("--fit", "wedge.csv", "--unit", "cm", "--json")[1])
    assert told["extinction"][:2] == pytest.approx([math.log(2) / 0.01, -math.log(0.9) / 0.01], rel=1e-13)
    assert told["samples"] == 2
    assert len(told["standard_error"]) == 3
    code, out, err = run("--fit", "wedge.csv", "--unit", "cm")
    assert (code, err) == (0, "")
    assert "standard error" in out
    assert "residuals of 2 samples" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--batch", "none.csv"], "table 'none.csv'; cannot be read (No such file or directory)"),
        (["--batch", "."], "table '.'; cannot be read"),
        (["--batch", "empty.csv"], "table 'empty.csv'; no column 'name': it is empty"),
        (["--batch", "head.csv"], "table 'head.csv'; no rows; give at least one"),
        (["--batch", "few.csv"], "no column 'distance': its first line says name, color"),
        (["--batch", "bytes.csv"], "not UTF-8 text"),
        (["--batch", "bad.json"], "table 'bad.json'; no JSON"),
        (["--batch", "dict.json"], "not a list of objects"),
        (["--batch", "good.csv", "-o", "out.txt"], "output 'out.txt'; suffix '.txt'; use .json or .csv"),
        (["--batch", "good.csv", "-o", "no/out.csv"], "no folder 'no'; make the folder first"),
        (["--batch", "good.csv", "--unit", "furlong"], "unit 'furlong'; not a known unit"),
        (["--batch", "good.csv", "--as", "css"], "--as css; it takes one color, not --batch"),
        (["--batch", "good.csv", "--fit", "good.csv"], "--fit with --batch; each asks for something else"),
        (["gray", "1cm", "--batch", "good.csv"], "COLOR with --batch"),
        (["gray", "1cm", "-o", "x.json"], "-o x.json; only --batch writes a file"),
        (["gray", "1cm", "--json", "--as", "css"], "--as with --json"),
        (["gray", "1cm", "--as", "word"], "'word' is not one of"),
        (["gray", "1cm", "--unit-out", "furlong"], "unit 'furlong'; not a known unit"),
        (["none.png@1,2", "1cm"], "pixel 1,2 of 'none.png'; No such file or directory"),
        (["linear(-.1,1,1)", "1cm", "--clamp"], "red = -0.1 is not in 0 < t <= 1"),
        (["--fit", "few.csv"], "no column 'distance'"),
        (["--fit", "good.csv", "--clamp"], "--clamp; a sample made up would bend --fit"),
        ([], "Missing argument 'COLOR'"),
        (["gray"], "Missing argument 'DISTANCE'"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_bad_input_is_one_line_and_exit_code_2(run: Run, here: Path, arguments: list[str], message: str) -> None:
    (here / "empty.csv").write_text("")
    (here / "head.csv").write_text("name,color,distance\n\n")
    (here / "few.csv").write_text("name,color\na,gray\n")
    (here / "good.csv").write_text("name,color,distance\na,gray,1cm\n")
    (here / "bytes.csv").write_bytes(b"name,color,distance\n\xff\xfe,gray,1\n")
    (here / "bad.json").write_text("[{")
    (here / "dict.json").write_text('{"name": 1}')
    before = sorted(here.iterdir())
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("error: ")
    assert message in err
    assert sorted(here.iterdir()) == before
