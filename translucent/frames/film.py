"""Films through ffmpeg, whose exit status and output are checked."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np

from translucent.arrays import Pixels

#: Constant rate factor of H.264, 0 to 51: the loss is hardly visible.
_RATE_FACTOR = 10

#: Largest number of characters of ffmpeg's output in an error.
_MOST_TOLD = 120


def write_film(path: Path, pictures: Iterator[Pixels], fps: float) -> None:
    """Write an ``.mp4`` that every player reads: H.264, 4:2:0.

    Raises
    ------
    OSError
        If ffmpeg fails, or the film that it leaves does not have all pictures.
    """
    import imageio_ffmpeg

    first = _even(next(pictures))
    command = [imageio_ffmpeg.get_ffmpeg_exe(), *_arguments(first.shape[1], first.shape[0], fps), str(path)]
    count = 0
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        told = _Told(ffmpeg)
        try:
            for picture in chain([first], pictures):
                ffmpeg.stdin.write(_even(picture).tobytes())
                count += 1
            ffmpeg.stdin.close()
        except BrokenPipeError:  # it has given up, and says why
            with suppress(BrokenPipeError):
                ffmpeg.stdin.close()
        except BaseException:
            ffmpeg.kill()
            raise
        why = told.line()
    if ffmpeg.returncode != 0:
        raise OSError(f"ffmpeg ended with status {ffmpeg.returncode}{why and f': {why}'}")
    # It ends well, too, where the disk was full when it wrote the last of the film.
    try:
        found = imageio_ffmpeg.count_frames_and_secs(str(path))[0]
    except RuntimeError:
        found = 0
    if found != count:
        raise OSError(f"the film has {found} of {count} pictures{why and f': {why}'}")


def _arguments(width: int, height: int, fps: float) -> list[str]:
    rate = str(Fraction(fps).limit_denominator())
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", rate, "-i", "-"]
    made = ["-an", "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", str(_RATE_FACTOR)]
    return ["-y", "-xerror", "-v", "error", *given, *made]


class _Told:
    """Reader of a process's error output, so that the process never blocks on a full pipe."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._said = b""
        self._process = process
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        self._said = self._process.stderr.read()

    def line(self) -> str:
        """The first line, when the process has ended."""
        self._thread.join()
        lines = self._said.decode(errors="replace").strip().splitlines()
        return lines[0][:_MOST_TOLD] if lines else ""


def _even(picture: Pixels) -> Pixels:
    """Pad a picture to even size by repeating its last row and column: color is stored for 2 by 2 pixels."""
    height, width = picture.shape[:2]
    return np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
