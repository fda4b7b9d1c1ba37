"""Turntables, views of a scene from all around, and other animations, as numbered pictures or a film."""

from __future__ import annotations

import dataclasses
import subprocess
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arrays import Array, Pixels
from translucent.errors import InputError
from translucent.extras import require_package
from translucent.files.paths import require_folder, require_output, write_atomically
from translucent.frames.writing import write_pictures
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Scene
from translucent.scene.stages import moved, with_shadows

#: Constant rate factor of H.264, 0 to 51: the loss is hardly visible.
_RATE_FACTOR = 10

#: Largest number of characters of ffmpeg's output in an error.
_MOST_TOLD = 120

#: Pictures per second unless requested otherwise.
DEFAULT_FPS = 24.0

#: Slices of a model, and points around each, that enclose it as it turns.
CUTS, POINTS_AROUND = 32, 48


def write_film(path: Path, pictures: Iterator[Pixels], fps: float) -> None:
    """Write an ``.mp4`` that every player reads: H.264, 4:2:0.

    Raises
    ------
    OSError
        If ffmpeg fails, or the film that it leaves does not have all pictures.
    """
    import imageio_ffmpeg

    first = _even(next(pictures))
    command = [imageio_ffmpeg.get_ffmpeg_exe(), *_arguments(first.shape[1], first.shape[0], fps), str(path)]
    count = 0
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        output = _FilmOutput(ffmpeg)
        try:
            for picture in chain([first], pictures):
                ffmpeg.stdin.write(_even(picture).tobytes())
                count += 1
            ffmpeg.stdin.close()
        except BrokenPipeError:  # it has given up, and says why
            with suppress(BrokenPipeError):
                ffmpeg.stdin.close()
        except BaseException:
            ffmpeg.kill()
            raise
        why = output.line()
    if ffmpeg.returncode != 0:
        raise OSError(f"ffmpeg ended with status {ffmpeg.returncode}{why and f': {why}'}")
    # It ends well, too, where the disk was full when it wrote the last of the film.
    try:
        found = imageio_ffmpeg.count_frames_and_secs(str(path))[0]
    except RuntimeError:
        found = 0
    if found != count:
        raise OSError(f"the film has {found} of {count} pictures{why and f': {why}'}")


def _arguments(width: int, height: int, fps: float) -> list[str]:
    rate = str(Fraction(fps).limit_denominator())
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", rate, "-i", "-"]
    made = ["-an", "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", str(_RATE_FACTOR)]
    return ["-y", "-xerror", "-v", "error", *given, *made]


