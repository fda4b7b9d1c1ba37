"""Frames on disk, complete or not at all; errors on masks by hand."""

from __future__ import annotations

import dataclasses
import json
import re
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.files.paths import write_atomically
from translucent.frames.frame import ARRAYS, Frame
from translucent.frames.metrics import interior
from translucent.frames.writing import check_output
from translucent.geometry.solids import Box
from translucent.planning.passes import PassName, PassSpec
from translucent.planning.render_plan import RenderPlan

SCENE = tl.Scene([tl.Object(Box().tessellate())], tl.Camera.look_at((0, 0, 5), (0, 0, 0)))
PLAN = RenderPlan(SCENE, tl.SignedDepth(), (PassSpec(PassName.SIGNED_DEPTH, "a test", (0,), 1),))
#: 2 rows of 3 pixels, all numbers different.
RADIANCE = np.linspace(0, 1.7, 18, dtype=np.float32).reshape(2, 3, 3)


def frame(**changes: Any) -> Frame:
    made = Frame(
        radiance=RADIANCE,
        transmittance=RADIANCE / 2,
        optical_depth=RADIANCE * 3,
        thickness=np.arange(6, dtype=np.float32).reshape(2, 3),
        coverage=np.array([[False, True, True], [True, True, True]]),
        valid=np.array([[True, True, True], [True, True, False]]),
        plan=PLAN,
        seconds={"signed_depth": 0.5, "total": 1.0},
        provenance={"backend": "none"},
    )
    return dataclasses.replace(made, **changes)


# Files


def test_npz_holds_every_array_under_its_name(tmp_path: Path) -> None:
    frame().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        assert sorted(arrays) == sorted(ARRAYS)
        for name in ARRAYS:
            assert arrays[name].dtype == getattr(frame(), name).dtype
            assert np.array_equal(arrays[name], getattr(frame(), name))


def test_exr_holds_every_quantity_in_float(tmp_path: Path) -> None:
    import OpenEXR

    frame().save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        assert "linear Rec.709" in str(file.header()["comments"])
    assert channels["thickness.Z"].dtype == np.float32
    assert np.array_equal(channels["thickness.Z"], frame().thickness)
    for i, channel in enumerate("RGB"):
        assert np.array_equal(channels[channel], RADIANCE[..., i])
        assert np.array_equal(channels[f"transmittance.{channel}"], RADIANCE[..., i] / 2)
        assert np.array_equal(channels[f"optical_depth.{channel}"], RADIANCE[..., i] * 3)
    for name in ("coverage", "valid"):
        assert np.array_equal(channels[f"{name}.A"], getattr(frame(), name))


def test_png_is_the_srgb_picture_with_its_top_row_first(tmp_path: Path) -> None:
    frame().save(tmp_path / "a.PNG")
    with Image.open(tmp_path / "a.PNG") as picture:
        assert picture.format == "PNG"
        assert np.array_equal(np.asarray(picture), frame().to_srgb8())


@pytest.mark.parametrize(
    ("radiance", "exposure", "byte"),
    [(0.0, 0, 0), (1.0, 0, 255), (7.0, 0, 255), (-1.0, 0, 0), (0.2158605, 0, 128), (0.2158605 / 4, 2, 128)],
)
def test_a_byte_is_the_exposed_clamped_and_encoded_radiance(radiance: float, exposure: float, byte: int) -> None:
    picture = frame(radiance=np.full((2, 3, 3), radiance)).to_srgb8(exposure)
    assert picture.dtype == np.uint8
    assert (picture == byte).all()


def test_a_notebook_shows_the_picture() -> None:
    assert frame()._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("suffix", [".png", ".exr", ".npz"])
def test_a_saved_file_replaces_the_old_one_and_leaves_nothing_beside_it(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")
    frame().save(str(path))
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_size > 50
    # Like any new file, and not private as temporary files are.
    other = tmp_path / "other"
    other.touch()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(other.stat().st_mode)


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), RuntimeError("bug"), KeyboardInterrupt()])
def test_a_failing_write_leaves_the_old_file_and_no_other(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"precious")

    def fail(temporary: Path) -> None:
        assert temporary.parent == path.parent  # a rename across disks is no rename
        temporary.write_bytes(b"half a fi")
        raise error

    expected = tl.RenderError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected) as caught:
        write_atomically(path, fail)
    if expected is tl.RenderError:
        assert (
            str(caught.value)
            == f"output {str(path)!r}; the file cannot be written (No space left on device); check the disk"
        )
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_frame_that_cannot_be_encoded_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "a.npz"
    frame().save(path)
    before = path.read_bytes()
    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(tl.RenderError, match="No space left on device"):
        frame(thickness=np.zeros((2, 3))).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_takes_no_files_is_a_run_time_error() -> None:
    # A file system without files, so that even root cannot write.
    folder = Path("/proc")
    if not (folder / "self").exists():
        pytest.skip("no /proc, the only folder that refuses root, on this system")
    with pytest.raises(tl.RenderError, match=re.escape("output '/proc/a.png'; the file cannot be written (")):
        frame().save(folder / "a.png")
    with pytest.raises(tl.RenderError, match="cannot be written"):  # before anything is drawn
        check_output(folder / "a.png")


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.png.bak", ".png"])
def test_an_unknown_suffix_names_the_known_ones(tmp_path: Path, name: str) -> None:
    with pytest.raises(tl.InputError, match=r"suffix '.*'; use \.png, \.exr or \.npz"):
        frame().save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match=r"the folder .* does not exist; create the folder first"):
        check_output(tmp_path / "missing" / "a.png")


