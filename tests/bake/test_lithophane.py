"""Lithophanes: the relief has the thickness that the tone mapping asks for, is closed, and shows the picture."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.bake import lithophane as module
from translucent.formulas.color import srgb_to_linear
from translucent.media.conversion import extinction_of_td

THIN, THICK, TD = 0.0006, 0.003, 0.004


@pytest.fixture(autouse=True)
def same_renderer(monkeypatch: pytest.MonkeyPatch, renderer: tl.Renderer) -> None:
    monkeypatch.setattr(module, "Renderer", lambda: nullcontext(renderer))


def test_the_thickness_is_what_the_tone_mapping_asks_for() -> None:
    picture = np.zeros((20, 30, 3))
    picture[:, 10:20], picture[:10, 20:] = 0.25, 1.0  # black, gray, and white over black
    made = tl.lithophane(picture, tl.Medium(absorption=extinction_of_td(TD)), (THIN, THICK), 0.029, 0.001)
    assert made.thickness.shape == (20, 30)
    assert made.thickness[15, [0, 29]] == pytest.approx(THICK, rel=1e-6)
    assert made.thickness[5, 29] == pytest.approx(THIN, rel=1e-6)
    passed = 10 ** (-np.array([THIN, made.thickness[5, 15], THICK]) / TD)  # the definition of TD
    assert made.contrast == pytest.approx(passed[0] / passed[2])
    assert passed[1] == pytest.approx(passed[2] + 0.25 * (passed[0] - passed[2]), rel=1e-6)
    x, y, z = made.mesh.vertices.T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((-0.0145, 0.0145, -0.0095, 0.0095))
    assert z[(x > 0.01) & (y > 0.005)].max() == pytest.approx(THIN, rel=1e-6)  # top right, as in the picture


def test_the_relief_is_closed_and_shows_the_picture() -> None:
    y, x = np.mgrid[0:40, 0:60] / 60
    smooth = np.repeat((0.5 + 0.4 * np.sin(9 * x) * np.cos(7 * y))[..., None], 3, axis=-1)
    red = tl.Medium.from_color((0.8, 0.2, 0.1), 0.002)
    for medium in (tl.Medium(absorption=extinction_of_td(TD)), red):
        made = tl.lithophane(smooth, medium, (THIN, THICK), 0.06, 0.001)
        assert str(made.mesh.diagnosis) == "closed, 1 component"
        assert np.abs(made.shown @ (0.2126, 0.7152, 0.0722) - made.target).max() < 0.01
        assert made.rms < 0.003
    assert tl.lithophane(np.round(smooth), red, (THIN, THICK), 0.06, 0.001).rms > made.rms  # facets cannot follow


def test_the_command_writes_what_slicers_read(run: Run, tmp_path: Path) -> None:
    encoded = np.linspace(0, 255, 40, dtype=np.uint8)[None].repeat(20, axis=0)
    Image.fromarray(encoded).save(tmp_path / "photo.png")
    out = tmp_path / "relief.stl"
    size = ("--width", "3.9cm", "--pitch", "1", "--thickness", "0.5..2.5")
    how = ("lithophane", tmp_path / "photo.png", "-o", out, *size)
    result = run(*how, "--td", "3", "--check", "--json")
    assert (result.code, result.err) == (0, "")
    told = json.loads(result.out)
    assert told["size_mm"] == pytest.approx([39, 20, 2.5], rel=1e-5)
    assert told["contrast"] == pytest.approx(10 ** (2 / 3))
    assert told["rms"] < 0.01
    mesh = tl.load_mesh(out, unit="mm")
    assert str(mesh.diagnosis) == "closed, 1 component"
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.039, 0.020, 0.0025], rel=1e-5)
    seen = srgb_to_linear(np.asarray(Image.open(f"{out}.check.png"), dtype=np.float64) / 255)
    assert seen.shape[1] == 2 * 39
    seen = seen[-20:]  # below the captions
    assert seen[:, :39] == pytest.approx(seen[:, 39:], abs=0.02)
    words = run(*how, "--color", "#7b1e3a", "--distance", "2mm").out
    assert "in front of a uniform white light" in words
    assert (
        "no medium is given; choose the material with --td, with --color and --distance, or with --preset"
        in one_error_line(run(*how))
    )
    assert "--td and a medium are both given" in one_error_line(run(*how, "--td", "3", "--preset", "amber"))
    assert "needs two lengths; write for example" in one_error_line(run(*how, "--td", "3", "--thickness", "3"))


@pytest.mark.parametrize(
    ("medium", "thickness", "width", "pitch", "message"),
    [
        (tl.Medium(1.0, 9.0), (THIN, THICK), 0.1, 0.001, "the medium scatters"),
        (
            tl.Medium(),
            (THIN, THICK),
            0.1,
            0.001,
            "100 % of light passes 0.6 mm, 100 % of light passes 3 mm; change the thickness",
        ),
        (tl.Medium(1e6), (THIN, THICK), 0.1, 0.001, "0 % of light passes 3 mm; change the thickness"),
        (
            tl.Medium(500.0),
            (THICK, THIN),
            0.1,
            0.001,
            "3 mm to 0.6 mm thick, 100 mm wide, with a point every 1 mm; use 0 < smallest < largest",
        ),
        (tl.Medium(500.0), (THIN, THICK), 0.1, 0.1, "a width of two points or more"),
        (tl.Medium(500.0), (THIN, THICK), 1.0, 1e-5, "use a larger --pitch: at most 4000000 points are allowed"),
    ],
)
def test_what_cannot_be_printed_is_refused(
    medium: tl.Medium, thickness: tuple[float, float], width: float, pitch: float, message: str
) -> None:
    with pytest.raises(tl.InputError, match=message):
        tl.lithophane(np.full((8, 8, 3), 0.5), medium, thickness, width, pitch)


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    made = tl.lithophane(np.full((4, 4, 3), 0.5), tl.Medium(500.0), pitch=0.02)
    with pytest.raises(tl.InputError, match=r"give a \.stl file"):
        made.save(tmp_path / "relief.obj")
