"""Output of ``translucent render``: one file, pictures of the quantities, or a turntable."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from translucent.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from translucent.frames.frame import Frame
    from translucent.frames.tiled import Tile
    from translucent.renderer import Renderer
    from translucent.scene.scene import Scene

#: Pixels from which on a picture is rendered in tiles.
LARGE = 1 << 23

#: Width and height up to which OpenGL draws a picture at once, and pixels of the largest picture.
MOST_SIDE, MOST_PIXELS = 1 << 14, 1 << 30

#: Pictures per second of a turntable for which none are given.
FPS = 24.0

#: Bytes of memory that each pixel of a picture takes that is not rendered in tiles, at least: its arrays, read back.
_PIXEL_BYTES = 100

#: Width and height within which a large picture is looked at as a whole.
SMALL = 512


class Pictures(NamedTuple):
    """The options that say what is written, as they were given."""

    output: Path
    exposure: float
    tone: str
    turntable: int | None
    fps: float | None
    aov: Path | None

    @property
    def _rate(self) -> float:
        return FPS if self.fps is None else self.fps

    def tiled(self, size: tuple[int, int]) -> bool:
        """True if a picture of this size is so large that it is rendered and written in tiles."""
        large = size[0] * size[1] > LARGE or max(size) > MOST_SIDE
        return large and self.turntable is None and self.output.suffix.lower() != ".npz"

    def check(self, size: tuple[int, int]) -> None:
        """Raise before any work is done if pictures of this size could not be written."""
        from translucent.files.paths import require_folder
        from translucent.frames.animation import check_animation
        from translucent.frames.frame import check_exposure
        from translucent.frames.writing import check_output

        check_exposure(self.exposure)
        self._check_size(size)
        if self.aov is not None and self.tiled(size):
            found = f"{size[0]}x{size[1]} pixels, which are written in tiles"
            raise InputError(f"--aov {str(self.aov)!r}", found, "write an .exr, which holds these quantities")
        if self.aov is not None:
            require_folder(self.aov, f"--aov {str(self.aov)!r}")
        if self.turntable is None:
            if self.fps is not None:
                raise InputError(f"--fps {self.fps:g}", "only --turntable takes it", "add --turntable, or leave it out")
            check_output(self.output)
            return
        check_animation(self.output, self._rate)
        if self.aov is not None:
            raise InputError(f"--turntable {self.turntable}", "--aov is given, too", "render one picture for it")

    def _check_size(self, size: tuple[int, int]) -> None:
        """Raise if nobody could wait for pictures of this size, or memory could not hold them."""
        from translucent.files.reading import require_memory

        asked, pixels = f"--size {size[0]}x{size[1]}", size[0] * size[1]
        if pixels > MOST_PIXELS:
            found = f"{pixels / 1e6:.0f} million pixels, and {MOST_PIXELS / 1e6:.0f} million are the most"
            raise InputError(asked, found, "give a smaller size, at most about 32768x32768")
        if not self.tiled(size):
            do = "give a smaller size" if self.turntable else "give a smaller size, or write an .exr or .png, in tiles"
            found = f"{pixels / 1e6:.0f} million pixels at once"
            require_memory(asked, found, _PIXEL_BYTES * pixels, do)

    def write(self, scene: Scene, draw: Callable[[Scene], Frame]) -> Frame:
        """Draw and write all of them; returns the first frame."""
        if self.turntable is not None:
            return self._write_turntable(scene, draw, self.turntable)
        frame = draw(scene)
        frame.save(self.output, self.exposure, self.tone)
        if self.aov is not None:
            frame.save_aovs(self.aov)
        return frame

    def write_tiles(self, scene: Scene, renderer: Renderer, options: dict[str, Any]) -> tuple[Frame, dict[str, Any]]:
        """Draw and write a large picture; returns a small frame of it, and the statistics of all its pixels."""
        from translucent.frames.tiled import write_tiles
        from translucent.tiles import Totals, render_tiles

        totals, (width, height) = Totals(), options["size"]

        def counted() -> Iterator[Tile]:
            for tile in render_tiles(renderer, scene, **options):
                totals.add(tile.frame)
                yield tile

        write_tiles(self.output, (width, height), counted(), self.exposure, self.tone)
        scale = SMALL / max(width, height)
        small = max(round(scale * width), 1), max(round(scale * height), 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they have been told
            frame = renderer.render(scene, **{**options, "size": small, "samples": 1})
        return frame, totals.summary((width, height))

    def _write_turntable(self, scene: Scene, draw: Callable[[Scene], Frame], count: int) -> Frame:
        from translucent.frames.animation import write_animation
        from translucent.scene.turntable import turntable

        views = turntable(scene, count)
        first = draw(next(views))

        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            for frame in chain([first], map(draw, views)):
                yield frame.to_srgb8(self.exposure, self.tone)

        write_animation(self.output, pictures(), self._rate)
        return first


def picture_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options that choose what is written besides one picture."""
    command = click.option(
        "--aov",
        type=click.Path(path_type=Path, file_okay=False),
        metavar="DIR",
        help="Also write pictures of thickness, transmittance and validity into this folder.",
    )(command)
    command = click.option(
        "--fps", type=float, metavar="N", help=f"Pictures per second of a --turntable. Default: {FPS:g}."
    )(command)
    return click.option(
        "--turntable",
        type=click.IntRange(2, 3600),
        metavar="N",
        help="N pictures from all around, into a .webp, .gif, .mp4, or a folder of numbered .png files.",
    )(command)
