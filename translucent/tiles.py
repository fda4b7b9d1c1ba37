"""Large pictures, rendered and written a tile at a time, so that they need no more memory than a tile.

OpenEXR files are written in blocks of rows, PNG from 8 bits a channel.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked_but
from translucent.arrays import Pixels
from translucent.errors import InputError, TranslucentWarning
from translucent.files.images import write_exr_rows, write_png
from translucent.files.paths import write_atomically
from translucent.frames.frame import Frame
from translucent.frames.writing import channels_of, check_output
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.request import RenderRequest
from translucent.renderer import Renderer
from translucent.scene.camera import Window, check_size
from translucent.scene.scene import Scene

#: Width and height of a tile, unless another is requested.
TILE = (2048, 512)

#: Pixels around a tile that are drawn, too, where interfaces show what the picture has of opaque objects beside it.
MARGIN = 32


#: Suffixes of files that can be written tile by tile.
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


@checked_but("scene", "size", "tile")
def render_tiles(
    renderer: Renderer,
    scene: Scene,
    size: tuple[int, int],
    tile: tuple[int, int] = TILE,
    *,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Iterator[Tile]:
    """Render a large picture tile by tile: row by row from the top, each row from the left.

    Tiles equal the parts of a picture that is rendered at once up to rounding, but for what interfaces show of opaque
    objects: beyond a tile and 32 pixels around it those are lit where rays meet them, without their textures. Adaptive
    sampling may take other samples next to the edges of tiles, and without OpenGL rough interfaces have other random
    numbers.

    Parameters
    ----------
    renderer : Renderer
    scene : Scene
    size : (width, height)
        Of the whole picture, in pixels.
    tile : (width, height)
        Of the tiles; those at the right and at the bottom are smaller.
    progress : callable, optional
        Takes the share of the picture that is done.
    **options
        What else `Renderer.render` takes, but no backdrop.

    Yields
    ------
    Tile

    Warns
    -----
    TranslucentWarning
        After the last tile, if pixels are not valid.

    Raises
    ------
    InputError
        If the sizes are not positive, or the plan needs the whole picture at once: interfaces in screen space, photons,
        or a backdrop.
    """
    if options.pop("backdrop", None) is not None:
        raise InputError(
            "rendering a picture in tiles", "a backdrop cannot be used with tiles", "render the whole picture at once"
        )
    yield from tiles_requested(renderer, scene, size, RenderRequest(**options), tile, progress=progress)


def tiles_requested(
    renderer: Renderer,
    scene: Scene,
    size: tuple[int, int],
    request: RenderRequest,
    tile: tuple[int, int] = TILE,
    *,
    progress: Callable[[float], None] | None = None,
) -> Iterator[Tile]:
    """Render a request tile by tile; see `render_tiles`."""
    width, height = check_size(size)
    across, down = check_size(tile)
    windows = [(x, y) for y in range(0, height, down) for x in range(0, width, across)]
    covered = invalid = 0
    warned: set[str] = set()
    for number, (left, top) in enumerate(windows):
        extent = min(across, width - left), min(down, height - top)
        share = _part(progress, number, len(windows))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", TranslucentWarning)
            frame = _rendered(renderer, scene, (width, height), (left, top), extent, request, share)
        covered += int(np.count_nonzero(frame.coverage))
        invalid += int(np.count_nonzero(~frame.valid))
        for one in caught:
            if "pixels are not valid" not in str(one.message) and str(one.message) not in warned:
                warned.add(str(one.message))
                warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
        yield Tile(left, top, frame)
    if progress is not None:
        progress(1.0)
    if invalid:
        warnings.warn(frame.plan.invalid_text(invalid, covered), TranslucentWarning, stacklevel=2)


@dataclass
class Totals:
    """Statistics of a picture whose tiles come one after the other.

    Attributes
    ----------
    covered, invalid : int
        Pixels.
    seconds : dict of str to float
        Of all tiles, by pass.
    thickness : list of arrays
        Of the covered, valid pixels of each tile.
    provenance : dict of str to str
    """

    covered: int = 0
    invalid: int = 0
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    thickness: list[npt.NDArray[Any]] = field(default_factory=list)
    provenance: dict[str, str] = field(default_factory=dict)
    _plan: RenderPlan | None = None

    @property
    def plan(self) -> RenderPlan:
        """Plan of the tiles."""
        assert self._plan is not None
        return self._plan

    def add(self, frame: Frame) -> None:
        """Count the pixels of a tile."""
        self.covered += int(np.count_nonzero(frame.coverage))
        self.invalid += int(np.count_nonzero(~frame.valid))
        for name, seconds in frame.seconds.items():
            self.seconds[name] += seconds
        self._plan, self.provenance = frame.plan, frame.provenance
        self.thickness.append(frame.thickness[frame.coverage & frame.valid])

    def summary(self, size: tuple[int, int]) -> dict[str, Any]:
        """Statistics as `Frame.summary` has them."""
        seen = np.concatenate([np.zeros(0, np.float32), *self.thickness])
        self.thickness.clear()
        most = float(seen.max(initial=0.0))
        return {
            "size": list(size),
            "plan": self.plan.summary(),
            "seconds": dict(self.seconds),
            "provenance": dict(self.provenance),
            "covered_pixels": self.covered,
            "invalid_pixels": self.invalid,
            "thickness": {"median": float(np.median(seen, overwrite_input=True)), "max": most} if seen.size else None,
        }


def check_tiles(plan: RenderPlan) -> None:
    """Raise `InputError` if a plan needs the whole picture at once."""
    do = "render the whole picture at once, in a size that fits into memory"
    if plan.interfaces is not None and plan.has(PassName.SURFACES) and plan.interfaces.finds_exits:
        raise InputError(
            "rendering a picture in tiles",
            "interfaces in screen space need the whole picture",
            f"trace the interfaces, or {do}",
        )
    if plan.has(PassName.CAUSTICS):
        raise InputError(
            "rendering a picture in tiles",
            "each tile would trace all photons again",
            f"render without caustics, or {do}",
        )


def _rendered(
    renderer: Renderer,
    scene: Scene,
    whole: tuple[int, int],
    corner: tuple[int, int],
    extent: tuple[int, int],
    request: RenderRequest,
    progress: Callable[[float], None] | None,
) -> Frame:
    """Frame of a tile, rendered with a margin if necessary."""
    plan = renderer.plan_requested(scene, request)
    check_tiles(plan)
    margin = MARGIN if plan.has(PassName.TRACED, PassName.SURFACES) and plan.has(PassName.OPAQUE) else 0
    low = [max(at - margin, 0) for at in corner]
    high = [min(at + length + margin, most) for at, length, most in zip(corner, extent, whole, strict=True)]
    window = Window(low[0], low[1], whole)
    part = dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, window=window))
    frame = renderer.render_requested(part, (high[0] - low[0], high[1] - low[1]), request, progress=progress)
    if frame.size == extent:
        return frame
    rows, columns = (slice(corner[i] - low[i], corner[i] - low[i] + extent[i]) for i in (1, 0))
    cut: dict[str, Any] = {name: np.ascontiguousarray(values[rows, columns]) for name, values in frame.arrays.items()}
    return dataclasses.replace(frame, **cut)


def _part(progress: Callable[[float], None] | None, number: int, count: int) -> Callable[[float], None] | None:
    """Progress of one of so many tiles, which ends just before the next."""
    if progress is None:
        return None
    return lambda share: progress((number + min(share, 0.999)) / count)


def check_tiled_output(path: Path) -> None:
    """Raise before any work is done if a picture in tiles could not be written to `path`."""
    check_output(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"writing {str(path)!r} in tiles",
            "this file format needs all arrays at once",
            "write an .exr or a .png instead",
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
