"""Environments from picture files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.files.images import open_picture, read_exr
from translucent.files.paths import require_file
from translucent.files.reading import read_bytes, shown
from translucent.formulas.color import srgb_to_linear
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.radiance_hdr import read_radiance

Pixels = npt.NDArray[Any]


def read_environment_map(path: str | Path) -> EnvironmentMap:
    """Read an environment map from a picture file.

    Parameters
    ----------
    path : str or Path
        ``.hdr`` or ``.pic`` (Radiance), ``.exr`` (linear Rec.709), or ``.png`` or ``.jpg`` (sRGB, in which no light is
        brighter than white paper).

    Raises
    ------
    InputError
        If the file has another suffix, cannot be read, or holds no picture.
    RenderError
        If the OpenEXR package is needed and not installed.
    """
    path = Path(path)
    read = READERS.get(path.suffix.lower())
    if read is None:
        raise InputError(f"environment {str(path)!r}", f"suffix {path.suffix!r}", f"use one of {', '.join(READERS)}")
    require_file(path, f"environment {str(path)!r}")
    return EnvironmentMap(read(path))


def read_linear(path: Path) -> Pixels:
    """Linear values (h, w, 3) of a ``.exr`` file, or else of one of Radiance; raises as `read_environment_map`."""
    if path.suffix.lower() != ".exr":
        return read_radiance(path)
    what = f"picture {str(path)!r}"
    _, channels = read_exr(path, what)
    for names in ("RGB", "YYY"):
        if set(names) <= channels.keys():
            return np.stack([channels[name] for name in names], axis=-1)
    raise InputError(what, f"channels {', '.join(channels)}", "give channels R, G and B")


def _read_encoded(path: Path) -> Pixels:
    what = f"environment {str(path)!r}"
    try:
        with open_picture(read_bytes(path, what), what, ("PNG", "JPEG"), per_pixel=38) as image:
            encoded = np.asarray(image.convert("RGB"))
    except InputError:
        raise
    except Exception as error:  # each of Pillow's decoders raises its own kinds
        raise InputError(what, f"not an image that can be read ({shown(error)})", "check the file") from error
    return np.asarray(srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)[encoded])


READERS: dict[str, Callable[[Path], Pixels]] = {
    ".hdr": read_linear,
    ".pic": read_linear,
    ".exr": read_linear,
    ".png": _read_encoded,
    ".jpg": _read_encoded,
    ".jpeg": _read_encoded,
}
