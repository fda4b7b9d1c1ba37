"""Writing of frames: a picture, or its arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Pixels
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.files.folders import make_folder
from translucent.files.images import write_exr, write_npz, write_png
from translucent.files.paths import require_output, write_atomically

Arrays = Mapping[str, npt.NDArray[Any]]

#: Suffixes of files that hold a frame.
SUFFIXES = (".png", ".exr", ".npz")


def check_output(path: Path) -> None:
    """Raise before any work is done if a frame could not be written to `path`."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"output {str(path)!r}", f"suffix {path.suffix!r}", "use .png, .exr or .npz")
    require_output(path, f"output {str(path)!r}")
    if path.suffix.lower() == ".exr":
        require_package("OpenEXR", f"output {str(path)!r}")


def write_frame(path: Path, arrays: Arrays, picture: Callable[[], Pixels]) -> None:
    """Write a frame as its suffix says, complete or not at all.

    Parameters
    ----------
    path : Path
    arrays : mapping
        Of a frame, by name: what an ``.exr`` or ``.npz`` holds.
    picture : callable
        Makes the pixels of a ``.png``.

    Raises
    ------
    InputError, RenderError
        As `Frame.save`.
    """
    check_output(path)
    suffix = path.suffix.lower()
    if suffix == ".png":
        write_atomically(path, partial(write_png, pixels=picture()))
    elif suffix == ".npz":
        write_atomically(path, partial(write_npz, arrays=arrays))
    else:
        header = {"comments": "linear Rec.709; thickness in metres"}
        write_atomically(path, partial(write_exr, channels=channels_of(arrays), header=header))


def write_pictures(folder: Path, pictures: Iterable[tuple[str, Pixels]]) -> list[Path]:
    """Write named pictures as PNG files into a folder that is made if needed; returns the files.

    Raises
    ------
    InputError
        If the folder is a file.
    RenderError
        If they cannot be written.
    """
    make_folder(folder)
    files = []
    for name, pixels in pictures:
        files.append(folder / f"{name}.png")
        write_atomically(files[-1], partial(write_png, pixels=pixels))
    return files


def channels_of(arrays: Arrays) -> dict[str, npt.NDArray[Any]]:
    """Channel names of an OpenEXR file."""
    channels = {"RGB": arrays["radiance"]}
    if "normals" in arrays:
        channels |= _split("normals", "XYZ", arrays)
    if "alpha" in arrays:
        channels = {name: values for name, values in channels.items() if name != "RGB"}
        channels["RGBA"] = np.concatenate([arrays["radiance"], arrays["alpha"][..., None]], axis=-1)
    for name in ("passed", "transmittance", "optical_depth", "standard_error"):
        if name in arrays:
            channels |= _split(name, "RGB", arrays)
    channels["thickness.Z"] = arrays["thickness"]
    return {**channels, "coverage.A": arrays["coverage"], "valid.A": arrays["valid"]}


def _split(name: str, letters: str, arrays: Arrays) -> dict[str, npt.NDArray[Any]]:
    return {f"{name}.{letter}": arrays[name][..., i] for i, letter in enumerate(letters)}
