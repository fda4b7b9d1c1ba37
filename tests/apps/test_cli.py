"""The command line, in-process: one line per error, the right exit code, no file harmed, and one JSON object."""

from __future__ import annotations

import json
import math
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from translucent.cli import main
from translucent.gpu import context
from translucent.materials.gltf_file import read_gltf, write_gltf

GREEN = "linear(0.18,0.62,0.35)"


@dataclass(frozen=True)
class Result:
    code: int
    out: str
    err: str


Run = Callable[..., Result]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # the command line sets its own

    def _run(*arguments: object) -> Result:
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Result(code, captured.out, captured.err)

    return _run


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.ply"
    trimesh.creation.box((1, 1, 1)).export(path)
    return path


GLASS = {
    "KHR_materials_transmission": {"transmissionFactor": 1},
    "KHR_materials_volume": {"thicknessFactor": 1, "attenuationColor": [0.25, 0.5, 1], "attenuationDistance": 0.5},
}


def write_scene(path: Path, *materials: dict[str, Any], cameras: bool = True) -> Path:
    """A file of one 1 x 1 x 2 m box per material, 10 m apart along x; and cameras 20 m away along z, and along x."""
    boxes = trimesh.Scene()
    for i in range(len(materials)):
        shift = trimesh.transformations.translation_matrix((10 * i, 0, 0))
        boxes.add_geometry(trimesh.creation.box((1, 1, 2)), f"Box {i}", f"Box {i}", transform=shift)
    path.write_bytes(boxes.export(file_type="glb"))
    file = read_gltf(path)
    file.tree["materials"] = list(materials)
    for i, mesh in enumerate(file.tree["meshes"]):
        mesh["primitives"][0]["material"] = i
    if cameras:
        file.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.3, "znear": 1}}] * 2
        file.tree["nodes"] += [
            {"camera": 0, "name": "Front", "translation": [0, 0, 20]},
            {
                "camera": 1,
                "name": "Side",
                "translation": [-20, 0, 0],
                "rotation": [0, -math.sqrt(0.5), 0, math.sqrt(0.5)],
            },
        ]
        nodes = file.tree["scenes"][0]["nodes"]
        nodes += range(len(file.tree["nodes"]) - 2, len(file.tree["nodes"]))
    write_gltf(file, path)
    return path


@pytest.fixture
def glass_box(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "scene.glb", {"extensions": GLASS})


@pytest.fixture
def no_opengl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refuse() -> Any:
        raise Exception("no such library")  # a bare one, as glcontext raises

    monkeypatch.setattr(context, "_OPENERS", dict.fromkeys(context._OPENERS, refuse))
    return


@pytest.fixture
def no_embree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)


def strict_json(text: str) -> Any:
    """One JSON object; NaN and infinities, which JSON does not have, fail."""

    def refuse(word: str) -> None:
        pytest.fail(f"{word} is no JSON")

    value = json.loads(text, parse_constant=refuse)
    assert isinstance(value, dict)
    return value


def one_error_line(result: Result) -> str:
    assert result.out == ""
    assert "Traceback" not in result.err
    lines = result.err.splitlines()
    assert len(lines) == 1, result.err
    assert lines[0].startswith("error: ")
    return lines[0]


# Bad input

