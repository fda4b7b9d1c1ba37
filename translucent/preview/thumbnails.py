"""Thumbnails of materials, environments and models: drawn in a worker process, cached on disk."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.assets import newest_shader
from translucent.errors import TranslucentError
from translucent.files.folders import cache_folder, make_folder
from translucent.files.images import write_png
from translucent.files.paths import write_atomically
from translucent.formulas.color import linear_to_srgb
from translucent.formulas.tone import tone_curve
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Sphere
from translucent.media.preset import Preset
from translucent.planning.shadow_maps import ShadowMaps
from translucent.preview.tasks import Lane, Report, Task
from translucent.renderer import Renderer
from translucent.scene.camera import Camera
from translucent.scene.environment_map import texel_directions
from translucent.scene.scene import Scene
from translucent.scene.showcase import named_environment, showcase, with_roughness
from translucent.scene.stages import DEFAULT_STAGE, STAGED_TONE, stage_named
from translucent.version import VERSION

Picture = npt.NDArray[np.uint8]

#: Sides in pixels of pictures of media, environments and models.
BALL, PANORAMA, MODEL = (96, 96), (128, 64), (120, 80)

#: Radius of the ball in metres: a body of some centimetres, for which most media are known.
RADIUS = 0.01

#: Samples of a pixel, and directions of the environment that throw shadows.
SAMPLES, SHADOWS = 4, ShadowMaps(directions=8)

#: Version of how the pictures are made, raised when they change: kept ones are then made again.
LOOK = 1


def ball_key(one: Preset) -> str:
    """Key of the picture of a preset: of its content, and of the version."""
    medium = one.medium
    values = (
        medium.absorption,
        medium.scattering,
        medium.emission,
        medium.phase_function.parameters,
        medium.ior,
        one.roughness,
    )
    return _key("ball", BALL, *(np.asarray(value, dtype=np.float64).tolist() for value in values))


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


def draw_ball(report: Report, one: Preset) -> Picture:
    """Draw a ball of a medium on the default stage."""
    scene = with_roughness(showcase(_ball(), one.medium, BALL), one.roughness or None)
    frame = _renderer(newest_shader()).render(_closer(scene), BALL, samples=SAMPLES, shadows=SHADOWS)
    return np.ascontiguousarray(frame.to_srgb8(0.0, STAGED_TONE))


def draw_panorama(report: Report, name: str) -> Picture:
    """Draw all directions of an environment; pictures as bright as makes their middle gray."""
    width, height = PANORAMA
    lit = named_environment(name)
    if lit.map is not None:
        light = lit.map.reduced(height, width)
        middle = float(np.median(light.mean(axis=-1)))
        return _encoded(np.minimum(light * (0.35 / middle if middle > 0 else 1.0), 1e4))
    places = np.moveaxis(np.indices((width, height)) / height, 0, -1).swapaxes(0, 1)
    return _encoded(lit.radiance(texel_directions(height, width), places))


def _encoded(light: Array) -> Picture:
    with np.errstate(under="ignore"):
        return np.rint(255.0 * np.clip(linear_to_srgb(tone_curve(STAGED_TONE)(light)), 0.0, 1.0)).astype(np.uint8)


def model_picture(seen: Picture) -> Picture:
    """Small picture of a view, from its middle."""
    from PIL import Image, ImageOps

    return np.asarray(ImageOps.fit(Image.fromarray(seen), MODEL, Image.Resampling.BOX))


@lru_cache(maxsize=1)
def _ball() -> Mesh:
    return Sphere(radius=RADIUS).tessellate()


def _closer(scene: Scene) -> Scene:
    """Scene seen from where the ball fills the picture."""
    stage = stage_named(DEFAULT_STAGE)
    assert stage is not None
    camera = Camera.framing(scene.objects[0].mesh.vertices, BALL, stage.view)
    return dataclasses.replace(scene, camera=camera)


@lru_cache(maxsize=1)
def _renderer(written: float) -> Renderer:
    """Renderer of the worker process, for one version of the shaders."""
    return Renderer()


#: Pictures that are read from the disk in one frame.
READ_AT_ONCE = 4

#: Largest number of pictures in memory.
MOST_KEPT = 1024


class ThumbnailCache:
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
