"""Writing of large pictures whose tiles come row by row: OpenEXR files in blocks of rows, PNG from 8 bits a channel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Pixels
from translucent.errors import InputError
from translucent.files.images import write_exr_rows, write_png
from translucent.files.paths import write_atomically
from translucent.frames.frame import Frame
from translucent.frames.writing import channels_of, check_output

#: Suffixes of files that can be written so.
SUFFIXES = (".exr", ".png")


@dataclass(frozen=True)
class Tile:
    """Part of a large picture.

    Attributes
    ----------
    left, top : int
        Of its first pixel in the picture.
    frame : Frame
        Of its pixels.
    """

    left: int
    top: int
    frame: Frame


def check_tiled_output(path: Path) -> None:
    """Raise before any work is done if a picture in tiles could not be written to `path`."""
    check_output(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"output {str(path)!r} in tiles", "a file that holds all arrays at once", "write an .exr, or a .png"
        )


def write_tiles(
    path: Path, size: tuple[int, int], tiles: Iterable[Tile], exposure: float = 0.0, tone: str = "none"
) -> None:
    """Write a picture as its tiles come, complete or not at all: an ``.exr`` holds one row of them in memory at a time.

    Parameters
    ----------
    path : Path
        An ``.exr`` or ``.png`` file.
    size : (width, height)
        Of the picture.
    tiles : iterable
        Of all of it: row by row from the top, each row from the left.
    exposure : float
        Stops that a ``.png`` is brighter.
    tone : {"none", "neutral", "agx"}
        Tone curve of a ``.png``.

    Raises
    ------
    InputError, RenderError
        As `Frame.save`.
    """
    check_tiled_output(path)
    rows = _Rows(size, tiles)
    if path.suffix.lower() == ".exr":
        header = {"comments": "linear Rec.709; thickness in metres"}
        write_atomically(
            path, partial(write_exr_rows, size=size, blocks=map(channels_of, rows.arrays()), header=header)
        )
    else:
        pixels = np.concatenate(list(rows.pictures(exposure, tone)))
        write_atomically(path, partial(write_png, pixels=pixels))


class _Rows:
    """Rows of tiles, put together."""

    def __init__(self, size: tuple[int, int], tiles: Iterable[Tile]) -> None:
        self._width, self._tiles = size[0], tiles

    def arrays(self) -> Iterable[dict[str, npt.NDArray[Any]]]:
        """Arrays of each row of tiles, by name."""
        row: dict[str, npt.NDArray[Any]] = {}
        for tile in self._tiles:
            for name, values in tile.frame.arrays.items():
                self._put(row, name, values, tile)
            if tile.left + tile.frame.size[0] == self._width:
                yield row

    def pictures(self, exposure: float, tone: str) -> Iterable[Pixels]:
        """Pixels of each row of tiles."""
        row: dict[str, npt.NDArray[Any]] = {}
        for tile in self._tiles:
            self._put(row, "picture", tile.frame.to_srgb8(exposure, tone), tile)
            if tile.left + tile.frame.size[0] == self._width:
                yield row.pop("picture")

    def _put(self, row: dict[str, npt.NDArray[Any]], name: str, values: npt.NDArray[Any], tile: Tile) -> None:
        height, width = values.shape[:2]
        if name not in row or len(row[name]) != height:
            row[name] = np.empty((height, self._width, *values.shape[2:]), values.dtype)
        row[name][:, tile.left : tile.left + width] = values