BAD_RENDER_OPTIONS = [
    (["--size", "0x0"], "frame size (0, 0); not two whole numbers above 0"),
    (["--size", "-4x4"], "frame size (-4, 4); not two whole numbers above 0"),
    (["--size", "abc"], "--size 'abc'; not WxH"),
    (["--size", "64"], "--size '64'; not WxH"),
    (["--size", "1.5x2"], "--size '1.5x2'; not WxH"),
    (["--size", "1x2x3"], "--size '1x2x3'; not WxH"),
    (["--color", "linear(0,0.5,0.5)", "--distance", "1cm"], "red = 0 is not in 0 < t <= 1"),
    (["--color", "linear(1.1,0.5,0.5)", "--distance", "1cm"], "red = 1.1 is not in 0 < t <= 1"),
    (["--color", "linear(nan,0.5,0.5)", "--distance", "1cm"], "a channel is not finite"),
    (["--color", "reddish", "--distance", "1cm"], "color 'reddish'; neither a hex color"),
    (["--color", GREEN, "--distance", "0"], "length '0'; not positive and finite"),
    (["--color", GREEN, "--distance", "-1cm"], "length '-1cm'; not positive and finite"),
    (["--color", GREEN, "--distance", "abc"], "length 'abc'; not a number with a unit"),
    (["--color", GREEN, "--distance", "2 furlong"], "unit 'furlong'; not a known unit"),
    (["--color", GREEN], "--color; --distance is missing; give both"),
    (["--distance", "1cm"], "--distance; --color is missing; give both"),
    (["--preset", "unobtainium"], "preset 'unobtainium'; not a known preset; use one of marble"),
    (["--preset", "jade", "--color", GREEN], "--preset jade; --color or --distance is given, too"),
    (["--method", "magic"], "method 'magic'; not a known method; use one of signed-depth"),
    (["--backend", "vulkan"], "backend 'vulkan'; not a known backend; use one of egl, window, osmesa"),
    (["--unit", "furlong"], "unit 'furlong'; not a known unit"),
    (["--background", "reddish"], "color 'reddish'; neither a hex color"),
    (["--eye", "1,2"], "--eye '1,2'; not three numbers"),
    (["--eye", "a,b,c"], "--eye 'a,b,c'; not three numbers"),
    (["--eye", "nan,0,0"], "camera eye, target or up; not three finite numbers"),
    (["--eye", "0,0,0"], "eye and target are both at (0.0, 0.0, 0.0)"),
    (["--eye", "0,5,0"], "is along the view; choose another up"),
    (["--eye", "1e200,0,0"], "camera eye, target or up; a number beyond 1e+18"),
    (["--up", "0,0,0"], "up (0.0, 0.0, 0.0) is along the view"),
    (["--up", "up"], "--up 'up'; not three numbers"),
    (["--fov", "1e-300"], "camera eye, target or up; a number beyond 1e+18"),
    (["--target", "0,0,0"], "--target; --eye is missing"),
    (["--fov", "0", "--eye", "0,0,5"], "camera fov_y 0.0; not between 0 and 180"),
    (["--fov", "180"], "camera fov_y 180.0; not between 0 and 180"),
    (["--fov", "nan"], "camera fov_y nan; not between 0 and 180"),
    (["--fov", "wide"], "Invalid value for '--fov'"),
    (["--samples", "0"], "samples 0; not a whole number in 1 to 4096"),
    (["--samples", "some"], "Invalid value for '--samples'"),
    (["--camera", "0"], "cube.ply is no glTF file and has no cameras; use --eye"),
    (["--camera", "first"], "Invalid value for '--camera'"),
    (["--borders", "front", "--opaque-with", "pyrender"], "--borders front; --opaque-with, where rays bend at both"),
    (["--no-such-option"], "--no-such-option'; see 'translucent render --help'"),
]


@pytest.mark.parametrize(
    ("options", "message"), BAD_RENDER_OPTIONS, ids=lambda v: " ".join(v) if isinstance(v, list) else ""
)
def test_render_refuses_a_bad_option_and_writes_nothing(
    run: Run, cube: Path, tmp_path: Path, options: list[str], message: str
) -> None:
    fresh, existing = tmp_path / "fresh.png", tmp_path / "existing.png"
    existing.write_bytes(b"precious")
    before = sorted(tmp_path.iterdir())
    for output in (fresh, existing):
        result = run("render", cube, "-o", output, "--size", "4x4", *options)
        assert result.code == 2
        assert message in one_error_line(result)
    assert existing.read_bytes() == b"precious"
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "no such file"),
        ("garbage.glb", b"\x00\xff" * 100, "its JSON is broken"),
        ("garbage.gltf", b"[1]", "no asset, so it is not glTF 2.0"),
        ("MISSING.GLB", None, "no such file"),
        ("garbage.ply", b"\x00\xff" * 100, "it cannot be read"),
        ("garbage.obj", b"\x00\xff" * 100, "error: mesh"),
        ("garbage.stl", b"\x00\xff" * 100, "error: mesh"),
        ("cut.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "error: mesh"),
        ("empty.obj", b"", "it has no faces"),
        ("points.obj", b"v 0 0 0\n", "it has no faces"),
        (f"{'long' * 100}.obj", None, "no such file"),
        ("point.obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "all its vertices are at one point"),
        ("model.fbx", b"Kaydara", "format '.fbx' is not known"),
        ("nan.obj", b"v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 vertices are not finite (first: 0)"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "error: mesh"),
    ],
)
@pytest.mark.parametrize("verb", ["render", "explain"])
def test_a_bad_model_is_refused(
    run: Run, tmp_path: Path, verb: str, name: str, content: bytes | None, message: str
) -> None:
    model, output = tmp_path / name, tmp_path / "out.png"
    if content is not None:
        model.write_bytes(content)
    result = run(verb, model, *(["-o", output] if verb == "render" else []))
    assert result.code == 2
    line = one_error_line(result)
    assert message in line
    assert name in line
    assert not output.exists()


