"""Output of frames: pictures and arrays in files, and pictures for notebooks."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Mask, Pixels
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.files.images import write_exr, write_npz, write_png
from translucent.files.paths import make_folder, require_output, write_atomically
from translucent.units import length_text

#: Data by MIME type, and metadata likewise: what `_repr_mimebundle_` returns.
Bundle = tuple[dict[str, Any], dict[str, Any]]

#: Largest width of a picture on the page, in CSS pixels: pictures are stored as they are.
WIDEST = 640


def frame_bundle(picture: Pixels, arrays: Mapping[str, npt.NDArray[Any]], plan: str, text: str) -> Bundle:
    """Picture and thickness of a frame, as HTML, PNG and text.

    Parameters
    ----------
    picture : (h, w, 3 or 4) uint8
    arrays : mapping
        Thickness, coverage and valid, (h, w) each.
    plan : str
        What drew it, in a line.
    text : str
        For terminals.
    """
    from translucent.frames.aovs import lengths_picture  # it loads Pillow

    lengths = arrays["thickness"], arrays["coverage"], arrays["valid"]
    said = frame_text(*lengths)
    thickness = png(lengths_picture(*lengths))
    pictures = [(png(picture), f"Picture of {said}"), (thickness, f"Thickness in false colors, of {said}")]
    return bundle(pictures, [said, plan], text)


def frame_text(thickness: npt.NDArray[Any], coverage: Mask, valid: Mask) -> str:
    """Frame in words: size, coverage, thickness, and pixels that cannot be trusted."""
    visible = thickness[coverage & valid]
    height, width = thickness.shape
    said = f"{width} x {height} pixels; media cover {coverage.mean():.0%}"
    if visible.size:
        median, most = (length_text(float(found)) for found in (np.median(visible), visible.max()))
        said += f", {median} thick in the median and {most} at most"
    invalid = int((~valid).sum())
    return said + (f"; {invalid} pixels are invalid" if invalid else "")


def bundle(pictures: Sequence[tuple[bytes, str]], lines: Sequence[str], text: str) -> Bundle:
    """Bundle of pictures (PNG, and the text in place of each), a caption, and plain text for terminals."""
    figure = figure_html(pictures, lines)
    data: dict[str, Any] = {"text/plain": text, "text/html": figure}
    if not pictures:
        return data, {}
    first, alt = pictures[0]
    return {**data, "image/png": base64.b64encode(first).decode("ascii")}, {"image/png": {"alt": alt}}


def figure_html(pictures: Sequence[tuple[bytes, str]], lines: Sequence[str]) -> str:
    """HTML of pictures (PNG, and the text in place of each) side by side, with a caption of some lines."""
    images = "".join(
        f'<img src="data:image/png;base64,{base64.b64encode(picture).decode("ascii")}" alt="{escape(alt)}" '
        f'style="max-width:min({WIDEST}px,100%);height:auto">'
        for picture, alt in pictures
    )
    caption = "<br>".join(escape(line) for line in lines if line)
    row = "display:flex;flex-wrap:wrap;gap:8px;align-items:flex-start"
    return f'<figure style="margin:0"><div style="{row}">{images}</div><figcaption>{caption}</figcaption></figure>'


def png(pixels: Pixels) -> bytes:
    """PNG of pixels (h, w, 3) or (h, w, 4)."""
    stream = io.BytesIO()
    write_png(stream, pixels)
    return stream.getvalue()


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