class _FilmOutput:
    """Reader of a process's error output, so that the process never blocks on a full pipe."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._said = b""
        self._process = process
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        self._said = self._process.stderr.read()

    def line(self) -> str:
        """First line that the film encoder has printed, after it has ended."""
        self._thread.join()
        lines = self._said.decode(errors="replace").strip().splitlines()
        return lines[0][:_MOST_TOLD] if lines else ""


def _even(picture: Pixels) -> Pixels:
    """Pad a picture to even size by repeating its last row and column: color is stored for 2 by 2 pixels."""
    height, width = picture.shape[:2]
    return np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")


def check_animation(path: Path, fps: float) -> None:
    """Raise before any work is done if an animation could not be written to `path`.

    Raises
    ------
    InputError
        If it has a suffix of no animation, there is no folder for it, or the rate is not in 1 to 100.
    RenderError
        If a film is requested without the imageio-ffmpeg package.
    """
    if not 1.0 <= fps <= 100.0:
        raise InputError(f"{fps} pictures per second", "the frame rate must lie in 1 to 100", "use a value such as 24")
    what = f"animation {str(path)!r}"
    if path.is_dir() or not path.suffix:
        require_folder(path, what)
        return
    if path.suffix.lower() not in WRITERS:
        raise InputError(
            what,
            f"suffix {path.suffix!r}",
            f"use {', '.join(WRITERS)}, or a folder",
        )
    require_output(path, what)
    if path.suffix.lower() == ".mp4":
        require_package("imageio_ffmpeg", what, "use .webp or .gif")


def write_animation(path: str | Path, frames: Iterable[Pixels], fps: float = DEFAULT_FPS) -> None:
    """Write frames as they are rendered: an animated ``.webp`` or ``.gif`` that repeats, an ``.mp4``, or a folder of
    PNG files.

    A file appears complete or not at all; in a folder each picture does, as 0000.png and so on.

    Parameters
    ----------
    path : str or Path
        Without a suffix, or of a folder that is there: a folder.
    frames : iterable of (h, w, 3) uint8
        At least one, sRGB-encoded, all of one size.
    fps : float
        Pictures per second, 1 to 100; a folder has none.

    Raises
    ------
    InputError
        If the suffix is another, there is no frame, their sizes differ, or the rate is beyond these.
    RenderError
        If a file cannot be written, or ``.mp4`` is requested without the imageio-ffmpeg package.
    """
    path = Path(path)
    check_animation(path, fps)
    pictures = _alike(frames)
    if path.is_dir() or not path.suffix:
        write_pictures(path, ((f"{i:04}", picture) for i, picture in enumerate(pictures)))
        return
    write_atomically(path, partial(WRITERS[path.suffix.lower()], pictures=pictures, fps=fps))


def _alike(frames: Iterable[Pixels]) -> Iterator[Pixels]:
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise InputError("animation", "the animation has no frames", "give at least one frame")

    def checked() -> Iterator[Pixels]:
        for i, picture in enumerate(chain([first], pictures)):
            if picture.shape != first.shape or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
                found = f"the frame has the shape {picture.shape} and the type {picture.dtype}"
                raise InputError(
                    f"frame {i} of an animation", found, "give arrays (h, w, 3) of uint8, all of the same size"
                )
            yield picture

    return checked()


def _write_with_pillow(path: Path, pictures: Iterator[Pixels], fps: float, **options: Any) -> None:
    from PIL import Image

    images = (Image.fromarray(picture) for picture in pictures)
    first = next(images)
    with path.open("wb") as stream:
        first.save(stream, save_all=True, append_images=images, duration=round(1000.0 / fps), loop=0, **options)


WRITERS: dict[str, Callable[..., None]] = {
    ".webp": partial(_write_with_pillow, format="WEBP", quality=90, method=4),
    ".gif": partial(_write_with_pillow, format="GIF"),
    ".mp4": write_film,
}


def turntable(scene: Scene, count: int) -> Iterator[Scene]:
    """Scenes of a turntable from `count` sides: the camera orbits the center of the objects once, about +Y.

    Seen from above it goes counterclockwise. Environment and background go with it, so that the model seems to turn
    before them; lights stay with the model. On a stage, with a shadow catcher, ground and lights go with the camera.

    Raises
    ------
    InputError
        If the count is not a whole number above 1.
    """
    if not isinstance(count, int) or count < 2:
        raise InputError(
            f"turntable of {count!r} pictures",
            "the number of pictures must be a whole number above 1",
            "use a value such as 36",
        )
    center = scene.shown_bounds.mean(axis=0)
    for i in range(count):
        angle = 360.0 * i / count
        turn = _about(center, angle)
        camera = dataclasses.replace(scene.camera, pose=turn @ scene.camera.pose)
        view = dataclasses.replace(scene, camera=camera, environment=_turned(scene.environment, angle))
        yield _with_stage_turned(view, turn) if on_stage(scene) else view


def framed_all_around(scene: Scene, size: tuple[int, int]) -> Scene:
    """Scene with its camera far enough away to show the whole model from every side of a `turntable`.

    An orthographic camera stays where it is.
    """
    camera = scene.camera
    if camera.fov_y is None:
        return scene
    points = swept_points(scene)
    if on_stage(scene):
        points = with_shadows(points, scene.lights)
    return dataclasses.replace(
        scene, camera=Camera.framing(points, size, direction=camera.forward, fov_y=camera.fov_y, up=camera.up)
    )


def swept_points(scene: Scene) -> Array:
    """(n, 3): points that enclose a model while it turns on a turntable, about +Y through the center of its bounds."""
    center = scene.shown_bounds.mean(axis=0)
    offsets = np.concatenate(
        [
            item.mesh.vertices[np.unique(item.mesh.faces)] @ item.matrix[:3, :3].T + (item.matrix[:3, 3] - center)
            for item in scene.shown
        ]
    )
    radius, height = np.hypot(offsets[:, 0], offsets[:, 2]), offsets[:, 1]
    low, high = height.min(), height.max()
    cut = np.minimum((CUTS * (height - low) / ((high - low) or 1.0)).astype(np.intp), CUTS - 1)
    widest = np.zeros(CUTS)
    np.maximum.at(widest, cut, radius)
    angles = 2.0 * np.pi * np.arange(POINTS_AROUND) / POINTS_AROUND
    # A ring of points around a circle has to be wider than that, for its sides to enclose it.
    around = np.stack([np.cos(angles), np.zeros(POINTS_AROUND), np.sin(angles)], axis=1) / np.cos(np.pi / POINTS_AROUND)
    edges = np.linspace(low, high, CUTS + 1)
    rings = [
        radius * around + np.array([0.0, level, 0.0])
        for i, radius in enumerate(widest)
        if radius > 0
        for level in (edges[i], edges[i + 1])
    ]
    return np.asarray(np.concatenate(rings or [offsets]) + center)


def _about(center: Array, angle: float) -> Array:
    """(4, 4): a turn about +Y through a point, counterclockwise as seen from above, in degrees."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    matrix = np.eye(4)
    matrix[:3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    matrix[:3, 3] = center - matrix[:3, :3] @ center
    return matrix


def on_stage(scene: Scene) -> bool:
    """True if a scene has a shadow catcher."""
    return any(item.shadow_catcher for item in scene.objects)


def _with_stage_turned(scene: Scene, turn: Array) -> Scene:
    """Scene with its shadow catchers and lights turned."""
    objects = [
        dataclasses.replace(item, transform=turn @ item.matrix) if item.shadow_catcher else item
        for item in scene.objects
    ]
    return dataclasses.replace(scene, objects=objects, lights=[moved(light, turn) for light in scene.lights])


def _turned(environment: Environment, angle: float) -> Environment:
    background = environment.background and _turned(environment.background, angle)
    return dataclasses.replace(environment, rotation=environment.rotation + angle, background=background)
