"""Typical slips, and what their errors say to do instead."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.geometry.solids import Box

BOX = Box((0, 0, 0), (0.1, 0.1, 0.1)).tessellate()


@pytest.mark.parametrize(
    ("slip", "answer"),
    [
        (lambda: tl.Medium.from_color("#7b1e3a", "1cm"), "give the distance in metres: 0.01"),  # type: ignore[arg-type]
        (lambda: tl.Object(BOX, tl.Medium(), sheet_thickness="1mm"), "give metres: 0.001"),  # type: ignore[arg-type]
        (lambda: tl.load_mesh("a.obj", height="12cm"), "give metres: 0.12"),  # type: ignore[arg-type]
        (lambda: tl.Medium.from_color((172, 229, 201), 0.1), "write '#ace5c9' if these are numbers from 0 to 255"),
        (lambda: tl.Medium.from_color((172, 229, 0), 0.1), "write '#ace500' if these are numbers from 0 to 255"),
        (lambda: tl.Medium.from_color("172, 229, 201", 0.1), "write '#ace5c9'"),
        # A color that is merely too bright stays what it is.
        (lambda: tl.Medium.from_color((1.5, 1.0, 1.0), 0.1), "scale the color to at most 1"),
    ],
)
def test_slips_in_python_get_the_answer(slip: Callable[[], object], answer: str) -> None:
    with pytest.raises(tl.InputError) as refused:
        slip()
    assert str(refused.value).endswith(answer)


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (("--color", "#7b1e3a", "--distance", "1", "cm"), "--distance 1 cm; two words; write 1cm"),
        (("--color", "172,229,201", "--distance", "1cm"), "write '#ace5c9'"),
        (("--eye", "1,1,1", "--target", "--transparent"), "the next word is the option --transparent; give --target a"),
    ],
)
def test_slips_on_the_command_line_get_the_answer(
    run: Run, tmp_path: Path, options: tuple[str, ...], answer: str
) -> None:
    assert answer in one_error_line(run("render", "bear", "-o", tmp_path / "a.png", *options))


def test_a_value_that_may_be_left_out_is_none_that_is_missing(run: Run) -> None:
    assert "caustics" in run("explain", "bear", "--caustics", "--stage", "studio").out


def test_a_folder_named_like_a_mesh_of_the_toolkit_hides_it_not(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bear").mkdir()
    monkeypatch.chdir(tmp_path)
    result = run("explain", "bear", "--preset", "merlot")
    assert (result.code, result.err) == (0, "")
    assert "bear.ply" in result.out
