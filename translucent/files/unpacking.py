"""Unpacking of arrays and pictures from untrusted files: headers are checked before memory is allocated."""

from __future__ import annotations

import contextlib
import io
import logging
import math
import os
import warnings
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError, UnreadableError
from translucent.extras import require_package
from translucent.files.reading import open_file, require_room, shown

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

# Without a handler of its own, what Pillow logs of a damaged file is printed.
logging.getLogger("PIL").addHandler(logging.NullHandler())

#: Formats of pictures that are read: Pillow knows more, and some run other programs.
PICTURES = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "TGA", "PPM")


def read_array(
    stream: IO[bytes], size: int, asked: str, do: str = "write it with numpy.save", kinds: str = "biuf"
) -> npt.NDArray[Any]:
    """Read the array of a .npy file.

    Parameters
    ----------
    stream : file
    size : int
        Bytes of the file.
    asked : str
        What the error says was asked for.
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
        raise InputError(asked, "not a NumPy array", do) from None
    except Exception as error:  # a header is Python, and what is broken in it raises whatever Python does
        raise InputError(asked, f"not a NumPy array ({shown(error)})", do) from error
    if dtype.hasobject or dtype.kind not in kinds or not dtype.itemsize:
        raise InputError(asked, f"its type is {str(dtype)!r}, not numbers", do)
    needed, held = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if not 0 <= needed <= held:
        raise InputError(asked, f"it is cut short: {held} of {needed} bytes", do)
    stream.seek(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.lib.format.read_array(stream, allow_pickle=False)


def read_arrays(path: str | Path, asked: str, names: Iterable[str], do: str) -> dict[str, npt.NDArray[Any]]:
    """Read arrays of a .npz file by their names; raises `InputError` if one is missing or broken."""
    found = {}
    with open_file(path, asked) as stream:
        whole = os.fstat(stream.fileno()).st_size
        try:
            with zipfile.ZipFile(stream) as archive:
                for name in names:
                    member = archive.getinfo(f"{name}.npy")
                    # What is said to be stored makes room for itself, too, whether it is there or not.
                    size, stored = max(member.file_size, member.compress_size), min(member.compress_size, whole)
                    require_room(asked, f"{name} would", size, stored, do)
                    found[name] = read_array(io.BytesIO(archive.read(member)), member.file_size, asked, do, "biufU")
        except InputError:
            raise
        except Exception as error:  # of zipfile and of each kind of compression
            raise InputError(asked, f"it cannot be read ({shown(error)})", do) from error
    return found


@contextlib.contextmanager
def open_picture(
    data: bytes,
    asked: str,
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
    asked : str
        What the error says was asked for.
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
            raise InputError(asked, "it has too many pixels", "make it smaller") from None
        except Exception as error:  # each of Pillow's readers raises its own kinds
            found = f"it is not an image that can be read: none of {', '.join(formats)}"
            raise UnreadableError(asked, found, do) from error
        width, height = image.size
        require_room(asked, f"{width}x{height} pixels", per_pixel * width * height, len(data))
        with image:
            yield image


def read_exr(path: str | Path, asked: str) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Read header and channels of the first part of an OpenEXR file; the package has to be installed.

    Raises
    ------
    InputError
        If it is none, is damaged, or has too many pixels for its file.
    """
    OpenEXR = require_package("OpenEXR", asked)
    with open_file(path, asked) as stream:
        stored = os.fstat(stream.fileno()).st_size
    try:
        with _silent(), OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            sizes = [_exr_size(part.header) for part in file.parts]
        width, height, _ = sizes[0]
        require_room(asked, f"{width}x{height} pixels", sum(12 * w * h * n for w, h, n in sizes), stored)
        with _silent(), OpenEXR.File(str(path), separate_channels=True) as file:
            if not file.parts:  # of damaged pixels the library leaves their part out
                raise InputError(asked, "its pixels are damaged", "copy the file again")
            return dict(file.header()), {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except InputError:
        raise
    except Exception as error:  # of the library's C++
        raise InputError(asked, f"not an OpenEXR file ({shown(error)})", "check the file") from error


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Drop what a library prints, in Python or in C: it names files as they are, with codes that terminals obey."""
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
