"""Export of files from a worker process: pictures, with transparency or quantities, and turntables."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.frames.animation import check_animation, write_animation
from translucent.frames.writing import SUFFIXES, check_output
from translucent.planning.caustics import Caustics
from translucent.planning.methods import Method
from translucent.planning.scattering import Scattering
from translucent.preview.tasks import Report
from translucent.renderer import Renderer
from translucent.scene.scene import Scene
from translucent.scene.turntable import turntable

Size: TypeAlias = tuple[int, int]

#: Exposure in stops, and the name of the tone curve.
Look: TypeAlias = tuple[float, str]

#: Suffixes of files with a moving picture.
MOVING = (".gif", ".webp", ".mp4")

FPS = 24.0


def check_export(path: str) -> None:
    """Raise before any work is done if a picture or turntable could not be written."""
    suffix = Path(path).suffix.lower()
    if suffix in MOVING:
        return check_animation(Path(path), FPS)
    if suffix not in SUFFIXES:
        raise InputError(f"output {path!r}", f"suffix {suffix!r}", f"use {', '.join((*SUFFIXES, *MOVING))}")
    return check_output(Path(path))


def write_picture(
    report: Report,
    path: str,
    scene: Scene,
    method: Method | None,
    size: Size,
    look: Look = (0.0, "none"),
    transparent: bool = False,
    scattering: Scattering | None = None,
    caustics: Caustics | None = None,
) -> None:
    """Write a .png, or an .exr with all quantities; transparent, it lacks what is seen beside and behind the bodies."""
    report(None, "drawing")
    with Renderer() as renderer:
        ways: dict[str, Any] = {"scattering": scattering, "caustics": caustics}
        frame = renderer.render(scene, size, method, samples=16, transparent=transparent, **ways)
    report(None, "writing")
    frame.save(path, *look)


def write_turntable(
    report: Report,
    path: str,
    scene: Scene,
    method: Method | None,
    size: Size,
    look: Look = (0.0, "none"),
    count: int = 48,
    scattering: Scattering | None = None,
    caustics: Caustics | None = None,
) -> None:
    """Write an animation of the model from all around."""
    with Renderer() as renderer:

        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            for i, seen in enumerate(turntable(scene, count)):
                report(i / count, f"picture {i + 1} of {count}")
                frame = renderer.render(seen, size, method, samples=4, scattering=scattering, caustics=caustics)
                yield frame.to_srgb8(*look)

        write_animation(Path(path), pictures(), FPS)
