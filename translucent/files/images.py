"""Pictures and arrays in files: PNG, OpenEXR and NumPy's own, written, and unpacked from untrusted files.

Each writer fills the file that it is given; `translucent.files.paths.write_atomically` makes it appear complete or not
at all. Readers check headers before memory is allocated.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
import os
import warnings
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError, UnreadableError
from translucent.extras import require_package
from translucent.files.reading import open_file, require_room, shown

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile


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
    """Write float32 channels, or float16 ones as they are, with the OpenEXR package, which has to be installed.

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

    kept = {
        name: np.ascontiguousarray(values, dtype=np.float16 if values.dtype == np.float16 else np.float32)
        for name, values in channels.items()
    }
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


# Without a handler of its own, what Pillow logs of a damaged file is printed.
logging.getLogger("PIL").addHandler(logging.NullHandler())

#: Formats of pictures that are read: Pillow knows more, and some run other programs.
PICTURES = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "TGA", "PPM")


def read_array(
    stream: IO[bytes], size: int, requested: str, do: str = "write the file with numpy.save", kinds: str = "biuf"
) -> npt.NDArray[Any]:
    """Read the array of a .npy file.

    Parameters
    ----------
    stream : file
    size : int
        Bytes of the file.
    requested : str
        What was requested, as errors state it.
    do : str
        What the user can do about it.
    kinds : str
        Kinds of types that it may have, as NumPy names them: numbers, unless asked otherwise.

    Raises
    ------
    InputError
        If it is none, or has not as many bytes as its header says.
    """
    form = np.lib.format
    try:
        version = form.read_magic(stream)
        read_header = form.read_array_header_1_0 if version == (1, 0) else form.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python's parser, about the header
            shape, _, dtype = read_header(stream)
    except MemoryError:  # what Python's parser says of too many brackets
        raise InputError(requested, "not a NumPy array", do) from None
    except Exception as error:  # a header is Python, and what is broken in it raises whatever Python does
        raise InputError(requested, f"not a NumPy array ({shown(error)})", do) from error
    if dtype.hasobject or dtype.kind not in kinds or not dtype.itemsize:
        raise InputError(requested, f"its values are of type {str(dtype)!r}, and not numbers", do)
    needed, held = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if not 0 <= needed <= held:
        raise InputError(requested, f"the file is cut off: {held} of {needed} bytes are present", do)
    stream.seek(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.lib.format.read_array(stream, allow_pickle=False)


def read_arrays(path: str | Path, requested: str, names: Iterable[str], do: str) -> dict[str, npt.NDArray[Any]]:
    """Read arrays of a .npz file by their names; raises `InputError` if one is missing or broken."""
    found = {}
    with open_file(path, requested) as stream:
        whole = os.fstat(stream.fileno()).st_size
        try:
            with zipfile.ZipFile(stream) as archive:
                for name in names:
                    member = archive.getinfo(f"{name}.npy")
                    # What is said to be stored makes room for itself, too, whether it is there or not.
                    size, stored = max(member.file_size, member.compress_size), min(member.compress_size, whole)
                    require_room(requested, f"{name} would", size, stored, do)
                    found[name] = read_array(io.BytesIO(archive.read(member)), member.file_size, requested, do, "biufU")
        except InputError:
            raise
        except Exception as error:  # of zipfile and of each kind of compression
            raise InputError(requested, f"the file cannot be read ({shown(error)})", do) from error
    return found


@contextlib.contextmanager
def open_picture(
    data: bytes,
    requested: str,
    formats: tuple[str, ...] = PICTURES,
    *,
    per_pixel: int,
    do: str = "check the file",
) -> Iterator[ImageFile]:
    """Open a picture without decoding its pixels, after a check that there is memory for them.

    Pillow's warnings are ignored until the end of the context, in which pixels are to be decoded: of odd metadata, of
    palettes with transparency, and of many pixels, which are counted here.

    Parameters
    ----------
    data : bytes
        Of a whole file: a chunk may say that it is longer than that, and what reads on in a file makes room first.
    requested : str
        What was requested, as errors state it.
    formats : tuple of str
        Of Pillow.
    per_pixel : int
        Bytes that the reader makes of a pixel.
    do : str
        What the user can do about it.

    Raises
    ------
    InputError
        If it has too many pixels for its file, or, as `UnreadableError`, is no such picture.
    """
    from PIL import Image

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"PIL\.")
        try:
            image = Image.open(io.BytesIO(data), formats=formats)
        except Image.DecompressionBombError:
            raise InputError(requested, "the picture has too many pixels", "use a smaller picture") from None
        except Exception as error:  # each of Pillow's readers raises its own kinds
            found = f"the file is not a readable image of the format {' or '.join(formats)}"
            raise UnreadableError(requested, found, do) from error
        width, height = image.size
        require_room(requested, f"{width}x{height} pixels", per_pixel * width * height, len(data))
        with image:
            yield image


def read_exr(path: str | Path, requested: str) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Read header and channels of the first part of an OpenEXR file; the package has to be installed.

    Raises
    ------
    InputError
        If it is none, is damaged, or has too many pixels for its file.
    """
    OpenEXR = require_package("OpenEXR", requested)
    with open_file(path, requested) as stream:
        stored = os.fstat(stream.fileno()).st_size
    try:
        with _silent(), OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            sizes = [_exr_size(part.header) for part in file.parts]
        width, height, _ = sizes[0]
        require_room(requested, f"{width}x{height} pixels", sum(12 * w * h * n for w, h, n in sizes), stored)
        with _silent(), OpenEXR.File(str(path), separate_channels=True) as file:
            if not file.parts:  # of damaged pixels the library leaves their part out
                raise InputError(requested, "the pixel data is damaged", "copy the file again")
            return dict(file.header()), {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except InputError:
        raise
    except Exception as error:  # of the library's C++
        raise InputError(requested, f"the file is not an OpenEXR file ({shown(error)})", "check the file") from error


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Discard output of a library, which may contain control codes for terminals."""
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        with contextlib.suppress(OSError):  # of a process without standard error
            kept = os.dup(2)
            stack.callback(os.close, kept)
            stack.callback(os.dup2, kept, 2)
            with open(os.devnull, "wb") as nothing:
                os.dup2(nothing.fileno(), 2)
        yield


def _exr_size(header: dict[str, Any]) -> tuple[int, int, int]:
    """Width, height and number of channels of an OpenEXR header."""
    (left, top), (right, bottom) = (corner.tolist() for corner in header["dataWindow"])
    return right - left + 1, bottom - top + 1, len(header["channels"])