@pytest.mark.parametrize("name", ["folder", "folder.glb"])
def test_a_folder_is_no_model(run: Run, tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    result = run("explain", tmp_path / name)
    assert result.code == 2
    assert one_error_line(result).endswith(f"{name}'; it is a folder; give a file in it")


@pytest.mark.parametrize(
    ("output", "option"),
    [("a.png", ("--aov", "taken/below")), ("taken", ("--turntable", "4")), ("taken/below", ("--turntable", "4"))],
)
def test_a_file_where_a_folder_has_to_be_is_found_before_any_work(
    run: Run, cube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_opengl: None, output: str, option: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("kept")
    result = run("render", cube, "-o", output, *option)
    assert result.code == 2
    assert one_error_line(result).endswith("'taken' is no folder; choose another one")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cube.ply", "taken"]
    assert Path("taken").read_text() == "kept"


@pytest.mark.parametrize("placed", [("--eye", "0,0,9"), ("--target", "0,0,0"), ("--up", "0,1,0"), ("--fov", "30")])
def test_a_camera_of_the_file_excludes_one_that_options_place(
    run: Run, glass_box: Path, tmp_path: Path, placed: tuple[str, str]
) -> None:
    result = run("render", glass_box, "-o", tmp_path / "out.png", "--camera", "0", *placed)
    assert result.code == 2
    assert f"--camera 0; {placed[0]} given, too; give one or the other" in one_error_line(result)


@pytest.mark.parametrize("number", ["2", "-1"])
def test_a_camera_that_is_not_there_is_refused_with_those_that_are(
    run: Run, glass_box: Path, tmp_path: Path, number: str
) -> None:
    result = run("render", glass_box, "-o", tmp_path / "out.png", "--camera", number)
    assert result.code == 2
    assert "it has 0 of node 'Front', 1 of node 'Side'; give one of these numbers" in one_error_line(result)


def test_a_scene_of_opaque_objects_is_refused_and_yet_explained(run: Run, tmp_path: Path) -> None:
    model = write_scene(tmp_path / "rock.glb", {})
    result = run("render", model, "-o", tmp_path / "out.png")
    assert result.code == 2
    line = one_error_line(result)
    assert "its 1 object is opaque: no material has KHR_materials_transmission; add --preset NAME, or --color C" in line
    assert not (tmp_path / "out.png").exists()
    result = run("explain", model)
    assert (result.code, result.err) == (0, "")
    assert "'Box 0', opaque: 12 faces, 1 x 1 x 2 m\n" in result.out
    assert "plan: none, since no object is translucent; see with --preset NAME" in result.out
    assert strict_json(run("explain", model, "--json").out)["plan"] is None
    assert "plan: SignedDepth" in run("explain", model, "--preset", "merlot").out


@pytest.mark.parametrize(
    ("output", "code", "message"),
    [
        ("picture.bmp", 2, "suffix '.bmp'; use .png, .exr or .npz"),
        ("picture", 2, "suffix ''; use .png, .exr or .npz"),
        ("missing/picture.png", 2, "; make the folder first"),
        ("cube.ply/picture.png", 2, "cube.ply' is no folder; choose another one"),
        ("folder.png", 2, "folder.png'; a folder of that name is there; choose another name"),
        (f"{'long' * 100}/picture.png", 2, "; make the folder first"),
    ],
)
def test_a_bad_output_is_refused_before_any_work(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None, output: str, code: int, message: str
) -> None:
    (tmp_path / "folder.png").mkdir()
    before = sorted(tmp_path.iterdir())
    result = run("render", cube, "-o", tmp_path / output)
    assert result.code == code
    assert message in one_error_line(result)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing command"),
        (["frobnicate"], "No such command 'frobnicate'"),
        (["--frobnicate"], "No such option"),
        (["render"], "Missing argument 'MODEL'"),
        (["render", "cube.ply"], "Missing option '-o'"),
        (["explain"], "Missing argument 'MODEL'"),
        (["explain", "a", "b"], "unexpected extra argument"),
        (["explain", "beer"], "mesh 'beer'; no file and no mesh of the toolkit; give a path, or one of amber, "),
        (["explain", "x.obj", "--method", "magic"], "x.obj'; no such file"),
        (["extinction"], "Missing argument 'COLOR'"),
        (["extinction", "teal"], "Missing argument 'DISTANCE'"),
        (["extinction", "red", "1cm"], "color 'red'; green = 0 is not in 0 < t <= 1"),
        (["extinction", "linear(.5,.5,2)", "1cm"], "blue = 2 is not in 0 < t <= 1"),
        (["extinction", "linear(.5,.5,nan)", "1cm"], "a channel is not finite"),
        (["extinction", "reddish", "1cm"], "color 'reddish'"),
        (["extinction", "#808080", "0"], "length '0'; not positive and finite"),
        (["extinction", "#808080", "1e-320"], "so short that the extinction overflows"),
        (["extinction", "#808080", "abc"], "length 'abc'; not a number"),
        (["extinction", "#808080", "nan"], "not positive and finite"),
        (["extinction", "#808080", "--", "-1cm"], "length '-1cm'; not positive"),
        (["extinction", "#808080", "1cm", "--json", "--nope"], "No such option"),
        (["doctor", "me"], "unexpected extra argument"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else None,
)
def test_bad_usage_is_one_line_and_exit_code_2(run: Run, arguments: list[str], message: str) -> None:
    result = run(*arguments)
    assert result.code == 2
    assert message in one_error_line(result)


def test_debug_shows_the_traceback(run: Run, tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="no such file"):
        run("explain", tmp_path / "missing.obj", "--debug")


@pytest.mark.parametrize("arguments", [["--help"], ["render", "--help"], ["explain", "-h"], ["extinction", "--help"]])
def test_help_is_no_error_and_every_verb_shows_an_example(run: Run, arguments: list[str]) -> None:
    result = run(*arguments)
    assert (result.code, result.err) == (0, "")
    assert "Usage: translucent" in result.out
    if len(arguments) > 1:
        assert f"Example: translucent {arguments[0]}" in result.out


def test_the_version_is_told(run: Run) -> None:
    result = run("--version")
    assert result.code == 0
    assert re.fullmatch(r"translucent, version \d+\.\d+\.\d+\s*", result.out)


# Good runs


def test_extinction_as_json_has_the_numbers(run: Run) -> None:
    result = run("extinction", "linear(0.25,0.5,1)", "2cm", "--json")
    assert (result.code, result.err) == (0, "")
    told = strict_json(result.out)
    assert told["color"] == [0.25, 0.5, 1.0]
    assert told["distance"] == 0.02
    assert told["extinction"] == pytest.approx([math.log(4) / 0.02, math.log(2) / 0.02, 0.0], rel=1e-15)
    assert told["mean_free_path"][:2] == pytest.approx([0.02 / math.log(4), 0.02 / math.log(2)], rel=1e-15)
    assert told["mean_free_path"][2] is None
    assert told["transmittance"]["1"] == pytest.approx([0.25, 0.5, 1.0], rel=1e-15)
    assert told["transmittance"]["2"] == pytest.approx([0.0625, 0.25, 1.0], rel=2e-15)
    assert list(told["transmittance"]) == ["0.1", "0.5", "1", "2", "10"]


def test_extinction_in_words_has_the_same_numbers(run: Run) -> None:
    result = run("extinction", "linear(0.25,0.5,1)", "2cm")
    assert (result.code, result.err) == (0, "")
    lines = {line.split("  ")[0].strip(): line for line in result.out.splitlines()}
    assert [float(word) for word in lines["extinction"].split()[1:4]] == [69.315, 34.657, 0.0]
    assert "after 0.02 m" in lines["color"]
    assert lines["mean free path"].split()[3:] == ["0.014427", "0.028854", "inf", "m"]


def test_a_hex_color_is_srgb(run: Run) -> None:
    told = strict_json(run("extinction", "#808080", "1", "--json").out)
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert told["extinction"] == pytest.approx([-math.log(linear)] * 3, rel=1e-14)


def test_explain_tells_the_mesh_and_the_plan(run: Run, cube: Path) -> None:
    result = run("explain", cube)
    assert (result.code, result.err) == (0, "")
    for words in ("cube.ply: 8 vertices, 12 faces, 1 x 1 x 1 m", "mesh: closed, convex, 1 component", "signed_depth:"):
        assert words in result.out


def test_explain_as_json(run: Run, cube: Path) -> None:
    result = run("explain", cube, "--unit", "cm", "--method", "back-face-depth", "--json")
    told = strict_json(result.out)
    assert (result.code, result.err) == (0, "")
    assert told["mesh"]["volume"] == pytest.approx(1e-6, rel=1e-12)
    assert told["plan"]["method"] == "BackFaceDepth()"
    assert told["plan"]["exact"] is True
    assert [step["name"] for step in told["plan"]["passes"]] == ["back_face_depth", "transmittance"]


def test_explain_tells_the_objects_of_a_scene(run: Run, tmp_path: Path) -> None:
    wall = {"KHR_materials_transmission": {"transmissionFactor": 1}}
    tint = {"baseColorFactor": [0.5, 0.5, 0.5, 1]}
    model = write_scene(
        tmp_path / "scene.glb", {"extensions": GLASS}, {"extensions": wall, "pbrMetallicRoughness": tint}
    )
    result = run("explain", model)
    assert (result.code, result.err) == (0, "")
    for words in (
        "scene.glb: 2 objects, 2 of them translucent, 0 lights, 11 x 1 x 2 m",
        "'Box 0', body: 12 faces, 1 x 1 x 2 m; closed, convex, 1 component",
        "'Box 1', thin wall: 12 faces",
        "medium: 'Box 0': extinction 2.773, 1.386, 0 1/m",
        "medium: 'Box 1': thin, white light is #bcbcbc behind it",
        "plan: SignedDepth",
    ):
        assert words in result.out
    told = strict_json(run("explain", model, "--json").out)
    assert [item["kind"] for item in told["objects"]] == ["body", "thin wall"]
    assert told["objects"][0]["extinction"] == pytest.approx([4 * math.log(2), 2 * math.log(2), 0.0], rel=1e-14)
    assert (told["lights"], told["left_out"]) == (0, [])
    assert told["plan"]["passes"][-1]["name"] == "surfaces"


def test_what_a_scene_leaves_out_is_a_warning_line(run: Run, tmp_path: Path) -> None:
    model = write_scene(tmp_path / "scene.glb", {"extensions": GLASS, "alphaMode": "BLEND", "name": "Glass"})
    with warnings.catch_warnings():
        warnings.simplefilter("always")  # pytest turns warnings into errors, which nothing else does
        result = run("explain", model, "--json")
    lost = "transparency by alphaMode BLEND ('Glass')"
    assert result.err.splitlines() == [f"warning: scene 'scene.glb': left out: {lost}"]
    assert strict_json(result.out)["left_out"] == [lost]


def test_explain_needs_no_opengl(run: Run, cube: Path, no_opengl: None) -> None:
    assert run("explain", cube).code == 0


def test_a_repair_is_a_warning_line_and_no_part_of_the_json(run: Run, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 1, 1))
    path = tmp_path / "inverted.off"
    trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False).export(path)
    with warnings.catch_warnings():
        warnings.simplefilter("always")  # pytest turns warnings into errors, which nothing else does
        result = run("explain", path, "--json")
    assert result.code == 0
    assert result.err.splitlines() == ["warning: mesh 'inverted.off': turned 1 closed part outwards"]
    assert strict_json(result.out)["mesh"]["repairs"] == ["turned 1 closed part outwards"]


