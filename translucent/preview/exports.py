"""Files that the previewer draws in the background: pictures, with transparency or quantities, and turntables."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from translucent.animation import check_animation, write_animation
from translucent.color import exposure_scale, linear_to_srgb
from translucent.errors import InputError
from translucent.frame import SUFFIXES, Frame, check_output, write_atomically
from translucent.medium import Medium
from translucent.preview.measuring import Measuring, Size
from translucent.preview.tasks import Task
from translucent.scene import Scene
from translucent.thickness import Method
from translucent.tone import tone_curve
from translucent.turntable import turntable

#: Of files with a moving picture.
MOVING = (".gif", ".webp", ".mp4")

FPS = 24.0


def check_export(path: str) -> None:
    """Raise before any work is done where a picture or turntable could not be written."""
    suffix = Path(path).suffix.lower()
    if suffix in MOVING:
        return check_animation(Path(path), FPS)
    if suffix not in SUFFIXES:
        raise InputError(f"output {path!r}", f"suffix {suffix!r}", f"use {', '.join((*SUFFIXES, *MOVING))}")
    return check_output(Path(path))


def write_picture(
    measuring: Measuring,
    task: Task,
    path: str,
    scene: Scene,
    method: Method | None,
    size: Size,
    look: tuple[float, str] = (0.0, "none"),
    transparent: bool = False,
) -> None:
    """Write a .png (of the body alone, if transparent) or an .exr with all quantities."""
    task.report(None, "drawing")
    frame = measuring.renderer.render(scene, size, method, samples=16)
    task.report(None, "writing")
    if not (transparent and Path(path).suffix.lower() == ".png"):
        frame.save(path, *look)
        return
    write_atomically(Path(path), partial(_write_rgba, pixels=cut_out(measuring, scene, frame, size, method, look)))


def cut_out(
    measuring: Measuring, scene: Scene, frame: Frame, size: Size, method: Method | None, look: tuple[float, str]
) -> npt.NDArray[np.uint8]:
    """(h, w, 4): the bodies with what is seen through them, and nothing beside them; smooth at the edges."""
    # Coverage is the opacity of the same bodies filled with what nothing passes.
    dense = Medium(absorption=1e6 / max(scene.diagonal, 1e-9))
    bodies = [dataclasses.replace(item, medium=dense, surface=None) if item.medium else item for item in scene.objects]
    shadow = measuring.renderer.render(dataclasses.replace(scene, objects=bodies), size, method, samples=16)
    coverage = 1.0 - shadow.transmittance.mean(axis=2)
    exposure, tone = look
    curve = tone_curve(tone)
    color = linear_to_srgb(curve(frame.radiance * exposure_scale(exposure)))
    alpha = np.clip(coverage, 0.0, 1.0)[..., None]
    return np.asarray(np.rint(np.concatenate([np.clip(color, 0, 1), alpha], axis=2) * 255.0), dtype=np.uint8)


def _write_rgba(path: Path, pixels: npt.NDArray[np.uint8]) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, format="PNG")


def write_turntable(
    measuring: Measuring,
    task: Task,
    path: str,
    scene: Scene,
    method: Method | None,
    size: Size,
    look: tuple[float, str] = (0.0, "none"),
    count: int = 48,
) -> None:
    """Write an animation of the model from all around."""

    def pictures() -> Iterator[npt.NDArray[np.uint8]]:
        for i, seen in enumerate(turntable(scene, count)):
            task.report(i / count, f"picture {i + 1} of {count}")
            yield measuring.renderer.render(seen, size, method, samples=4).to_srgb8(*look)

    write_animation(Path(path), pictures(), FPS)
