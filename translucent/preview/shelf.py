"""Shelf of small pictures: kept on disk, and made one at a time by a worker process."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.errors import TranslucentError
from translucent.files.folders import make_folder
from translucent.files.images import write_png
from translucent.files.paths import write_atomically
from translucent.files.user_folders import cache_folder
from translucent.preview.tasks import Lane, Task

Picture = npt.NDArray[np.uint8]

#: Pictures that are read from the disk in one frame.
READ_AT_ONCE = 4

#: Largest number of pictures in memory.
MOST_KEPT = 1024


class Shelf:
    """Shelf of small pictures by their keys.

    Parameters
    ----------
    lane : Lane
        In which they are made.
    make : callable
        ``make(task, work, *arguments)`` runs ``work(report, *arguments)`` and returns its picture.
    folder : Path, optional
        Where they are kept. Default: in the user's folder of what can be made again.
    """

    def __init__(self, lane: Lane, make: Callable[..., Picture], folder: Path | None = None) -> None:
        self.lane = lane
        self.folder = folder or cache_folder() / "pictures"
        self._make = make
        self._known: dict[str, Picture | None] = {}
        #: Requests of the frame before, and of this one.
        self._wanted: dict[str, tuple[Any, ...]] = {}
        self._asked: dict[str, tuple[Any, ...]] = {}
        self._room = READ_AT_ONCE

    def picture(self, key: str, *work: Any) -> Picture | None:
        """Picture of a key; None until it is there. What is not kept on disk is requested by work and its arguments."""
        if key in self._known:
            return self._known[key]
        if key not in self._wanted:
            if self._room <= 0:
                return None
            self._room -= 1
            if (found := _read(self.folder / f"{key}.png")) is not None:
                self._know(key, found)
                return found
            if not work:
                self._know(key, None)
                return None
        self._asked[key] = work
        return None

    @property
    def busy(self) -> bool:
        """True if pictures are still to be made."""
        return bool(self._wanted) or self.lane.task is not None

    def begin_frame(self, idle: bool) -> None:
        """Begin a frame: a few pictures may be read in it; where nothing else is to be done, the next one is made.

        What has not been asked for in the frame before, nobody sees any more.
        """
        self._room, self._wanted, self._asked = READ_AT_ONCE, self._asked, {}
        if self.lane.task is not None:
            return
        if idle and self._wanted:
            key = next(iter(self._wanted))
            self.lane.start("", partial(self._work, key, self._wanted[key]), partial(self._take, key))

    def put(self, key: str, picture: Picture) -> None:
        """Keep a picture."""
        self._know(key, picture)
        self._write(key, picture)

    def _work(self, key: str, work: tuple[Any, ...], task: Task) -> Picture | None:
        try:
            made = self._make(task, *work)
        except TranslucentError:
            return None  # what cannot be read has no picture; who uses it is told why
        self._write(key, made)
        return made

    def _take(self, key: str, made: Picture | None) -> None:
        self._wanted.pop(key, None)
        self._know(key, made)

    def _know(self, key: str, picture: Picture | None) -> None:
        while len(self._known) >= MOST_KEPT:
            self._known.pop(next(iter(self._known)))
        self._known[key] = picture

    def _write(self, key: str, picture: Picture) -> None:
        with suppress(TranslucentError):  # a full disk is no reason to have no pictures
            make_folder(self.folder)
            write_atomically(self.folder / f"{key}.png", partial(write_png, pixels=picture))


def _read(path: Path) -> Picture | None:
    from PIL import Image

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError):  # none, or half a one of another program
        return None
