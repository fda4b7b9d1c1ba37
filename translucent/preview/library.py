"""Choices for the user: presets, environments of a folder, and their thumbnails, which are cached on disk."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError, TranslucentError
from translucent.files.images import write_png
from translucent.files.paths import cache_folder, make_folder, write_atomically
from translucent.formulas.color import linear_to_srgb
from translucent.formulas.tone import tone_curve
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.preset import Preset
from translucent.media.presets import (
    OWN,
    grouped,
    matching,
    preset_name,
    presets,
    presets_folder,
    read_own_presets,
    save_own_preset,
)
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.document import Material
from translucent.preview.scenes import medium_of
from translucent.preview.tasks import Lane, Task
from translucent.preview.worker import worker_renderer
from translucent.scene.camera import Camera
from translucent.scene.environment_files import READERS
from translucent.scene.environment_map import texel_directions
from translucent.scene.showcase import named_environment, showcase, with_pattern, with_roughness
from translucent.scene.stages import DEFAULT_STAGE, STAGED_TONE, stage_named
from translucent.version import VERSION

#: Seconds between checks whether files of own presets have changed.
WATCH = 1.0

#: Presets that people look for first, and their heading.
FIRST, POPULAR = ("jade", "wax", "whole_milk", "red_wine", "clear_glass"), "popular"

#: Source of presets that are saved here.
SAVED = "saved in the previewer"

#: Names of built-in environments, colors among them; empty: the stage's, or the model's own.
BUILT_IN = ("", "light-table", "studio", "checkerboard", "#ffffff", "#404040")

#: Suffixes of files that are listed: those of pictures that hold light. Others can be opened.
ENVIRONMENT_SUFFIXES = (".hdr", ".exr", ".pic")

#: Largest number of files that are listed.
MOST_FILES = 5000

Picture = npt.NDArray[np.uint8]

#: Sides in pixels of pictures of media, environments and models.
BALL, PANORAMA, MODEL = (96, 96), (128, 64), (120, 80)

#: Radius of the ball in metres: a body of some centimetres, for which most media are known.
RADIUS = 0.01

#: Samples of a pixel, and directions of the environment with shadows.
SAMPLES, SHADOWS = 4, ShadowMaps(directions=8)

#: Version of how the pictures are made, raised when they change: kept ones are then made again.
LOOK = 1

#: Pictures that are read from the disk in one frame.
READ_AT_ONCE = 4

#: Largest number of pictures in memory.
MOST_KEPT = 1024


class Library:
    """Library of materials.

    Parameters
    ----------
    refuse : callable
        Takes the errors in files of own presets, once each.
    folder : Path, optional
        Of own presets. Default: `presets_folder`.

    Attributes
    ----------
    search : str
        Words that presets on show have.
    """

    def __init__(self, refuse: Callable[[Exception], None], folder: Path | None = None) -> None:
        self.search = ""
        self.folder = folder or presets_folder()
        self._refuse = refuse
        self._own: dict[str, Preset] = {}
        self._found: dict[str, list[Preset]] = {}
        self._searched: str | None = None
        self._checked = -WATCH
        self._files: object = None

    def groups(self) -> dict[str, list[Preset]]:
        """Presets with the words of the search, by their groups; own ones are read again when their files change.

        Without a search, the most popular presets come first, and once more in their groups.
        """
        self._refresh()
        if self._searched != self.search:
            known = self._own | presets()
            if self.search.strip():
                self._found = {}
                for one in matching(known, self.search).values():  # the best match first, and its group
                    self._found.setdefault(one.group or OWN, []).append(one)
            else:
                self._found = {POPULAR: [known[name] for name in FIRST], **grouped(known)}
            self._searched = self.search
        return self._found

    def find(self, name: str) -> Preset | None:
        """Preset of a name; None if it is gone."""
        self._refresh()
        return presets().get(name) or self._own.get(name)

    def save(self, words: str, material: Material) -> tuple[Path, list[str]]:
        """Save a material as an own preset, and return its file and what no preset keeps.

        Raises
        ------
        InputError
            If there is no name, or one of the toolkit's presets has it.
        RenderError
            If it cannot be written.
        """
        name = preset_name(words)
        if name in presets():
            raise InputError(f"preset {name!r}", "a built-in preset already has this name", "choose another name")
        medium = medium_of(material)
        g = float(medium.anisotropy)
        source = f"{SAVED}, after {material.preset}" if material.preset else SAVED
        one = Preset(
            name, medium, "estimated", source, "", (), (g, g, g), False, material.roughness, OWN, material.pattern
        )
        path = save_own_preset(one, self.folder)
        self._checked = -WATCH
        return path, material.unsaid

    def _refresh(self) -> None:
        if time.monotonic() - self._checked < WATCH:
            return
        self._checked = time.monotonic()
        try:
            with os.scandir(self.folder) as entries:
                files = {(e.name, e.stat().st_mtime_ns, e.stat().st_size) for e in entries if e.is_file()}
        except OSError:
            files = set()
        if files == self._files:
            return
        self._files, self._searched = files, None
        self._own, wrong = read_own_presets(self.folder)
        for error in wrong:
            self._refuse(error)


class EnvironmentFolder:
    """Folder with environments.

    Attributes
    ----------
    path : str
        Of the folder, or nothing.
    problem : str
        Why nothing is listed, or nothing.
    """

    def __init__(self) -> None:
        self.path = self.problem = ""
        self._listed: tuple[object, list[str]] | None = None

    def take(self, path: str) -> None:
        """Show the environments beside a file, or in a folder."""
        if Path(path).suffix.lower() in READERS or os.path.isfile(path):
            path = str(Path(path).parent)
        self.path, self._listed = path, None

    def files(self) -> list[str]:
        """Paths of the files, by name; listed again when the folder changes."""
        if not self.path:
            return []
        try:
            key = os.stat(self.path).st_mtime_ns
            if self._listed is None or self._listed[0] != key:
                names = sorted(name for name in os.listdir(self.path) if name.lower().endswith(ENVIRONMENT_SUFFIXES))
                self._listed = key, [os.path.join(self.path, name) for name in names[:MOST_FILES]]
                self.problem = "" if names else f"{self.path} has no {' or '.join(ENVIRONMENT_SUFFIXES)} file"
        except OSError as error:
            self.problem = f"{self.path}: {error.strerror}"
            return []
        return self._listed[1]


def title(name: str) -> str:
    """Name that a user reads."""
    return Path(name).stem if Path(name).suffix.lower() in READERS else name or "own"


def ball_key(one: Preset) -> str:
    """Key of the picture of a preset: of its content, and of the version."""
    medium = one.medium
    triples = medium.absorption, medium.scattering, medium.emission
    values = *triples, medium.phase_function.parameters, medium.ior, one.roughness
    return _key("ball", BALL, one.pattern, *(np.asarray(value, dtype=np.float64).tolist() for value in values))


def panorama_key(path: str) -> str:
    """Key of the picture of an environment: its name, or of a file as it is now."""
    try:
        found = os.stat(path)
    except OSError:
        return _key("panorama", PANORAMA, path)
    return _key("panorama", PANORAMA, os.path.realpath(path), found.st_mtime_ns, found.st_size)


def model_key(path: str) -> str:
    """Key of the picture of a model: one of a path, whatever the file says now."""
    return _key("model", os.path.realpath(path))


def _key(kind: str, *content: object) -> str:
    text = repr((kind, LOOK, VERSION, *content))
    return f"{kind}-{hashlib.sha256(text.encode('utf-8', 'surrogateescape')).hexdigest()[:32]}"


def draw_ball(one: Preset) -> Picture:
    """Draw a ball of a medium on the default stage, from so near that it fills the picture."""
    scene = with_roughness(showcase(_ball(), one.medium, BALL), one.roughness or None)
    scene = with_pattern(scene, one.pattern)
    stage = stage_named(DEFAULT_STAGE)
    assert stage is not None
    camera = Camera.framing(scene.objects[0].mesh.vertices, BALL, stage.view)
    scene = dataclasses.replace(scene, camera=camera)
    frame = worker_renderer().render(scene, BALL, samples=SAMPLES, shadows=SHADOWS)
    return np.ascontiguousarray(frame.to_srgb8(0.0, STAGED_TONE))


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    return Sphere(radius=RADIUS).tessellate()


def draw_panorama(name: str) -> Picture:
    """Draw all directions of an environment; pictures as bright as makes their middle gray."""
    width, height = PANORAMA
    lit = named_environment(name)
    if lit.map is not None:
        light = lit.map.reduced(height, width)
        middle = float(np.median(light.mean(axis=-1)))
        light = np.minimum(light * (0.35 / middle if middle > 0 else 1.0), 1e4)
    else:
        places = np.moveaxis(np.indices((width, height)) / height, 0, -1).swapaxes(0, 1)
        light = lit.radiance(texel_directions(height, width), places)
    with np.errstate(under="ignore"):
        return np.rint(255.0 * np.clip(linear_to_srgb(tone_curve(STAGED_TONE)(light)), 0.0, 1.0)).astype(np.uint8)


def model_picture(picture: Picture) -> Picture:
    """Small picture of a view, from its middle."""
    from PIL import Image, ImageOps

    return np.asarray(ImageOps.fit(Image.fromarray(picture), MODEL, Image.Resampling.BOX))


class ThumbnailCache:
    """Cache of small pictures by their keys, in memory and on disk.

    Parameters
    ----------
    lane : Lane
        Thread in which they are made.
    make : callable
        ``make(task, work, *arguments)`` returns the picture of ``work(*arguments)``.
    folder : Path, optional
        Default: in the user's folder of files that can be made again.
    """

    def __init__(self, lane: Lane, make: Callable[..., Picture], folder: Path | None = None) -> None:
        self.lane = lane
        self.folder = folder or cache_folder() / "pictures"
        self._make = make
        self._known: dict[str, Picture | None] = {}
        #: Requests of the frame before, and of this one.
        self._queue: dict[str, tuple[Any, ...]] = {}
        self._requested: dict[str, tuple[Any, ...]] = {}
        self._room = READ_AT_ONCE

    def picture(self, key: str, *work: Any) -> Picture | None:
        """Picture of a key; None until it is there. If the disk has none, it is made by `work` and its arguments."""
        if key in self._known:
            return self._known[key]
        if key not in self._queue:
            if self._room <= 0:
                return None
            self._room -= 1
            if (found := _read(self.folder / f"{key}.png")) is not None or not work:
                self._keep(key, found)
                return found
        self._requested[key] = work
        return None

    @property
    def busy(self) -> bool:
        """True if pictures are still to be made."""
        return bool(self._queue) or self.lane.task is not None

    def begin_frame(self, idle: bool) -> None:
        """Begin a frame: a few pictures may be read in it; if the window is idle, the next one is made.

        Pictures that were not requested in the frame before are out of sight.
        """
        self._room, self._queue, self._requested = READ_AT_ONCE, self._requested, {}
        if self.lane.task is not None or not idle or not self._queue:
            return
        key, work = next(iter(self._queue.items()))

        def make(task: Task) -> Picture | None:
            try:
                made = self._make(task, *work)
            except TranslucentError:
                return None  # an unreadable file has no picture; the user reads why on choosing it
            self._write(key, made)
            return made

        def take(made: Picture | None) -> None:
            self._queue.pop(key, None)
            self._keep(key, made)

        self.lane.start("", make, take)

    def put(self, key: str, picture: Picture) -> None:
        """Keep a picture."""
        self._keep(key, picture)
        self._write(key, picture)

    def _keep(self, key: str, picture: Picture | None) -> None:
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