@pytest.mark.usefixtures("renderer")
class TestRendering:
    """What needs OpenGL."""

    # Straight on, from 10 m: the middle ray of a frame of odd size crosses the unit cube along its axis.
    VIEW = ("--eye", "0,0,10", "--target", "0,0,0", "--fov", "20", "--size", "9x5", "--samples", "1")

    def test_render_writes_the_exact_thickness_and_color(self, run: Run, cube: Path, tmp_path: Path) -> None:
        output = tmp_path / "cube.npz"
        medium = ("--color", "linear(0.25,0.5,1)", "--distance", "0.5m", "--background", "linear(1,0.5,0.25)")
        result = run("render", cube, "-o", output, *self.VIEW, *medium)
        assert (result.code, result.err) == (0, "")
        assert f"{output}: 9x5, " in result.out
        with np.load(output) as arrays:
            assert arrays["thickness"].shape == (5, 9)
            # A thickness of 1 m from distances of 0.5 m to either side of the center: a few float32 roundings.
            assert arrays["thickness"][2, 4] == pytest.approx(1.0, rel=1e-6)
            assert arrays["transmittance"][2, 4] == pytest.approx([1 / 16, 1 / 4, 1.0], rel=1e-5)
            assert arrays["radiance"][2, 4] == pytest.approx([1 / 16, 1 / 8, 1 / 4], rel=1e-5)
            assert arrays["thickness"][0, 0] == 0.0
            assert arrays["valid"].all()

    def test_render_bends_rays_at_one_border_or_both(self, run: Run, tmp_path: Path) -> None:
        glass = {"extensions": GLASS | {"KHR_materials_ior": {"ior": 1.5}}}
        model, frames = write_scene(tmp_path / "scene.glb", glass), {}
        for borders in ("both", "front"):
            output = tmp_path / f"{borders}.npz"
            result = run("render", model, "-o", output, "--size", "9x5", "--samples", "1", "--borders", borders)
            assert (result.code, result.err) == (0, "")
            assert ("leaves without bending" in result.out) == (borders == "front")
            with np.load(output) as arrays:
                frames[borders] = arrays["radiance"], arrays["thickness"]
        assert (frames["both"][0] != frames["front"][0]).any()
        assert (frames["both"][1] == frames["front"][1]).all()

    def test_render_as_json_prints_one_object(self, run: Run, cube: Path, tmp_path: Path) -> None:
        output = tmp_path / "cube.exr"
        result = run("render", cube, "-o", output, *self.VIEW, "--json")
        told = strict_json(result.out)
        assert (result.code, result.err) == (0, "")
        assert (told["output"], told["size"]) == (str(output), [9, 5])
        assert told["invalid_pixels"] == 0
        assert told["thickness"]["max"] == pytest.approx(1.0, rel=0.1)
        assert told["provenance"]["backend"] in {"egl", "osmesa"}
        assert output.stat().st_size > 0

    @pytest.mark.parametrize(
        "options",
        [
            [],
            ["--preset", "merlot"],
            ["--method", "back-face-depth"],
            ["--method", "thin_layer"],
            ["--background", "checkerboard"],
            ["--background", "teal"],
            ["--samples", "3"],
            ["--fov", "60"],
            ["--up", "0,0,1"],
            ["--backend", "cpu"],
        ],
        ids=" ".join,
    )
    def test_render_makes_a_picture_with(self, run: Run, cube: Path, tmp_path: Path, options: list[str]) -> None:
        from PIL import Image

        output = tmp_path / "cube.png"
        result = run("render", cube, "-o", output, "--size", "16x12", *options)
        assert (result.code, result.err) == (0, "")
        with Image.open(output) as picture:
            assert picture.size == (16, 12)
            assert picture.mode == "RGB"
            # The body in the middle is not the backdrop of a corner.
            assert picture.getpixel((8, 6)) != picture.getpixel((0, 0))

    @pytest.mark.parametrize(("camera", "metres"), [((), 2.0), (("--camera", "0"), 2.0), (("--camera", "1"), 1.0)])
    def test_render_shows_a_scene_in_its_own_media_through_its_cameras(
        self, run: Run, glass_box: Path, tmp_path: Path, camera: tuple[str, ...], metres: float
    ) -> None:
        output = tmp_path / "scene.npz"
        result = run("render", glass_box, "-o", output, "--size", "9x5", "--samples", "1", *camera)
        assert (result.code, result.err) == (0, "")
        assert "medium: extinction 2.773, 1.386, 0 1/m" in result.out
        with np.load(output) as arrays:
            assert arrays["thickness"][2, 4] == pytest.approx(metres, rel=1e-6)
            color = np.power([0.25, 0.5, 1.0], metres / 0.5)
            assert arrays["transmittance"][2, 4] == pytest.approx(color, rel=1e-5)

    def test_a_color_replaces_the_media_of_a_scene(self, run: Run, tmp_path: Path) -> None:
        model, output = write_scene(tmp_path / "scene.glb", {"extensions": GLASS}), tmp_path / "scene.npz"
        for material in ({"extensions": GLASS}, {}):  # translucent, or opaque and filled all the same
            write_scene(model, material, cameras=False)
            medium = ("--color", "linear(1,0.5,0.25)", "--distance", "1m")
            result = run("render", model, "-o", output, *self.VIEW, *medium, "--unit", "cm")
            assert (result.code, result.err) == (0, "")
            assert "medium: extinction 0, 0.6931, 1.386 1/m" in result.out
            with np.load(output) as arrays:
                assert arrays["thickness"][2, 4] == pytest.approx(0.02, rel=1e-6)

    def test_render_frames_all_objects_of_a_scene_without_cameras(self, run: Run, tmp_path: Path) -> None:
        model = write_scene(tmp_path / "two.glb", {"extensions": GLASS}, {"extensions": GLASS}, cameras=False)
        for options in ((), ("--fov", "60"), ("--camera", "0")):
            result = run("render", model, "-o", tmp_path / "two.npz", "--size", "40x30", "--samples", "1", *options)
            assert (result.code, result.err) == (0, "")
            with np.load(tmp_path / "two.npz") as arrays:
                covered = arrays["coverage"]
            assert covered.any()
            border = np.concatenate([covered[0], covered[-1], covered[:, 0], covered[:, -1]])
            assert not border.any()

    @pytest.mark.filterwarnings("ignore:scene 'AttenuationTest.glb'")
    def test_the_attenuation_test_has_equal_columns_before_its_opaque_backdrop(
        self, run: Run, assets: Path, tmp_path: Path
    ) -> None:
        away, half, output = 2000.0, 12.0, tmp_path / "rows.npz"
        view = ("--eye", f"0,0,{away:g}", "--target", "0,0,0", "--fov", repr(2 * math.degrees(math.atan(half / away))))
        model = assets / "gltf" / "AttenuationTest.glb"
        assert run("render", model, "-o", output, "--size", "240x240", "--samples", "1", *view).code == 0
        with np.load(output) as arrays:
            transmittance, valid = arrays["transmittance"], arrays["valid"]
        assert valid.all()
        for x, metres in {-3.5: 0.25, -2.0: 0.5, 0.0: 1.0, 2.5: 1.5, 6.0: 2.0}.items():
            column = [transmittance[int((half - y) * 10), int((half + x) * 10)] for y in (6, 3, 0, -3, -6)]
            # Rays are off the axis by 9 / 2000 at most, and so the longest path by 2 m * 1e-5; or by float32.
            np.testing.assert_allclose(column, [np.power([0.1, 0.5, 0.9], metres)] * 5, rtol=5e-5)

    @pytest.mark.parametrize("eye", [("--eye", "9,0,0"), ()], ids=["given", "framed"])
    def test_up_turns_the_picture(self, run: Run, tmp_path: Path, eye: tuple[str, ...]) -> None:
        model = tmp_path / "slab.ply"
        trimesh.creation.box((1, 1, 9)).export(model)
        slender = []
        for i, up in enumerate(("0,1,0", "0,0,1")):
            output = tmp_path / f"{i}.npz"
            run("render", model, "-o", output, "--size", "48x48", "--samples", "1", *eye, "--up", up)
            with np.load(output) as arrays:
                covered = arrays["coverage"]
            slender.append(covered.any(axis=1).sum() / covered.any(axis=0).sum())
        assert slender[1] > 2 * slender[0]

    def test_render_replaces_an_existing_file(self, run: Run, cube: Path, tmp_path: Path) -> None:
        output = tmp_path / "cube.png"
        output.write_bytes(b"old")
        assert run("render", cube, "-o", output, "--size", "4x4").code == 0
        assert output.read_bytes().startswith(b"\x89PNG")
        assert sorted(path.name for path in tmp_path.iterdir()) == ["cube.ply", "cube.png"]

    def test_a_frame_that_opengl_cannot_hold_fails_at_run_time(self, run: Run, cube: Path, tmp_path: Path) -> None:
        result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "1000000x1")
        assert result.code == 1
        assert "1000000" in one_error_line(result)
        assert not (tmp_path / "cube.png").exists()

    def test_doctor_tells_the_backend(self, run: Run) -> None:
        result = run("doctor")
        assert (result.code, result.err) == (0, "")
        assert re.search(r"^Rendering uses (egl|osmesa)\.$", result.out, re.MULTILINE)
        assert "numpy" in result.out

    def test_doctor_as_json(self, run: Run) -> None:
        result = run("doctor", "--json")
        told = strict_json(result.out)
        assert (result.code, result.err) == (0, "")
        assert told["backends"][told["backend"]]["works"] is True
        assert set(told["backends"]) == {"egl", "window", "osmesa", "cpu"}


