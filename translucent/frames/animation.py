"""Animations of frames: animated pictures, films, or numbered files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arrays import Pixels
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.files.paths import require_folder, require_output, write_atomically
from translucent.frames.film import write_film
from translucent.frames.writing import write_pictures

#: Pictures per second unless told otherwise.
DEFAULT_FPS = 24.0


def check_animation(path: Path, fps: float) -> None:
    """Raise before any work is done if an animation could not be written to `path`.

    Raises
    ------
    InputError
        If it has a suffix of no animation, there is no folder for it, or the rate is not in 1 to 100.
    RenderError
        If a film is asked for without the imageio-ffmpeg package.
    """
    if not 1.0 <= fps <= 100.0:
        raise InputError(f"{fps} pictures per second", "not in 1 to 100", "give for example 24")
    asked = f"animation {str(path)!r}"
    if path.is_dir() or not path.suffix:
        require_folder(path, asked)
        return
    if path.suffix.lower() not in WRITERS:
        raise InputError(
            asked,
            f"suffix {path.suffix!r}",
            f"use {', '.join(WRITERS)}, or a folder",
        )
    require_output(path, asked)
    if path.suffix.lower() == ".mp4":
        require_package("imageio_ffmpeg", asked, "use .webp or .gif")


def write_animation(path: str | Path, frames: Iterable[Pixels], fps: float = DEFAULT_FPS) -> None:
    """Write frames as they are rendered: an animated ``.webp`` or ``.gif`` that repeats, an ``.mp4``, or a folder of
    PNG files.

    A file appears complete or not at all; in a folder each picture does, as 0000.png and so on.

    Parameters
    ----------
    path : str or Path
        Without a suffix, or of a folder that is there: a folder.
    frames : iterable of (h, w, 3) uint8
        At least one, sRGB-encoded, all of one size.
    fps : float
        Pictures per second, 1 to 100; a folder has none.

    Raises
    ------
    InputError
        If the suffix is another, there is no frame, their sizes differ, or the rate is beyond these.
    RenderError
        If a file cannot be written, or ``.mp4`` is asked for without the imageio-ffmpeg package.
    """
    path = Path(path)
    check_animation(path, fps)
    pictures = _alike(frames)
    if path.is_dir() or not path.suffix:
        write_pictures(path, ((f"{i:04}", picture) for i, picture in enumerate(pictures)))
        return
    write_atomically(path, partial(WRITERS[path.suffix.lower()], pictures=pictures, fps=fps))


def _alike(frames: Iterable[Pixels]) -> Iterator[Pixels]:
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise InputError("animation", "it has no frames", "give at least one")

    def checked() -> Iterator[Pixels]:
        for i, picture in enumerate(chain([first], pictures)):
            if picture.shape != first.shape or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
                found = f"shape {picture.shape} and type {picture.dtype}"
                raise InputError(f"frame {i} of an animation", found, "give (h, w, 3) uint8, all of one size")
            yield picture

    return checked()


def _write_gif(path: Path, pictures: Iterator[Pixels], fps: float) -> None:
    _write_with_pillow(path, pictures, fps, format="GIF")


def _write_webp(path: Path, pictures: Iterator[Pixels], fps: float) -> None:
    _write_with_pillow(path, pictures, fps, format="WEBP", quality=90, method=4)


def _write_with_pillow(path: Path, pictures: Iterator[Pixels], fps: float, **options: Any) -> None:
    from PIL import Image

    images = (Image.fromarray(picture) for picture in pictures)
    first = next(images)
    with path.open("wb") as stream:
        first.save(stream, save_all=True, append_images=images, duration=round(1000.0 / fps), loop=0, **options)


WRITERS: dict[str, Callable[..., None]] = {".webp": _write_webp, ".gif": _write_gif, ".mp4": write_film}
