"""Baked maps, read back as metres."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.bake.encoding import Encoding
from translucent.bake.record import read_record
from translucent.bake.writing import PNG_LEVELS, PNG_PREFIX
from translucent.errors import InputError, TranslucentError
from translucent.files.paths import require_file
from translucent.files.reading import open_file, read_bytes
from translucent.files.unpacking import open_picture, read_array, read_arrays, read_exr


def load_thickness_map(path: str | Path) -> Array:
    """Values of a map that `bake_thickness` or ``translucent bake`` wrote as .exr, .png, .npz or .npy.

    Normalized, inverted and 16-bit maps become what was baked again, up to their rounding. Of an .npy file, the record
    beside it says how; without a record, its values are taken as they are.

    Returns
    -------
    (h, w) float64
        Metres, but dimensionless for mode "local". Row 0 is the top of the image.

    Raises
    ------
    InputError
        If the file is missing, broken or of another kind, or says nothing of its scale.
    RenderError
        If ``.exr`` is to be read without the OpenEXR package.
    """
    path = Path(path)
    asked = f"thickness map {str(path)!r}"
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(asked, f"suffix {path.suffix!r}", f"give one of {', '.join(_READERS)}")
    require_file(path, asked)
    try:
        scale, offset, stored = reader(path)
    except TranslucentError:
        raise
    except Exception as error:  # each of the readers raises its own kinds
        raise InputError(asked, f"it cannot be read ({type(error).__name__}: {error})", "bake it again") from error
    return Encoding(scale, offset).decode(stored)


_Stored = tuple[float, float, npt.NDArray[np.generic]]


def _read_exr(path: Path) -> _Stored:
    header, channels = read_exr(path, f"thickness map {str(path)!r}")
    return float(header["scale"]), float(header["offset"]), channels["Y"]


def _read_png(path: Path) -> _Stored:
    asked = f"thickness map {str(path)!r}"
    with open_picture(read_bytes(path, asked), asked, ("PNG",), per_pixel=16) as image:
        text, stored = getattr(image, "text", {}), np.array(image)
    if f"{PNG_PREFIX}scale" not in text:
        raise InputError(asked, "it does not say its scale", "keep the metadata when copying the image")
    if stored.ndim != 2 or stored.max(initial=0) > PNG_LEVELS:
        raise InputError(asked, "it is not 16-bit gray", "give the file as it was baked")
    return float(text[f"{PNG_PREFIX}scale"]), float(text[f"{PNG_PREFIX}offset"]), stored


def _read_npz(path: Path) -> _Stored:
    names = ("scale", "offset", "values")
    scale, offset, values = read_arrays(path, f"thickness map {str(path)!r}", names, "bake it again").values()
    return float(scale), float(offset), values


def _read_npy(path: Path) -> _Stored:
    asked = f"thickness map {str(path)!r}"
    with open_file(path, asked) as stream:
        stored = read_array(stream, os.fstat(stream.fileno()).st_size, asked, "bake it again")
    encoding = (read_record(path) or {}).get("encoding", {})
    return float(encoding.get("scale", 1.0)), float(encoding.get("offset", 0.0)), stored


_READERS = {".exr": _read_exr, ".png": _read_png, ".npz": _read_npz, ".npy": _read_npy}
