"""Pictures of quantities: colors that order, scales with round numbers, and files that appear."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.formulas.color import luminance, srgb_to_linear
from translucent.frames.aovs import (
    EMPTY,
    SEEN,
    WRONG,
    aov_pictures,
    false_colors,
    marks,
)
from translucent.frames.frame import Frame


def frame(scale: float = 1e-3, height: int = 40, width: int = 60) -> Frame:
    thickness = np.tile(np.linspace(0, 10, width), (height, 1)) * scale
    valid = np.ones((height, width), dtype=bool)
    valid[:5, :5] = False
    coverage = (thickness > 0) | ~valid
    shape = (height, width, 3)
    passed = np.exp(-thickness / scale / 5)[..., None] * np.ones(3)
    plan = tl.plan(tl.showcase(tl.load_mesh(Path(tl.__file__).parents[1] / "meshes" / "bear.ply"), stage="none"))
    return Frame(passed, passed, np.zeros(shape), thickness, coverage, valid, plan)


def test_colors_get_lighter_and_are_all_different() -> None:
    colors = false_colors()
    assert (np.diff(luminance(srgb_to_linear(colors / 255.0))) > 0).all()
    assert len(np.unique(colors, axis=0)) == 256
    # Steps look alike: none is more than twice the median, as sums over the channels.
    steps = np.abs(np.diff(colors.astype(int), axis=0)).sum(axis=1)
    assert steps.max() <= 2 * np.median(steps) + 3


@pytest.mark.parametrize(
    ("most", "exact"),
    [
        (10.0, [0, 2, 4, 6, 8, 10]),
        (1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (27.3, [0, 5, 10, 15, 20, 25]),
        (999.0, [0, 200, 400, 600, 800]),
        (3.1, [0, 1, 2, 3]),
    ],
)
def test_marks_are_round_numbers(most: float, exact: list[float]) -> None:
    assert marks(most) == pytest.approx(exact)


def test_thickness_runs_from_the_darkest_to_the_lightest_color() -> None:
    made = frame()
    pixels = aov_pictures(made.arrays)["thickness"]
    assert pixels.shape[0] > 40
    assert pixels.shape[1:] == (60, 3)
    assert pixels[20, 0].tolist() == list(EMPTY)
    assert pixels[2, 2].tolist() == list(WRONG)
    np.testing.assert_array_equal(pixels[20, 59], false_colors()[255])
    np.testing.assert_array_equal(pixels[20, 30], false_colors()[round(255 * 30 / 59)])


@pytest.mark.parametrize("scale", [1e-30, 1e-7, 1e-3, 1.0, 1e5, 1e17])
@pytest.mark.parametrize("size", [(1, 1), (3, 8), (9, 700)])
def test_any_size_and_scale_has_a_picture(scale: float, size: tuple[int, int]) -> None:
    pictures = aov_pictures(frame(scale, *size).arrays)
    assert all(picture.dtype == np.uint8 and picture.shape[1:] == (size[1], 3) for picture in pictures.values())


def test_a_frame_without_a_medium_says_so() -> None:
    made = frame()
    nothing = dataclasses.replace(
        made, thickness=np.zeros((40, 60)), coverage=np.zeros((40, 60), bool), valid=np.ones((40, 60), bool)
    )
    assert (aov_pictures(nothing.arrays)["thickness"][:40] == EMPTY).all()


def test_validity_has_a_color_for_each_case() -> None:
    pixels = aov_pictures(frame().arrays)["validity"]
    assert [pixels[2, 2].tolist(), pixels[20, 0].tolist(), pixels[20, 30].tolist()] == [
        list(WRONG),
        list(EMPTY),
        list(SEEN),
    ]


def test_they_are_saved_into_a_folder(tmp_path: Path) -> None:
    made = frame()
    files = made.save_aovs(tmp_path / "new" / "folder")
    assert [file.name for file in files] == ["thickness.png", "transmittance.png", "validity.png"]
    for file in files:
        with Image.open(file) as picture:
            np.testing.assert_array_equal(np.asarray(picture), aov_pictures(made.arrays)[file.stem])
    assert {file.name for file in (tmp_path / "new" / "folder").iterdir()} == {file.name for file in files}
    (tmp_path / "taken").write_text("")
    with pytest.raises(tl.InputError, match=r"folder .*taken'; '.*taken' is not a folder; choose another path$"):
        made.save_aovs(tmp_path / "taken")


def test_pictures_are_exposed_and_toned(tmp_path: Path) -> None:
    made = frame()
    made.save(tmp_path / "a.png", exposure=-1.0, tone="neutral")
    with Image.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), made.to_srgb8(-1.0, "neutral"))
    assert made.to_srgb8(1.0).astype(int).sum() > made.to_srgb8().astype(int).sum()
    assert not np.array_equal(made.to_srgb8(0.0, "agx"), made.to_srgb8())
    with pytest.raises(tl.InputError, match="tone 'filmic'"):
        made.save(tmp_path / "b.png", tone="filmic")
    with pytest.raises(tl.InputError, match="exposure nan; the exposure must lie within 100 stops"):
        made.save(tmp_path / "b.png", exposure=float("nan"))
    assert not (tmp_path / "b.png").exists()
