"""Large pictures, rendered a tile at a time, so that they need no more memory than a tile."""

from __future__ import annotations

import dataclasses
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arguments import checked_but
from translucent.errors import InputError, TranslucentWarning
from translucent.frames.frame import Frame
from translucent.frames.tiled import Tile
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.request import RenderRequest
from translucent.renderer import Renderer
from translucent.scene.camera import Window, check_size
from translucent.scene.scene import Scene

#: Width and height of a tile, unless told otherwise.
TILE = (2048, 512)

#: Pixels around a tile that are drawn, too, where interfaces show what the picture has of opaque objects beside it.
MARGIN = 32


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
        raise InputError("a picture in tiles", "a backdrop is given, too", "render it at once")
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
    """Render what is requested of a scene tile by tile; see `render_tiles`."""
    width, height = check_size(size)
    across, down = check_size(tile)
    windows = [(x, y) for y in range(0, height, down) for x in range(0, width, across)]
    covered = invalid = 0
    told: set[str] = set()
    for number, (left, top) in enumerate(windows):
        extent = min(across, width - left), min(down, height - top)
        share = _part(progress, number, len(windows))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", TranslucentWarning)
            frame = _rendered(renderer, scene, (width, height), (left, top), extent, request, share)
        covered += int(np.count_nonzero(frame.coverage))
        invalid += int(np.count_nonzero(~frame.valid))
        for one in caught:
            if "pixels are not valid" not in str(one.message) and str(one.message) not in told:
                told.add(str(one.message))
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
    do = "render it at once, in a size that fits into memory"
    if plan.interfaces is not None and plan.has(PassName.SURFACES) and plan.interfaces.finds_exits:
        raise InputError(
            "a picture in tiles", "interfaces in screen space, which need all of it", f"trace them, or {do}"
        )
    if plan.has(PassName.CAUSTICS):
        raise InputError("a picture in tiles", "photons, which each tile would follow anew", f"leave them out, or {do}")


def _rendered(
    renderer: Renderer,
    scene: Scene,
    whole: tuple[int, int],
    corner: tuple[int, int],
    extent: tuple[int, int],
    request: RenderRequest,
    progress: Callable[[float], None] | None,
) -> Frame:
    """The frame of a tile, rendered with what is around it if need be."""
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