# No OpenGL


@pytest.mark.filterwarnings("default::translucent.errors.TranslucentWarning")
def test_without_opengl_render_works_on_the_cpu_and_says_so(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None
) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "4x4", "--json")
    assert result.code == 0
    (line,) = result.err.splitlines()
    assert line.startswith("warning: rendering on the CPU, for want of OpenGL: OpenGL 3.3 context; none; tried egl: no")
    assert "`translucent doctor` explains this machine" in line
    assert strict_json(result.out)["provenance"]["backend"] == "cpu"
    assert (tmp_path / "cube.png").exists()


def test_without_opengl_and_embree_render_fails_in_one_line_that_says_what_to_do(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None, no_embree: None
) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "4x4")
    assert result.code == 1
    line = one_error_line(result)
    assert "OpenGL 3.3 context; none; tried egl: no such library; osmesa: no such library; apt-get install" in line
    assert not (tmp_path / "cube.png").exists()


def test_a_backend_that_was_asked_for_is_not_replaced(run: Run, cube: Path, tmp_path: Path, no_opengl: None) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "4x4", "--backend", "egl")
    assert result.code == 1
    assert "tried egl: no such library" in one_error_line(result)


def test_without_opengl_doctor_says_so(run: Run, no_opengl: None) -> None:
    result = run("doctor")
    assert (result.code, result.err) == (0, "")
    assert "OpenGL egl: no: no such library" in result.out
    assert "No OpenGL 3.3 without a window: apt-get install" in result.out
    assert "Rendering uses cpu." in result.out


def test_without_opengl_and_embree_doctor_fails(run: Run, no_opengl: None, no_embree: None) -> None:
    result = run("doctor")
    assert result.code == 1
    assert result.err.splitlines() == ["error: rendering; neither OpenGL nor Embree works; see the lines above"]


def test_without_opengl_doctor_prints_one_json_object(run: Run, no_opengl: None, no_embree: None) -> None:
    result = run("doctor", "--json")
    assert result.code == 1
    assert strict_json(result.out)["backend"] is None


def test_a_body_too_large_for_its_medium_is_said_to_be_black(run: Run, tmp_path: Path) -> None:
    """A model in millimetres taken for metres is the usual reason, and its picture shows nothing of it."""
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.stl")
    command = [
        "render",
        str(tmp_path / "ball.stl"),
        "-o",
        str(tmp_path / "a.png"),
        "--size",
        "160x160",
        "--preset",
        "jade",
    ]
    result = run(*command)
    assert result.code == 0
    assert result.err.startswith("warning: only 0.")
    assert "check --unit, or take a longer --distance" in result.err
    assert run(*command, "--unit", "cm").err == ""
