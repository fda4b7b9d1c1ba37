"""``translucent render``: what it writes, what it refuses without harm to any file."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import translucent as tl
from tests.apps.models import write_scene
from tests.boxes import GLASS
from tests.command_line import Result, Run, one_error_line, strict_json
from translucent.commands.options import MediumOptions
from translucent.planning.methods import METHODS

pytestmark = pytest.mark.usefixtures("few_shadows", "coarse_light", "one_renderer")

GREEN = "linear(0.18,0.62,0.35)"


def test_help_names_every_method(run: Run) -> None:
    told = "".join(run("render", "--help-all").out.split())  # lines are broken at hyphens, too
    assert [name for name in METHODS if name not in told] == []


@pytest.fixture
def run(run: Run) -> Run:
    """Command line whose models stand on no stage, which takes time: see test_render_stage.py."""

    def floating(*arguments: object) -> Result:
        plain = arguments[0] != "render" or "--help" in arguments or "--stage" in arguments
        return run(*arguments, *(() if plain else ("--stage", "none")))

    return floating


@pytest.fixture
def glass_box(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "scene.glb", {"extensions": GLASS})


@pytest.mark.parametrize("color", ["teal", "ff0000", "#000"])
def test_a_channel_of_0_is_clamped_and_told(run: Run, cube: Path, tmp_path: Path, color: str) -> None:
    options = ["-o", tmp_path / "a.png", "--color", color, "--distance", "10m", "--size", "8x6", "--samples", "1"]
    result = run("render", cube, *options)
    assert result.code == 0
    assert result.err == "warning: channels of the color below 0.0001 were set to 0.0001\n"
    assert "0 is not in 0 < t <= 1" in one_error_line(run("render", cube, *options, "--no-clamp"))


# Bad input


BAD_RENDER_OPTIONS = [
    (["--size", "0x0"], "frame size (0, 0); the size must be two whole numbers above 0"),
    (["--size", "-4x4"], "frame size (-4, 4); the size must be two whole numbers above 0"),
    (["--size", "abc"], "--size 'abc'; the size must be WIDTHxHEIGHT"),
    (["--size", "64"], "--size '64'; the size must be WIDTHxHEIGHT"),
    (["--size", "1.5x2"], "--size '1.5x2'; the size must be WIDTHxHEIGHT"),
    (["--size", "1x2x3"], "--size '1x2x3'; the size must be WIDTHxHEIGHT"),
    (["--color", "linear(0,0.5,0.5)", "--distance", "1cm", "--no-clamp"], "red = 0 is not in 0 < t <= 1"),
    (["--color", "linear(1.1,0.5,0.5)", "--distance", "1cm"], "red = 1.1 is not in 0 < t <= 1"),
    (["--color", "linear(nan,0.5,0.5)", "--distance", "1cm"], "a channel of the color is not a finite number"),
    (
        ["--color", "reddish", "--distance", "1cm"],
        "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
    ),
    (["--color", GREEN, "--distance", "0"], "length '0'; the length must be positive and finite"),
    (["--color", GREEN, "--distance", "-1cm"], "length '-1cm'; the length must be positive and finite"),
    (["--color", GREEN, "--distance", "abc"], "length 'abc'; the text is not a number with a unit"),
    (["--color", GREEN, "--distance", "2 furlong"], "unit 'furlong'; no unit of length has this name"),
    (["--color", GREEN], "--color; --distance is missing; give both"),
    (["--distance", "1cm"], "--distance; --color is missing; give both"),
    (["--preset", "unobtainium"], "preset 'unobtainium'; no preset has this name; use one of marble"),
    (["--preset", "jade", "--color", GREEN], "--preset jade; --color or --distance is given, too"),
    (["--method", "magic"], "method 'magic'; no method has this name; use one of signed-depth"),
    (["--backend", "vulkan"], "backend 'vulkan'; no backend has this name; use one of egl, window, osmesa"),
    (["--unit", "furlong"], "unit 'furlong'; no unit of length has this name"),
    (
        ["--background", "reddish"],
        "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
    ),
    (
        ["--environment", "studoi"],
        "environment 'studoi'; not a color, not a picture, and none of light-table, studio, checkerboard",
    ),
    (["--environment", "studoi,90"], "did you mean studio?"),
    (["--background", "Light"], "did you mean light-table?"),
    (["--eye", "1,2"], "--eye '1,2'; the value is not three numbers"),
    (["--eye", "a,b,c"], "--eye 'a,b,c'; the value is not three numbers"),
    (["--eye", "nan,0,0"], "camera eye, target or up; each of them must be three finite numbers"),
    (["--eye", "0,0,0"], "eye and target are at the same point (0.0, 0.0, 0.0)"),
    (["--eye", "0,5,0"], "is parallel to the view direction; choose another up"),
    (["--eye", "1e200,0,0"], "camera eye, target or up; a coordinate is beyond 1e+18"),
    (["--up", "0,0,0"], "the up direction (0.0, 0.0, 0.0)"),
    (["--up", "0,0,0", "--stage", "none"], "the up direction (0.0, 0.0, 0.0) is parallel to the view direction"),
    (["--up", "up"], "--up 'up'; the value is not three numbers"),
    (["--fov", "1e-300"], "camera eye, target or up; a coordinate is beyond 1e+18"),
    (["--target", "0,0,0"], "--target; --target works only together with --eye"),
    (["--fov", "0", "--eye", "0,0,5"], "camera fov_y 0.0; the angle must lie between 0 and 180 degrees"),
    (["--fov", "180"], "camera fov_y 180.0; the angle must lie between 0 and 180 degrees"),
    (["--fov", "nan"], "camera fov_y nan; the angle must lie between 0 and 180 degrees"),
    (["--fov", "wide"], "Invalid value for '--fov'"),
    (["--samples", "0"], "samples 0; the number of samples must be a whole number"),
    (["--samples", "some"], "Invalid value for '--samples'"),
    (["--camera", "0"], "cube.ply is not a glTF file, so it has no cameras; use --eye"),
    (["--camera", "first"], "Invalid value for '--camera'"),
    (
        ["--interfaces", "front", "--opaque-with", "pyrender"],
        "--interfaces front; not possible with --opaque-with: it needs interfaces in screen space",
    ),
    (["--interfaces", "both"], "Invalid value for '--interfaces': 'both' is not one of 'traced', 'screen', 'front'"),
    (
        ["--interface-depth", "3"],
        "--interface-depth; this option applies only to --interfaces traced; add --interfaces traced",
    ),
    (
        ["--interfaces", "traced", "--interface-forks", "9"],
        "TracedInterfaces forks 9; the value must be a whole number in 0 to 4",
    ),
    (["--scattering", "many"], "Invalid value for '--scattering': 'many' is not one of 'diffusion', 'layer', 'single'"),
    (
        ["--diffusion-resolution", "9"],
        "--diffusion-resolution; this option applies only to --scattering diffusion; add --scattering",
    ),
    (["--scattering", "layer", "--diffusion-resolution", "9"], "this option applies only to --scattering diffusion"),
    (
        ["--scattering", "diffusion", "--diffusion-resolution", "4"],
        "Diffusion resolution 4; the value must be a whole number in 8",
    ),
    (
        ["--scattering", "diffusion", "--diffusion-resolution", "999"],
        "Diffusion resolution 999; at this resolution, a body would have",
    ),
    (["--scattering-color", "white"], "--scattering-color; --mean-free-path is missing; give both"),
    (["--mean-free-path", "1mm"], "--mean-free-path; --scattering-color is missing; give both"),
    (
        ["--scattering-color", "white", "--color", GREEN],
        "--scattering-color; --color is given, too, and both options define a medium; give only one of the two",
    ),
    (
        ["--mean-free-path", "1mm", "--preset", "jade"],
        "--mean-free-path; --preset is given, too, and both options define a medium; give only one of the two",
    ),
    (
        ["--scattering-color", "white", "--mean-free-path", "0mm"],
        "length '0mm'; the length must be positive and finite",
    ),
    (
        ["--scattering-color", "reddish", "--mean-free-path", "1mm"],
        "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
    ),
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
        assert message in one_error_line(result)
    assert existing.read_bytes() == b"precious"
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "out.png",
            ["--size", "200000x200000"],
            "40000 million pixels are more than the limit of 1074 million; choose a smaller picture size",
        ),
        (
            "out.npz",
            ["--size", "8192x2048"],
            "17 million pixels at once need about 1.56 GiB of memory, but only 954 MiB are f",
        ),
        ("out.gif", ["--size", "8192x2048", "--turntable", "4"], "are free; give a smaller size"),
    ],
)
def test_a_size_is_refused_that_nobody_waits_for_or_memory_holds(
    run: Run, cube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, options: list[str], message: str
) -> None:
    monkeypatch.setattr("translucent.files.reading.free_memory", lambda: 10**9)
    assert message in one_error_line(run("render", cube, "-o", tmp_path / name, *options))
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("placed", [("--eye", "0,0,9"), ("--target", "0,0,0"), ("--up", "0,1,0"), ("--fov", "30")])
def test_a_camera_of_the_file_excludes_one_that_options_place(
    run: Run, glass_box: Path, tmp_path: Path, placed: tuple[str, str]
) -> None:
    result = run("render", glass_box, "-o", tmp_path / "out.png", "--camera", "0", *placed)
    assert f"--camera 0; --camera cannot be combined with {placed[0]}; use one" in one_error_line(result)


@pytest.mark.parametrize("number", ["2", "-1"])
def test_a_camera_that_is_not_there_is_refused_with_those_that_are(
    run: Run, glass_box: Path, tmp_path: Path, number: str
) -> None:
    result = run("render", glass_box, "-o", tmp_path / "out.png", "--camera", number)
    assert "the file has 0 of node 'Front', 1 of node 'Side'; use one of these camera numbers" in one_error_line(result)


@pytest.mark.parametrize(
    ("output", "code", "message"),
    [
        ("picture.bmp", 2, "suffix '.bmp'; use .png, .exr or .npz"),
        ("picture", 2, "suffix ''; use .png, .exr or .npz"),
        ("missing/picture.png", 2, "; create the folder first"),
        ("cube.ply/picture.png", 2, "cube.ply' is not a folder; choose another path"),
        ("folder.png", 2, "folder.png'; a folder of this name already exists; choose another name"),
        (f"{'long' * 100}/picture.png", 2, "; create the folder first"),
    ],
)
def test_a_bad_output_is_refused_before_any_work(
    run: Run, cube: Path, tmp_path: Path, no_opengl: None, output: str, code: int, message: str
) -> None:
    (tmp_path / "folder.png").mkdir()
    before = sorted(tmp_path.iterdir())
    result = run("render", cube, "-o", tmp_path / output)
    assert message in one_error_line(result, code)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("output", "option"),
    [("a.png", ("--aov", "taken/below")), ("taken", ("--turntable", "4")), ("taken/below", ("--turntable", "4"))],
)
def test_a_file_where_a_folder_has_to_be_is_found_before_any_work(
    run: Run, cube: Path, tmp_path: Path, in_tmp_path: Path, no_opengl: None, output: str, option: Any
) -> None:
    Path("taken").write_text("kept")
    result = run("render", cube, "-o", output, *option)
    assert one_error_line(result).endswith("'taken' is not a folder; choose another path")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cube.ply", "taken"]
    assert Path("taken").read_text() == "kept"


# Good runs


@pytest.mark.usefixtures("renderer")
class TestRendering:
    """Tests that need OpenGL."""

    # Straight on, from 10 m: the middle ray of a frame of odd size crosses the unit cube along its axis.
    VIEW = ("--eye", "0,0,10", "--target", "0,0,0", "--fov", "20", "--size", "9x5", "--samples", "1")

    def test_render_writes_the_exact_thickness_and_color(self, run: Run, cube: Path, tmp_path: Path) -> None:
        output = tmp_path / "cube.npz"
        medium = ("--color", "linear(0.25,0.5,1)", "--distance", "0.5m", "--ior", "1")
        medium += ("--background", "linear(1,0.5,0.25)")
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

    def test_render_bends_rays_at_one_interface_or_both(self, run: Run, tmp_path: Path) -> None:
        glass = {"extensions": GLASS | {"KHR_materials_ior": {"ior": 1.5}}}
        model, frames = write_scene(tmp_path / "scene.glb", glass), {}
        for interfaces in ("screen", "front"):
            output = tmp_path / f"{interfaces}.npz"
            few = ("--size", "9x5", "--samples", "1", "--verbose")
            result = run("render", model, "-o", output, *few, "--interfaces", interfaces)
            assert (result.code, result.err) == (0, "")
            assert ("rays refract only where they enter a body" in result.out) == (interfaces == "front")
            with np.load(output) as arrays:
                frames[interfaces] = arrays["radiance"], arrays["thickness"]
        assert (frames["screen"][0] != frames["front"][0]).any()
        assert (frames["screen"][1] == frames["front"][1]).all()

    def test_render_shows_light_scattered_many_times_as_asked_for(self, run: Run, cube: Path, tmp_path: Path) -> None:
        """Most of the light that enters leaves again, but for what is scattered once alone."""
        medium = ("--scattering-color", "linear(0.8,0.6,0.3)", "--mean-free-path", "2cm")
        radiance, told = {}, {}
        for name in (None, "diffusion", "layer", "single"):
            output = tmp_path / f"{name}.npz"
            asked = ("--scattering", name) if name else ()
            asked += ("--diffusion-resolution", "16") if name == "diffusion" else ()
            alone = ("--size", "9x5", "--samples", "1", "--stage", "none", "--verbose")
            result = run("render", cube, "-o", output, *alone, *medium, *asked)
            assert result.code == 0
            told[name] = result.out
            with np.load(output) as arrays:
                radiance[name] = arrays["radiance"][2, 4]
        assert f"multiply scattered light diffuses ({tl.Diffusion()}) in 1 body" in told[None]
        assert "Diffusion(resolution=16)" in told["diffusion"]
        assert "leaves as from flat layers in 1 body" in told["layer"]
        assert "many times" not in told["single"].replace("scattered more than once", "")
        np.testing.assert_allclose(radiance["diffusion"], radiance[None], rtol=0.1)
        for name in ("diffusion", "layer"):
            assert (np.diff(radiance[name]) < 0).all()
            assert (radiance[name] > radiance["single"] + 0.05).all()
        assert (radiance["layer"] != radiance["diffusion"]).all()

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
        result = run("render", glass_box, "-o", output, "--size", "9x5", "--samples", "1", "--verbose", *camera)
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
            result = run("render", model, "-o", output, *self.VIEW, *medium, "--unit", "cm", "-v")
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
            edge = np.concatenate([covered[0], covered[-1], covered[:, 0], covered[:, -1]])
            assert not edge.any()

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
        result = run("render", cube, "-o", tmp_path / "cube.npz", "--size", "1000000x1")
        assert "1000000" in one_error_line(result, code=1)
        assert not (tmp_path / "cube.npz").exists()

    def test_a_frame_wider_than_opengl_draws_comes_in_tiles(self, run: Run, cube: Path, tmp_path: Path) -> None:
        result = run(
            "render", cube, "-o", tmp_path / "wide.png", "--size", "20000x2", "--samples", 1, "--stage", "none"
        )
        assert ": 20000x2, in tiles" in result.out
        with Image.open(tmp_path / "wide.png") as picture:
            assert picture.size == (20000, 2)


def test_a_backend_that_was_asked_for_is_not_replaced(run: Run, cube: Path, tmp_path: Path, no_opengl: None) -> None:
    result = run("render", cube, "-o", tmp_path / "cube.png", "--size", "4x4", "--backend", "egl")
    assert "tried egl: no such library" in one_error_line(result, code=1)


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
        "bottle_glass",
    ]
    result = run(*command)
    assert result.code == 0
    assert result.err.startswith("warning: only 0.")
    assert "the model is 2 x 2 x 2 m" in result.err
    assert "is the file in centimetres? With --unit cm it is 2 x 2 x 2 cm, and " in result.err
    assert result.err.count("\n") == 1
    assert run(*command, "--unit", "cm").err == ""


@pytest.fixture
def tower(tmp_path: Path) -> Path:
    """A figure of 44 x 170 x 15 mm, whose file does not say so."""
    trimesh.creation.box((44, 170, 15)).export(tmp_path / "tower.stl")
    return tmp_path / "tower.stl"


SMALL = ("--size", "64x48", "--samples", "1")


@pytest.mark.parametrize("medium", ["bottle_glass", "merlot", "grape_juice"])  # juice and wine scatter a little, too
def test_what_is_black_hears_what_size_would_suit_the_medium(
    run: Run, tower: Path, tmp_path: Path, medium: str
) -> None:
    command = ["render", tower, "-o", tmp_path / "a.png", "--preset", medium, *SMALL]
    told = run(*command).err
    assert "the model is 44 x 170 x 15 m and " in told
    assert "is the file in millimetres? With --unit mm it is 4.4 x 17 x 1.5 cm, and" in told
    assert run(*command, "--unit", "mm").err == ""


def test_no_unit_is_guessed_where_none_would_help(run: Run, tower: Path, tmp_path: Path) -> None:
    dense = ["--color", "#7b1e3a", "--distance", "0.1mm", *SMALL]
    for model in (["knot"], [tower, "--unit", "mm"]):
        told = run("render", *model, "-o", tmp_path / "a.png", *dense).err
        assert "is the file in" not in told
        assert re.search(r"with --dilute \d+, a fifth of the light would pass", told)


def test_milk_gives_light_back_and_is_not_black(run: Run, tower: Path, tmp_path: Path) -> None:
    told = run("render", tower, "-o", tmp_path / "a.png", "--preset", "whole_milk", *SMALL).err
    assert "of the light passes" not in told


def test_scattering_is_shown_and_not_warned_of(run: Run, tmp_path: Path) -> None:
    assert run("render", "bear", "-o", tmp_path / "a.png", "--preset", "wax", "--roughness", "0", *SMALL).err == ""
    assert run("explain", "bear", "--preset", "marble").err == ""


def test_a_preset_brings_its_roughness_unless_one_is_given(run: Run, tmp_path: Path) -> None:
    command = ["render", "bear", "-o", tmp_path / "a.png", "--verbose", "--preset"]
    rough = "rough interfaces blur the light"
    jade = run(*command, "jade", *SMALL).out
    assert rough in jade
    assert "--denoise" not in jade
    assert rough not in run(*command, "jade", "--roughness", "0", *SMALL).out
    assert "advice: 'bear.ply' is rough and clear" in run(*command, "frosted_glass", *SMALL).out
    assert rough in run("explain", "bear", "--preset", "jade").out
    assert rough not in run("explain", "bear", "--preset", "amber").out
    stone, amber = MediumOptions(preset="jade"), MediumOptions(preset="amber")
    assert [stone.surface_roughness(one) for one in (0.5, 0.0, None)] == [0.5, 0.0, 0.15]
    # A preset that says nothing of surfaces leaves a file's as they are.
    assert (amber.surface_roughness(), MediumOptions().surface_roughness()) == (None, None)


def test_the_answer_comes_first_and_advice_last(run: Run, tmp_path: Path) -> None:
    output = tmp_path / "a.png"
    lines = run("render", "soap", "-o", output, "--preset", "whole_milk", *SMALL).out.splitlines()
    assert lines[0].startswith(f"{output}: 64x48, ")
    assert lines[1] == "size: 9 cm long"
    assert [line.split(": ")[:2] for line in lines[2:]] == [["advice", "'soap.ply'"]]
    told = run("render", "soap", "-o", output, "--color", "white", "--distance", "1", *SMALL)
    assert [line.split(" ")[:2] for line in told.err.splitlines()] == [["note:", "--color"], ["note:", "--distance"]]
    assert "--distance 1 means 1 m; to use another unit, write for example 1cm" in told.err


def test_the_model_is_seen_from_around_and_fills_what_is_requested(run: Run, tmp_path: Path) -> None:
    output, alone = tmp_path / "a.npz", ("--size", "64x64", "--samples", "1", "--stage", "none")
    widths = {}
    for orbit in ("0,0", "90,0"):  # the soap is 9 cm wide, and 6 cm deep
        assert run("render", "soap", "-o", output, *alone, "--orbit", orbit, "--fit", "0.5").code == 0
        with np.load(output) as arrays:
            across = np.flatnonzero(arrays["coverage"].any(axis=0))
            widths[orbit] = across[-1] - across[0] + 1
    assert widths == {orbit: pytest.approx(32, abs=1) for orbit in widths}  # each fills half of the picture
    for wrong, message in (
        (("--orbit", "30"), "not two numbers"),
        (("--orbit", "30,90"), "the pitch must lie between -90 and 90"),
        (("--eye", "0,0,1", "--fit", "0.5"), "this option cannot be combined with --eye"),
    ):
        assert message in one_error_line(run("render", "soap", "-o", output, *wrong))


def test_a_diluted_medium_is_so_many_times_as_clear(run: Run, tmp_path: Path) -> None:
    output, alone = tmp_path / "a.npz", ("--size", "16x12", "--samples", "1", "--stage", "none")
    depths = []
    for dilute in ((), ("--dilute", "5.5")):
        assert run("render", "wine", "-o", output, "--preset", "merlot", *alone, *dilute).code == 0
        with np.load(output) as arrays:
            depths.append(arrays["optical_depth"])
    np.testing.assert_allclose(depths[0], 5.5 * depths[1], rtol=1e-5)
    assert "black" not in run("explain", "wine", "--preset", "merlot", "--dilute", "5.5").out
    assert "--dilute 5.5" in run("explain", "wine", "--preset", "merlot").out
