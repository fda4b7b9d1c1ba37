"""``translucent render``: environments, brightness, turntables, and pictures of quantities."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.commands.options import LookOptions
from translucent.scene.showcase import LIGHT_TABLE

pytestmark = pytest.mark.usefixtures("few_shadows", "one_renderer")

SMALL = ("--size", "32x24", "--samples", "1")


@pytest.fixture
def panorama(tmp_path: Path) -> Path:
    path = tmp_path / "sky.png"
    Image.fromarray(np.full((8, 16, 3), 188, dtype=np.uint8)).save(path)
    return path


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture).astype(int)


def test_environments_have_names_colors_and_files(panorama: Path) -> None:
    assert LookOptions().lighting() is None
    assert LookOptions(environment="light-table").lighting() is LIGHT_TABLE
    studio = LookOptions(environment="studio,-30.5").lighting()
    assert studio is not None
    assert (studio.kind, studio.rotation) == ("image", -30.5)
    image = LookOptions(environment=f"{panorama},90").lighting()
    assert image is not None
    assert (image.kind, image.rotation) == ("image", 90.0)
    color = LookOptions(environment="linear(1,0.5,0.25)").lighting()
    assert color is not None
    assert (color.kind, color.first.tolist()) == ("constant", [1.0, 0.5, 0.25])
    both = LookOptions(environment="studio", background="checker").lighting()
    assert both is not None
    assert (both.kind, both.seen.kind) == ("image", "checkerboard")
    behind = LookOptions(background="teal").lighting()
    assert behind is not None
    assert behind.lighting(np.array([0.0, 1.0, 0.0])) == pytest.approx(LIGHT_TABLE.second)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--environment", "reddish"],
            "color 'reddish'; the text is neither a hex color, a CSS name, srgb(r,g,b) nor linear(r,g,b)",
        ),
        (
            ["--environment", "studio,left"],
            "environment 'studio,left'; 'left' is not a rotation in degrees; write the rotation as in studio,90",
        ),
        (["--environment", "none.hdr"], "environment 'none.hdr'; no file has this path"),
        (["--environment", "none.exr,30"], "environment 'none.exr'; no file has this path"),
        (["--exposure", "nan"], "exposure nan; the exposure must lie within 100 stops"),
        (["--tone", "filmic"], "Invalid value for '--tone'"),
        (["--turntable", "1"], "Invalid value for '--turntable'"),
        (["--fps", "12"], "--fps 12; this option applies only to --turntable; add --turntable, or omit --fps"),
        (["--turntable", "4", "--fps", "0"], "0.0 pictures per second; the frame rate must lie in 1 to 100"),
        (["--turntable", "4"], "animation 'a.png'; suffix '.png'; use .webp, .gif, .mp4, or a folder"),
        (
            ["--turntable", "4", "--aov", "aovs", "-o", "a.gif"],
            "--turntable 4; --aov writes the quantities of a single picture",
        ),
    ],
)
def test_wrong_options_are_one_line(
    run: Run, options: list[str], message: str, tmp_path: Path, in_tmp_path: Path
) -> None:
    assert message in one_error_line(run("render", "bear", "-o", "a.png", *options))
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("renderer")
class TestRendering:
    """Tests that need OpenGL."""

    def test_a_background_is_seen_and_through_the_model(self, run: Run, tmp_path: Path, panorama: Path) -> None:
        pictures = []
        for i, options in enumerate(
            (["--environment", panorama], ["--environment", "srgb(0.7373,0.7373,0.7373)"], ["--background", panorama])
        ):
            result = run("render", "bear", "-o", tmp_path / f"{i}.png", *SMALL, *options)
            assert (result.code, result.err) == (0, "")
            pictures.append(pixels(tmp_path / f"{i}.png"))
        assert (pictures[0][0, 0] == 188).all()
        # A picture of one color is that color, to a rounding of 8 bits.
        assert np.abs(pictures[1] - pictures[0]).max() <= 1
        assert np.abs(pictures[2] - pictures[0]).max() <= 1
        assert (pictures[0][12, 16] < 188).any()

    def test_exposure_and_tone_change_the_picture_and_not_the_numbers(self, run: Run, tmp_path: Path) -> None:
        light = ("--environment", "linear(0.25,0.25,0.25)")
        for name, options in {"plain": [], "bright": ["--exposure", "1"], "agx": ["--tone", "agx"]}.items():
            assert run("render", "bear", "-o", tmp_path / f"{name}.png", *SMALL, *light, *options).code == 0
            assert run("render", "bear", "-o", tmp_path / f"{name}.npz", *SMALL, *light, *options).code == 0
        corners = {name: int(pixels(tmp_path / f"{name}.png")[0, 0, 0]) for name in ("plain", "bright", "agx")}
        assert (corners["plain"], corners["bright"]) == (137, 188)  # sRGB of 1/4 and 1/2
        assert corners["agx"] not in (137, 188)
        with np.load(tmp_path / "plain.npz") as plain, np.load(tmp_path / "bright.npz") as bright:
            np.testing.assert_array_equal(plain["radiance"], bright["radiance"])

    @pytest.mark.parametrize("name", ["spin.webp", "spin.gif", "frames"])
    def test_a_turntable_shows_the_model_from_all_around(self, run: Run, tmp_path: Path, name: str) -> None:
        result = run("render", "bear", "-o", tmp_path / name, *SMALL, "--stage", "none", "--turntable", "4", "--json")
        assert (result.code, result.err) == (0, "")
        assert json.loads(result.out)["output"] == str(tmp_path / name)
        if name == "frames":
            files = sorted((tmp_path / name).iterdir())
            assert [file.name for file in files] == ["0000.png", "0001.png", "0002.png", "0003.png"]
            views = [pixels(file) for file in files]
        else:
            with Image.open(tmp_path / name) as picture:
                assert picture.n_frames == 4
                views = []
                for i in range(4):
                    picture.seek(i)
                    views.append(np.asarray(picture.convert("RGB")).astype(int))
        assert all(view.shape == (24, 32, 3) for view in views)
        assert all(np.abs(view - other).max() > 20 for view, other in pairwise(views))
        for view in views:  # no side of the frame cuts the model
            edge = np.concatenate([view[0], view[-1], view[:, 0], view[:, -1]])
            assert np.ptp(edge, axis=1).max() < 20

    def test_quantities_are_written_as_pictures(self, run: Run, tmp_path: Path) -> None:
        options = (*SMALL, "--stage", "none", "--aov", tmp_path / "aovs")
        result = run("render", "bear", "-o", tmp_path / "bear.png", *options)
        assert (result.code, result.err) == (0, "")
        names = sorted(file.name for file in (tmp_path / "aovs").iterdir())
        assert names == ["thickness.png", "transmittance.png", "validity.png"]

    def test_the_studio_is_seen_as_in_the_reference(self, tmp_path: Path) -> None:
        mesh = tl.load_mesh(Path(tl.__file__).parents[1] / "meshes" / "bear.ply")
        scene = tl.showcase(mesh, size=(32, 24), environment=tl.Environment.studio(rotation=20))
        with tl.Renderer() as renderer:
            found = renderer.render(scene, (32, 24))
        truth = tl.reference.render(scene, (32, 24))
        same = found.coverage == truth.coverage
        # The texture unit interpolates with 8 bits of a fraction: 1/256 of the step between two pixels of the picture.
        step = np.abs(np.diff(scene.environment.map.pixels, axis=1)).max()
        assert np.abs(found.radiance - truth.radiance)[same].max() <= step / 256 + 1e-3
        assert np.median(np.abs(found.radiance - truth.radiance)) < 1e-4


@pytest.mark.parametrize(("stops", "told"), [(0.0, False), (1.5, True)])
def test_a_white_body_in_bright_light_is_told_with_an_exposure_that_shows_it(
    tmp_path: Path, run: Run, stops: float, told: bool
) -> None:
    """A clear box before an even white of 1, brightened: at once all of it is beyond white, by 1.5 stops."""
    options = ("--color", "white", "--distance", "1m", "--environment", "white", *SMALL, "--exposure", f"{stops}")
    path = tmp_path / "box.png"
    done = run("render", "soap", "-o", str(path), *options)
    assert done.code == 0
    assert ("100% of the pixels of media are brighter than white" in done.err) == told
    if told:
        assert "--exposure -0.5" in done.err
        assert "brighter than white" not in run("render", "soap", "-o", str(path), *options[:-1], "-0.5").err
