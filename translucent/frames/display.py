"""Frames as notebooks show them: the picture, and thickness in false colors with a scale, in words as well.

Every picture has its text alternative, in the HTML and beside the PNG.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Mask, Pixels
from translucent.files.images import write_png
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
    shown = [(png(picture), f"Picture of {said}"), (thickness, f"Thickness in false colors, of {said}")]
    return bundle(shown, [said, plan], text)


def frame_text(thickness: npt.NDArray[Any], coverage: Mask, valid: Mask) -> str:
    """Frame in words: size, coverage, thickness, and pixels that cannot be trusted."""
    seen = thickness[coverage & valid]
    height, width = thickness.shape
    said = f"{width} x {height} pixels, of which media cover {coverage.mean():.0%}"
    if seen.size:
        median, most = (length_text(float(found)) for found in (np.median(seen), seen.max()))
        said += f", {median} thick in the median and {most} at most"
    invalid = int((~valid).sum())
    return said + (f"; {invalid} pixels cannot be trusted" if invalid else "")


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
