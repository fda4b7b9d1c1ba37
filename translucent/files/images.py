"""Writing of pictures and arrays: PNG, OpenEXR and NumPy's own. Each function fills the file that it is given; that a
file appears complete or not at all is for `translucent.files.paths.write_atomically` to see to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

#: Rows of a large picture that are converted at a time: blocks of the compression are 16 high.
_ROWS_AT_ONCE = 64


def write_png(file: Path | BinaryIO, pixels: npt.NDArray[Any], text: Mapping[str, str] | None = None) -> None:
    """Write pixels as they are.

    Parameters
    ----------
    file : Path or binary file
    pixels : (h, w, 3), (h, w, 4) or (h, w) uint8, or (h, w) uint16
        Color, color with alpha, or gray.
    text : mapping, optional
        For the text chunks, by keyword.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    chunks = PngInfo()
    for key, value in (text or {}).items():
        chunks.add_text(key, value)
    Image.fromarray(pixels).save(file, format="PNG", pnginfo=chunks)


def write_exr(path: Path, channels: Mapping[str, npt.NDArray[Any]], header: Mapping[str, Any]) -> None:
    """Write float32 channels with the OpenEXR package, which has to be installed.

    Parameters
    ----------
    path : Path
    channels : mapping
        Of (h, w), or of (h, w, 3) and (h, w, 4) under the names ``RGB`` and ``RGBA``.
    header : mapping
        Attributes besides the ones of every file.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import OpenEXR

    kept = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in channels.items()}
    how = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File({**how, **header}, kept) as file:
            file.write(str(path))
    except RuntimeError as error:  # what a full disk is to OpenEXR
        raise OSError(str(error).replace(str(path), "the file").rstrip(".")) from error


def write_exr_rows(
    path: Path,
    size: tuple[int, int],
    blocks: Iterable[Mapping[str, npt.NDArray[Any]]],
    header: Mapping[str, str],
) -> None:
    """Write float32 channels as `write_exr` does, in blocks of rows.

    Parameters
    ----------
    path : Path
    size : (width, height)
    blocks : iterable of mapping
        Channels of some rows, from the top of the picture to its bottom; all have the same.
    header : mapping
        Texts beside what every file has.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import Imath
    import OpenEXR

    file = None
    try:
        for block in blocks:
            channels = _flat(block)
            if file is None:
                float32 = Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT))
                compression = Imath.Compression(Imath.Compression.ZIP_COMPRESSION)
                texts = {name: text.encode() for name, text in header.items()}
                parts = {"channels": dict.fromkeys(channels, float32), "compression": compression, **texts}
                file = OpenEXR.OutputFile(str(path), {**OpenEXR.Header(*size), **parts})
            rows = len(next(iter(channels.values())))
            for first in range(0, rows, _ROWS_AT_ONCE):
                part = {name: values[first : first + _ROWS_AT_ONCE] for name, values in channels.items()}
                count = min(_ROWS_AT_ONCE, rows - first)
                file.writePixels({name: values.astype(np.float32).tobytes() for name, values in part.items()}, count)
    except RuntimeError as error:
        raise OSError(str(error).replace(str(path), "the file").rstrip(".")) from error
    finally:
        if file is not None:
            file.close()


def _flat(channels: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """The channels (h, w) one by one; some come as ``RGB`` or ``RGBA``."""
    whole = ("RGB", "RGBA")
    flat = {name: values for name, values in channels.items() if name not in whole}
    for name in whole:
        if name in channels:
            flat |= {letter: channels[name][..., i] for i, letter in enumerate(name)}
    return flat


def write_npz(path: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write arrays under their names, compressed."""
    with path.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def write_npy(path: Path, array: npt.NDArray[Any]) -> None:
    """Write one array."""
    with path.open("wb") as stream:
        np.save(stream, array, allow_pickle=False)
