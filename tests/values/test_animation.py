"""Animations: what is written, in order and size; what is refused, and leaves nothing behind."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.frames.animation import write_animation

COUNT, HEIGHT, WIDTH = 5, 33, 47


def frames(count: int = COUNT) -> Iterator[np.ndarray]:
    """One gray after the other, each far enough from the last one to tell them apart after compression."""
    for i in range(count):
        yield np.full((HEIGHT, WIDTH, 3), 40 * i + 20, dtype=np.uint8)


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_animated_pictures_repeat_at_the_rate(tmp_path: Path, suffix: str) -> None:
    write_animation(tmp_path / f"spin{suffix}", frames(), fps=10)
    with Image.open(tmp_path / f"spin{suffix}") as picture:
        assert (picture.n_frames, picture.size, picture.info["loop"]) == (COUNT, (WIDTH, HEIGHT), 0)
        for i in range(COUNT):
            picture.seek(i)
            shown = np.asarray(picture.convert("RGB")).astype(int)
            assert picture.info["duration"] == 100
            assert np.abs(shown - (40 * i + 20)).max() <= 3
    assert [path.name for path in tmp_path.iterdir()] == [f"spin{suffix}"]


def test_films_hold_all_frames_and_even_sizes(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="films need the imageio-ffmpeg package")
    write_animation(tmp_path / "spin.mp4", frames(), fps=10)
    # The package's own reader leaves pipes open, so its ffmpeg is asked.
    command = [ffmpeg.get_ffmpeg_exe(), "-i", str(tmp_path / "spin.mp4"), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    assert b"48x34" in done.stderr
    assert b" 10 fps" in done.stderr
    shown = np.frombuffer(done.stdout, dtype=np.uint8).reshape(COUNT, HEIGHT + 1, WIDTH + 1, 3).astype(int)
    for i, picture in enumerate(shown):
        assert np.abs(picture - (40 * i + 20)).max() <= 4


def test_a_folder_holds_numbered_pictures(tmp_path: Path) -> None:
    write_animation(tmp_path / "new" / "frames", frames())
    files = sorted((tmp_path / "new" / "frames").iterdir())
    assert [file.name for file in files] == [f"{i:04}.png" for i in range(COUNT)]
    with Image.open(files[3]) as picture:
        np.testing.assert_array_equal(np.asarray(picture), np.full((HEIGHT, WIDTH, 3), 140))
    (tmp_path / "v1.0").mkdir()
    write_animation(tmp_path / "v1.0", frames(2))
    assert len(list((tmp_path / "v1.0").iterdir())) == 2


@pytest.mark.parametrize("name", ["spin.webp", "spin.gif"])
def test_an_interrupted_animation_harms_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("older")

    def broken() -> Iterator[np.ndarray]:
        yield from frames(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_animation(tmp_path / name, broken())
    assert (tmp_path / name).read_text() == "older"
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_refusals(tmp_path: Path) -> None:
    for name, fps, pictures, message in [
        ("spin.avi", 24, frames(), r"animation .*spin.avi'; suffix '.avi'; use .webp, .gif, .mp4, or a folder"),
        ("none/spin.gif", 24, frames(), r"the folder .*none' does not exist; create the folder first"),
        ("spin.gif", 0, frames(), "0 pictures per second; the frame rate must lie in 1 to 100"),
        ("spin.gif", float("nan"), frames(), "nan pictures per second"),
        ("spin.gif", 24, iter(()), "animation; the animation has no frames"),
        ("spin.gif", 24, [np.zeros((2, 2, 3), np.uint8), np.zeros((2, 3, 3), np.uint8)], r"frame 1 .*\(2, 3, 3\)"),
        (
            "spin.gif",
            24,
            [np.zeros((2, 2, 3))],
            "frame 0 of an animation; the frame has the shape .* and the type float64",
        ),
    ]:
        with pytest.raises(tl.InputError, match=message):
            write_animation(tmp_path / name, pictures, fps)
    assert not list(tmp_path.iterdir())


def fake_ffmpeg(folder: Path, script: str) -> str:
    program = folder / "ffmpeg"
    program.write_text(f"#!/bin/sh\nfor output; do :; done\n{script}\n")
    program.chmod(0o755)
    return str(program)


@pytest.mark.skipif(sys.platform == "win32", reason="the programs are shell scripts")
@pytest.mark.parametrize(
    ("script", "found"),
    [
        ('cat > /dev/null; echo half > "$output"; echo no space >&2; exit 3', "ffmpeg ended with status 3: no space"),
        ('exec 0<&-; echo "no encoder" >&2; exit 1', "ffmpeg ended with status 1: no encoder"),
        # As some versions do where the disk is full when they end.
        ('cat > /dev/null; echo half > "$output"; exit 0', "the film has 0 of 5 pictures"),
        # What is said without end must not be waited for.
        ("cat > /dev/null; yes | head -c 300000 >&2; exit 2", "ffmpeg ended with status 2: y"),
        ("kill -9 $$", "ffmpeg ended with status -9"),
    ],
)
def test_a_film_that_ffmpeg_does_not_finish_replaces_nothing(
    script: str, found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="films need the imageio-ffmpeg package")
    real = ffmpeg.get_ffmpeg_exe()
    program = fake_ffmpeg(tmp_path, f'[ "$1" = -y ] || exec {real} "$@"\n{script}')
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", program)
    output = tmp_path / "out" / "spin.mp4"
    output.parent.mkdir()
    output.write_text("the old one")
    with pytest.raises(tl.RenderError, match=r"spin\.mp4'; the file cannot be written") as caught:
        write_animation(output, frames())
    assert found in str(caught.value)
    assert output.read_text() == "the old one"
    assert os.listdir(output.parent) == ["spin.mp4"]


def test_a_film_that_is_given_up_leaves_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="films need the imageio-ffmpeg package")
    started = []

    class Noted(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            started.append(self)

    def interrupted() -> Iterator[np.ndarray]:
        yield from frames(2)
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess, "Popen", Noted)
    with pytest.raises(KeyboardInterrupt):
        write_animation(tmp_path / "spin.mp4", interrupted())
    assert [process.returncode for process in started] == [-9]
    assert os.listdir(tmp_path) == []