def test_exr_without_its_package_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with pytest.raises(tl.RenderError, match=r"pip install 'translucent-shading\[exr\]'"):
        check_output(tmp_path / "a.exr")


def test_the_summary_counts_pixels_and_goes_into_json() -> None:
    told = json.loads(json.dumps(frame().summary()))
    assert told["size"] == [3, 2]
    assert (told["covered_pixels"], told["invalid_pixels"]) == (5, 1)
    # Covered and valid: 1, 2, 3, 4.
    assert told["thickness"] == {"median": 2.5, "max": 4.0}
    nothing = frame(coverage=np.zeros((2, 3), dtype=bool)).summary()
    assert nothing["thickness"] is None


# Errors


def test_errors_of_a_hand_made_difference() -> None:
    # Covered and valid in both: 1, 2, 3, 4; errors +1, -2, 0, +3.
    off = frame().thickness + np.array([[50, 1, -2], [0, 3, 90]], dtype=np.float32)
    errors = tl.compare(frame(thickness=off), frame())
    assert errors.pixels == 4
    assert (errors.max, errors.median) == (3.0, 1.5)
    assert errors.bias == pytest.approx(0.5, rel=1e-15)
    assert errors.rms == pytest.approx(np.sqrt(14 / 4), rel=1e-15)
    # Sorted 0, 1, 2, 3: a quantile q is at position 3 q.
    assert errors.p99 == pytest.approx(2 + (3 * 0.99 - 2), rel=1e-14)
    assert errors.p999 == pytest.approx(2 + (3 * 0.999 - 2), rel=1e-14)
    assert errors.invalid == pytest.approx(1 / 5)
    assert errors.coverage_mismatch == 0.0
    assert errors.mask == "covered and valid in both"
    assert "max 3" in str(errors)
    assert "4 pixels" in str(errors)


def test_a_frame_is_no_distance_from_itself() -> None:
    errors = tl.compare(frame(), frame(), "radiance")
    assert (errors.rms, errors.max, errors.bias, errors.coverage_mismatch) == (0, 0, 0, 0)


def test_channels_count_each() -> None:
    brighter = frame(radiance=RADIANCE + np.array([0, 0, 3], dtype=np.float32))
    # float32 sums below 5 round by 2.4e-7.
    assert tl.compare(brighter, frame(), "radiance").rms == pytest.approx(np.sqrt(3), abs=5e-7)
    assert tl.compare(brighter, frame(), "radiance").bias == pytest.approx(1.0, abs=5e-7)


def test_pixels_that_one_frame_covers_and_the_other_does_not_are_counted_apart() -> None:
    less = frame(coverage=np.array([[True, True, False], [True, True, True]]))
    errors = tl.compare(less, frame())
    # Two pixels differ, of six that either covers; three are left to compare.
    assert errors.coverage_mismatch == pytest.approx(2 / 6)
    assert errors.pixels == 3


def test_a_mask_narrows_the_comparison() -> None:
    mask = np.array([[True, True, False], [False, False, False]])
    off = frame(thickness=frame().thickness * 2)
    errors = tl.compare(off, frame(), mask=mask)
    assert (errors.pixels, errors.max) == (1, 1.0)
    assert errors.mask == "covered and valid in both, and inside the mask"


def test_what_cannot_be_compared_is_refused() -> None:
    small = frame(thickness=np.zeros((1, 3)))
    with pytest.raises(
        tl.InputError,
        match=re.escape(
            "compare; the frame has size (3, 1), and the truth has size (3, 2); render both at the same size"
        ),
    ):
        tl.compare(small, frame())
    with pytest.raises(tl.InputError, match="compare; no pixel is covered and valid in both"):
        tl.compare(frame(valid=np.zeros((2, 3), dtype=bool)), frame())


def test_the_interior_is_away_from_every_change_of_hit_count() -> None:
    counts = np.full((6, 7), 2)
    counts[2, 3] = 4
    expected = np.ones((6, 7), dtype=bool)
    expected[1:4, 2:5] = False
    assert np.array_equal(interior(counts), expected)
    assert interior(np.full((1, 1), 2)).all()
