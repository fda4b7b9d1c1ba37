"""``translucent extinction``: one color, tables, fits, and what is refused, each in one line."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.assets import mesh_path
from translucent.commands.extinction import SIZE
from translucent.formulas.color import linear_to_srgb
from translucent.materials import TARGETS
from translucent.media.colors import parse_color
from translucent.media.presets import MOST_SHOWN, convert_table


@pytest.fixture
def run(run: Run) -> Run:
    return partial(run, "extinction")


@pytest.fixture
def here(tmp_path: Path, in_tmp_path: Path) -> Path:
    return tmp_path


def test_the_words_name_each_length_apart(run: Run) -> None:
    code, out, err = run("linear(0.25,0.5,1)", "2", "--unit", "cm", "--unit-out", "mm")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert "0.069315   0.034657          0 1/mm" in lines[2]
    assert [float(v) for v in lines[4].split()[1:4]] == pytest.approx([0.01, 0.02, math.inf])
    assert lines[4].startswith("half-value ")
    assert "light has this color after 0.02 m; a mean free path leaves 37 %, a half-value half" in lines[5]
    assert lines[-1].startswith("warning         blue is 1, so the medium absorbs nothing of it")
    assert "\x1b" not in out


@pytest.mark.parametrize("no_color", ["", "1"])
def test_swatches_are_for_terminals_that_want_them(run: Run, monkeypatch: pytest.MonkeyPatch, no_color: str) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", no_color)
    _, out, _ = run("#808080", "1cm")
    assert ("\x1b[48;2;128;128;128m" in out) == (not no_color)


def test_json_has_all_numbers(run: Run) -> None:
    code, out, err = run("#800000", "1cm", "--unit-out", "cm", "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["color"][1:] == [1e-4, 1e-4]
    assert told["extinction_per_unit"][1] == pytest.approx(-math.log(1e-4), rel=1e-14)
    assert told["half_value_thickness"][1] == pytest.approx(told["mean_free_path"][1] * math.log(2), rel=1e-14)
    assert told["warnings"][0] == "channels of the color below 0.0001 were set to 0.0001"


@pytest.mark.parametrize("color", ["teal", "#ff0000", "#000", "000000", "linear(0,.5,1)"])
def test_a_channel_of_0_is_clamped_and_told_unless_that_is_refused(run: Run, color: str) -> None:
    code, out, err = run(color, "2cm")
    assert (code, err) == (0, "")
    assert "warning         channels of the color below 0.0001 were set to 0.0001" in out.splitlines()
    assert (
        "is not in 0 < t <= 1; a channel of 0 would need an infinite extinction; use a value such as 0.001 for"
        in one_error_line(run(color, "2cm", "--no-clamp"))
    )


def test_a_bright_color_is_not_touched_by_clamping(run: Run) -> None:
    assert run("7b1e3a", "1cm") == run("#7b1e3a", "1cm", "--no-clamp")
    assert "clamped" not in run("#7b1e3a", "1cm").out


def test_a_color_that_the_shell_took_for_a_comment_is_told(run: Run) -> None:
    hint = "in a shell, quote the color: '#7b1e3a' (# begins a comment)"
    assert f"Missing argument 'COLOR'. {hint[:1].upper()}{hint[1:]}" in one_error_line(run())
    assert f"color ''; the text is empty; {hint}" in one_error_line(run("", "1cm"))


def test_a_filament_is_told_by_its_transmission_distance(run: Run) -> None:
    code, out, err = run("--td", "4mm")
    assert (code, err) == (0, "")
    assert "0.1        0.1        0.1 linear" in out.splitlines()[0]
    assert "filament TD     4 mm: where 10 % of the luminance of white light passes" in out.splitlines()
    assert run("--td", "4").out == out
    told = json.loads(run("--td", "0.4", "--unit", "cm", "--td-transmittance", "0.05", "--json").out)
    assert told["extinction"] == pytest.approx([-math.log(0.05) / 4e-3] * 3, rel=1e-14)
    assert told["transmission_distance"] == {"distance": pytest.approx(4e-3, rel=1e-12), "transmittance": 0.05}
    told = json.loads(run("linear(.1,1,.5)", "2cm", "--json").out)
    assert told["transmission_distance"] == {"distance": None, "transmittance": 0.1}


def test_a_transmission_distance_is_all_that_is_said(run: Run) -> None:
    assert "--td and COLOR exclude each other" in one_error_line(run("#7b1e3a", "--td", "4mm"))
    assert "the transmittance must lie between 0 and 1" in one_error_line(run("--td", "4mm", "--td-transmittance", "1"))
    assert "length '-4mm'; the length must be positive" in one_error_line(run("--td", "-4mm"))


def test_for_an_engine_only_the_block_is_printed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def text_block(target: str, medium: Any, color: np.ndarray, distance: float, roughness: float) -> str:
        assert roughness == 0
        assert medium.transmittance(distance) == pytest.approx(color, rel=1e-14)
        return f"block for {target}"

    monkeypatch.setattr("translucent.materials.text_block", text_block)
    code, out, err = run("linear(0.25,0.5,1)", "2cm", "--as", "unreal")
    assert (code, out) == (0, "block for unreal\n")
    assert "warning: blue is 1, so the medium absorbs nothing of it" in err


@pytest.mark.parametrize("target", TARGETS)
def test_every_engine_has_a_block(run: Run, target: str) -> None:
    """A color has no surface: a message says so where the material has one."""
    code, out, err = run("#7b1e3a", "1cm", "--as", target)
    assert code == 0
    assert ("its ior is 1" in err) == (target not in ("css", "json"))
    assert err.count("\n") <= 1
    assert len(out) > 20
    assert run("#7b1e3a", "1cm", "--as", target, "--ior", "1.5").err == ""


@pytest.mark.parametrize(("target", "suffix"), [("blender", ".py"), ("threejs", ".js"), ("godot", ".gdshader")])
def test_a_material_has_its_surface_and_is_read_again(run: Run, here: Path, target: str, suffix: str) -> None:
    """Index and roughness as they are asked for; a preset has its own."""
    block = run("#7b1e3a", "1cm", "--as", target, "--ior", "1.45", "--roughness", "0.25").out
    assert "1.45" in block
    assert "0.25" in block
    (here / f"a{suffix}").write_text(block)
    again = run("--from", f"a{suffix}", "--as", "json")
    assert again.code == 0
    assert json.loads(again.out)["ior"] == 1.45
    assert json.loads(again.out)["absorption"] == pytest.approx(-np.log(parse_color("#7b1e3a")) / 0.01, rel=1e-12)
    assert "  roughness: 0.25," in run("--from", f"a{suffix}", "--as", "threejs").out
    assert "  roughness: 0.5," in run("--from", f"a{suffix}", "--as", "threejs", "--roughness", "0.5").out
    assert "0.15" in run("--preset", "jade", "--as", target).out


@pytest.mark.parametrize("option", [("--ior", "1.5"), ("--roughness", "0.5")])
def test_a_surface_is_that_of_a_material_for_an_engine(run: Run, option: tuple[str, str]) -> None:
    assert "add --as, or omit the option" in one_error_line(run("#7b1e3a", "1cm", *option))


@pytest.mark.parametrize("name", ["jade.mtlx", "jade.usda", "jade.json"])
def test_a_material_of_one_engine_becomes_one_of_another(run: Run, here: Path, name: str) -> None:
    target = {".mtlx": "openpbr", ".usda": "usd", ".json": "json"}[Path(name).suffix]
    jade = ("linear(.18,.62,.35)", "2cm")
    (here / name).write_text(run(*jade, "--as", target)[1])
    told = json.loads(run("--from", name, "--json")[1])
    assert told["extinction"] == pytest.approx(-np.log([0.18, 0.62, 0.35]) / 0.02, rel=1e-12)
    assert told["distance"] == pytest.approx(1 / max(told["extinction"]), rel=1e-12)
    assert told["color"] == pytest.approx(np.exp(-np.array(told["extinction"]) * told["distance"]), rel=1e-12)
    code, out, err = run("--from", name, "--as", "unreal")
    assert (code, err) == (0, "")
    # The mean free path in centimeters, of Substrate.
    path = [float(v) for v in re.findall(r"SSS MFP \(cm\) += \((.*)\)", out)[0].split(",")]
    assert path == pytest.approx(100 / np.array(told["extinction"]), rel=1e-8)


@pytest.mark.parametrize("target", ["openpbr", "standard_surface"])
def test_lengths_of_a_materialx_file_are_in_the_unit_that_is_said(run: Run, here: Path, target: str) -> None:
    (here / "a.mtlx").write_text(run("gray", "2cm", "--as", target)[1])
    metres = json.loads(run("--from", "a.mtlx", "--json")[1])["extinction"]
    centimeters = json.loads(run("--from", "a.mtlx", "--unit", "cm", "--json")[1])["extinction"]
    assert centimeters == pytest.approx(100 * np.array(metres), rel=1e-12)


def test_a_preset_for_an_engine_and_a_clear_one(run: Run, here: Path) -> None:
    code, out, err = run("--preset", "merlot", "--as", "json")
    assert (code, err) == (0, "")
    assert json.loads(out)["absorption"] == np.asarray(tl.preset("merlot").medium.absorption).tolist()
    (here / "clear.json").write_text('{"ior": 1.5}')
    told = json.loads(run("--from", "clear.json", "--json")[1])
    assert (told["color"], told["distance"], told["extinction"]) == ([1, 1, 1], 1.0, [0, 0, 0])


TABLE = """name,color,distance,unit
wine,#7b1e3a,1cm,
red,red,1,cm
jade,"linear(.18,.62,.35)",20,mm
mist,gray,far,m
"""


def test_a_bad_row_does_not_stop_the_others(run: Run, here: Path) -> None:
    (here / "in.csv").write_text(TABLE)
    code, out, err = run("--batch", "in.csv", "-o", "out.json", "--no-clamp")
    assert (code, out) == (1, "")
    lines = err.splitlines()
    assert lines[0].startswith("error: in.csv line 3: color (1.0, 0.0, 0.0); green = 0 is not in 0 < t <= 1")
    assert lines[1].startswith("error: in.csv line 5: length 'far'; the text is not a number with a unit")
    assert lines[2:] == ["error: 2 of 4 rows failed; the others are in out.json"]
    told = json.loads((here / "out.json").read_text())
    assert [record["name"] for record in told] == ["wine", "jade"]
    assert told[1]["extinction"] == pytest.approx(-np.log([0.18, 0.62, 0.35]) / 0.02, rel=1e-14)
    assert sorted(path.name for path in here.iterdir()) == ["in.csv", "out.json"]


def test_a_table_to_csv_with_clamping(run: Run, here: Path) -> None:
    (here / "in.json").write_text('[{"name": "red", "color": [1, 0, 0], "distance": 1}]')
    told = run("--batch", "in.json", "-o", "out.csv", "--unit", "cm")
    assert told == (
        0,
        "",
        "warning: 1 of 1 colors had channels below 0.0001, now 0.0001; see the warnings of these rows\n",
    )
    with (here / "out.csv").open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["mean_free_path_r"], row["extinction_r"]) == ("inf", "0.0")
    assert float(row["extinction_g"]) == pytest.approx(-math.log(1e-4) / 0.01, rel=1e-14)
    assert row["warnings"].startswith("channels of the color below 0.0001 were set to 0.0001 | red is 1")


def test_no_name_is_a_formula_to_a_spreadsheet(run: Run, here: Path) -> None:
    names = ["=cmd|' /c calc'!A1", "+1+1", "-x", "@SUM(1)", "\tx", "\r=x", "a\r=x", "-1.5", "a=b"]
    rows = [{"name": name, "color": [0.5, 0.5, 0.5], "distance": 1} for name in names]
    (here / "in.json").write_text(json.dumps(rows))
    assert run("--batch", "in.json", "-o", "out.csv")[0] == 0
    with (here / "out.csv").open(newline="") as stream:
        told = list(csv.DictReader(stream))
    kept = [name.replace("\r", "\n") for name in names]
    assert [row["name"] for row in told] == [*(f"'{name}" for name in kept[:6]), *kept[6:]]
    assert {row["extinction_r"] for row in told} == {str(-math.log(0.5))}


def test_a_table_shows_swatches_and_errors(here: Path) -> None:
    (here / "in.csv").write_text("name,color,distance\n<wine>,#7b1e3a,1cm\nmist,gray,<far>\n")
    html = convert_table("in.csv")._repr_html_()
    assert "<div>&lt;wine&gt;</div>" in html
    assert "10 mm<br>#7b1e3a" in html
    assert "error: in.csv line 3: length &#x27;&lt;far&gt;&#x27;" in html
    rows = "".join(f"row {i},gray,1cm\n" for i in range(MOST_SHOWN + 2))
    (here / "long.csv").write_text("name,color,distance\n" + rows)
    html = convert_table("long.csv")._repr_html_()
    assert (html.count("row "), html.count("and 2 more")) == (MOST_SHOWN, 1)


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


def test_photographs_are_fitted(run: Run, here: Path) -> None:
    rows = np.concatenate([[1.0], 0.92 * np.exp(-100.0 * np.array([1, 2, 4]) * 1e-3)])
    for name, exposure in (("dim.png", 0.4), ("bright.png", 0.95)):
        picture = np.repeat(np.repeat(exposure * rows, 20)[None, :, None], 20, axis=0).repeat(3, axis=2)
        Image.fromarray(np.round(255 * linear_to_srgb(picture)).astype(np.uint8)).save(here / name)
    how = ("--fit", "dim.png", "--fit", "bright.png", "--white", "0,0,20,20")
    told = json.loads(run(*how, "--patch", "20,0,60,20=1,2,4", "--unit", "mm", "--json").out)
    assert np.abs(np.subtract(told["extinction"], 100)).max() <= max(told["interval"]) < 5
    assert told["surface_loss"] == pytest.approx([0.08] * 3, abs=0.01)
    assert told["samples"] == [6, 6, 6]
    code, out, err = run(*how, "--patch", "20,0,60,20=1mm,2mm,4mm", "--ior", "1.5")
    assert (code, err) == (0, "")
    assert "1/m (95 % confidence interval of the extinction)" in out
    assert "6, 6, 6 patches in 2 photographs" in out
    assert "the samples are about" not in out
    thick = run(*how, "--patch", "20,0,60,20=1,2,4").out
    assert "the samples are about 2 m thick: lengths without a unit are metres" in thick
    assert "this fit also needs --patch; give the rectangles" in one_error_line(run(*how))
    assert "the rectangle lies outside the picture of" in one_error_line(run(*how, "--patch", "70,0,60,20=1mm"))
    assert "these options apply only to --fit PHOTO" in one_error_line(run("gray", "1cm", "--white", "0,0,1,1"))
    assert "give one table, one .toml file" in one_error_line(run("--fit", "a.csv", "--fit", "b.csv"))


# On a model

PLATE = ("--on", "plate.stl", "--unit", "mm", "--eye", "0,0,10")


@pytest.fixture
def plate(here: Path, renderer: object) -> Path:
    """A plate of 2 mm: from 10 m, its thickness is 2 mm times at most 1 + 0.01^2 at every pixel."""
    trimesh.creation.box((200, 200, 2)).export(here / "plate.stl")
    return here


def test_the_medium_for_an_average_color(run: Run, plate: Path) -> None:
    code, out, err = run("linear(.5,.25,1)", *PLATE, "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["extinction"] == pytest.approx([math.log(2) / 0.002, math.log(4) / 0.002, 0.0], rel=2e-4)
    assert told["on"]["average_color"] == pytest.approx([0.5, 0.25, 1.0], rel=1e-9)
    assert told["on"]["mean_thickness"] == pytest.approx(0.002, rel=2e-4)
    assert told["distance"] == told["on"]["mean_thickness"]
    assert told["on"]["model"] == "plate.stl"
    assert told["warnings"][0].startswith("blue is 1, so the medium absorbs nothing of it")


def test_a_model_takes_the_place_of_the_distance(run: Run, renderer: tl.Renderer) -> None:
    """The medium that is found shows the color; a color at the same distance does not."""
    found = json.loads(run("#7b1e3a", "--on", "bear", "--json")[1])
    extinction = np.array(found["extinction"])
    mesh = tl.load_mesh(mesh_path("bear"))
    frame = renderer.render(tl.showcase(mesh, tl.Medium(absorption=extinction), SIZE, stage="none"), SIZE)
    seen = frame.transmittance[frame.coverage & frame.valid].mean(axis=0, dtype=np.float64)
    # Float32 in the picture: a few roundings of an exponent of at most 20.
    assert np.abs(seen - parse_color("#7b1e3a")).max() < 1e-5
    asked = json.loads(run("#7b1e3a", f"{found['on']['mean_thickness']}m", "--on", "bear", "--json")[1])
    assert asked["color"] == pytest.approx(parse_color("#7b1e3a"), rel=1e-12)
    assert np.abs(np.array(asked["on"]["average_color"]) - asked["color"]).max() > 1e-2


def test_a_preset_on_a_model(run: Run, plate: Path) -> None:
    code, out, err = run("--preset", "marble", *PLATE, "--json")
    told = json.loads(out)
    assert code == 0
    assert err.startswith("warning: scattering dominates")
    extinction = tl.preset("marble").medium.extinction
    # The thickness is at most 1 + 1e-4 times as much.
    expected = np.exp(-0.002 * extinction)
    assert (np.abs(told["on"]["average_color"] / expected - 1) <= 2e-4 * 0.002 * extinction).all()
    assert told["extinction"] == extinction.tolist()


def test_the_words_tell_the_average_and_the_thin_and_thick_parts(run: Run, renderer: object) -> None:
    code, out, err = run("#7b1e3a", "--on", "bear")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert re.fullmatch(r"on bear: \d+ pixels, 0\.0055\d* m thick on average", lines[0])
    assert lines[1].endswith(" linear, #7b1e3a sRGB")
    assert [line.rpartition("; ")[2] for line in lines[2:7]] == [
        f"{p}% of the model is thinner" for p in (5, 25, 50, 75, 95)
    ]
    assert re.match("warning         7.% of the average green comes from the thin", lines[-1])


def test_for_an_engine_the_color_is_stated_at_the_thickness_of_the_model(run: Run, plate: Path) -> None:
    code, out, _ = run("linear(.5,.25,.7)", *PLATE, "--as", "gltf")
    assert code == 0
    volume = json.loads(out)["extensions"]["KHR_materials_volume"]
    assert volume["thicknessFactor"] == volume["attenuationDistance"] == pytest.approx(0.002, rel=2e-4)
    assert volume["attenuationColor"] == pytest.approx([0.5, 0.25, 0.7], rel=1e-3)


def test_for_an_engine_a_dark_color_is_stated_nearer_and_the_thickness_stays(run: Run, renderer: object) -> None:
    told = json.loads(run("#7b1e3a", "--on", "bear", "--json")[1])
    volume = json.loads(run("#7b1e3a", "--on", "bear", "--as", "gltf")[1])["extensions"]["KHR_materials_volume"]
    assert volume["thicknessFactor"] == told["on"]["mean_thickness"] > 2 * volume["attenuationDistance"]
    extinction = -np.log(volume["attenuationColor"]) / volume["attenuationDistance"]
    assert extinction == pytest.approx(told["extinction"], rel=1e-12)


def test_a_black_channel_is_clamped_on_a_model_too(run: Run, plate: Path) -> None:
    told = json.loads(run("#ff0000", *PLATE, "--json")[1])
    assert told["on"]["average_color"] == pytest.approx([1.0, 1e-4, 1e-4], rel=1e-9)
    assert told["warnings"][0] == "channels of the color below 0.0001 were set to 0.0001"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["black", "--no-clamp", *PLATE],
            "average color with red = 0; the value must satisfy 0.0001 <= t <= 1; use 0.0001 or more",
        ),
        (
            ["linear(1.5,1,1)", *PLATE],
            "red = 1.5; the value must satisfy 0.0001 <= t <= 1; a medium cannot amplify light",
        ),
        (["gray", "--on", "none.obj"], "none.obj"),
        (
            ["gray", "--on", "bear", "--unit", "cm"],
            "--unit cm; bear is a built-in mesh, whose coordinates are in metres",
        ),
        (["gray", "--on", "bear", "--eye", "0,0"], "--eye '0,0'; the value is not three numbers"),
        (["gray", "--on", "bear", "--eye", "9,9,9", "--preset", "jade"], "--preset and COLOR exclude each other"),
        (["--on", "bear", "--preset", "jadd"], "preset 'jadd'; no preset has this name; did you mean jade"),
        (
            ["--on", "bear", "--fit", "w.csv"],
            "--on and --fit exclude each other; each of the two options computes a different result",
        ),
        (
            ["--on", "bear", "--batch", "t.csv"],
            "--on and --batch exclude each other; each of the two options computes a different result",
        ),
        (["--on", "bear"], "Missing argument 'COLOR'"),
        (["gray", "1cm", "--preset", "jade"], "--preset and COLOR exclude each other"),
        (["gray", "1cm", "--eye", "0,0,1"], "--eye 0,0,1; only --on uses a view of a model"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_a_question_that_cannot_be_answered_is_one_line(
    run: Run, plate: Path, arguments: list[str], message: str
) -> None:
    assert message in one_error_line(run(*arguments))


@pytest.mark.filterwarnings("ignore:.*open edges")
def test_an_open_model_has_no_color(run: Run, plate: Path) -> None:
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(plate / "open.stl")
    code, out, err = run("gray", "--on", "open.stl")
    assert (code, out) == (2, "")
    assert (
        "pixels that the mesh covers are marked invalid; close the holes of the mesh, which `translucent explain` lists"
        in err.splitlines()[-1]
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--batch", "none.csv"], "table 'none.csv'; no file has this path"),
        (["--batch", "."], "table '.'; the path is a folder"),
        (["--batch", "empty.csv"], "table 'empty.csv'; no column 'name': the file is empty"),
        (["--batch", "head.csv"], "table 'head.csv'; the table has no rows; add at least one row"),
        (["--batch", "few.csv"], "no column 'distance': the first line is name, color"),
        (["--batch", "bytes.csv"], "not UTF-8 text"),
        (["--batch", "bad.json"], "table 'bad.json'; the file is not valid JSON:"),
        (["--batch", "dict.json"], "not a list of objects"),
        (["--batch", "good.csv", "-o", "out.txt"], "output 'out.txt'; suffix '.txt'; use .json or .csv"),
        (["--batch", "good.csv", "-o", "no/out.csv"], "the folder 'no' does not exist; create the folder first"),
        (["--batch", "good.csv", "--unit", "furlong"], "unit 'furlong'; no unit of length has this name"),
        (["--batch", "good.csv", "--as", "css"], "--as css; --as converts a single color, but --batch converts many"),
        (
            ["--batch", "good.csv", "--fit", "good.csv"],
            "--fit and --batch exclude each other; each of the two options computes a different result",
        ),
        (["gray", "1cm", "--batch", "good.csv"], "COLOR and --batch exclude each other"),
        (["gray", "1cm", "-o", "x.json"], "-o x.json; only --batch writes an output file"),
        (["gray", "1cm", "--json", "--as", "css"], "--as and --json exclude each other"),
        (["gray", "1cm", "--as", "word"], "'word' is not one of"),
        (
            ["gray", "--from", "dict.json"],
            "--from and COLOR exclude each other; each of the two options computes a different result",
        ),
        (["--preset", "jade", "--from", "dict.json"], "--from and --preset exclude each other"),
        (["--from", "none.mtlx"], "material 'none.mtlx'; no file has this path"),
        (["--from", "good.csv"], "material 'good.csv'; suffix '.csv'; give a .json, .mtlx, .py, .js,"),
        (["--from", "dict.json"], "material 'dict.json'; medium as JSON; the JSON has the unknown keys name"),
        (["--from", "bytes.usda"], "material 'bytes.usda'; not UTF-8 text"),
        (["gray", "1cm", "--unit-out", "furlong"], "unit 'furlong'; no unit of length has this name"),
        (["none.png@1,2", "1cm"], "pixel 1,2 of 'none.png'; no file has this path"),
        (["linear(-.1,1,1)", "1cm", "--clamp"], "red = -0.1 is not in 0 < t <= 1"),
        (["--fit", "few.csv"], "no column 'distance'"),
        (
            ["--fit", "good.csv", "--clamp"],
            "--clamp; --clamp would replace measured zeros by invented values, which would falsify the fit",
        ),
        ([], "Missing argument 'COLOR'"),
        (["gray"], "Missing argument 'DISTANCE'. A color has a meaning only at a distance"),
        (["jade"], "Jade is a preset: write --preset jade"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_bad_input_is_one_line_and_exit_code_2(run: Run, here: Path, arguments: list[str], message: str) -> None:
    (here / "empty.csv").write_text("")
    (here / "head.csv").write_text("name,color,distance\n\n")
    (here / "few.csv").write_text("name,color\na,gray\n")
    (here / "good.csv").write_text("name,color,distance\na,gray,1cm\n")
    (here / "bytes.usda").write_bytes(b"PXR-USDC\xff\xfe")
    (here / "bytes.csv").write_bytes(b"name,color,distance\n\xff\xfe,gray,1\n")
    (here / "bad.json").write_text("[{")
    (here / "dict.json").write_text('{"name": 1}')
    before = sorted(here.iterdir())
    assert message in one_error_line(run(*arguments))
    assert sorted(here.iterdir()) == before
