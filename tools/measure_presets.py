"""Mean color of each named medium on the ball, as the planner draws it, against path-traced truth.

``python tools/measure_presets.py [--all | --drawn | NAME ...]`` measures the presets that
``docs/presets/measured.json`` lacks, or has with other numbers, or those that are named, and writes that file; with
``--drawn`` pictures alone are made anew, and compared with the truths that it holds. Each is rendered on the toolkit's
ball (4 cm) in the environments of three stages, without their ground and their lights. The truth is `PathTraced`, with
as many paths as it takes until the standard error of the mean color of each channel is at most a fiftieth of it, or for
a minute of the processor. Both see the ball at the same points, the centers of the pixels; but the picture sees the
environment averaged over their footprints, as far as it is mirrored or refracted.
"""

from __future__ import annotations

import argparse
import json
import time
from datetime import date
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import translucent as tl
from translucent.assets import mesh_path
from translucent.files.paths import write_text_atomically
from translucent.media.preset import Preset
from translucent.scene.stages import STAGES

FILE = Path(__file__).resolve().parents[1] / "docs" / "presets" / "measured.json"

#: Stages whose environments light the ball.
ENVIRONMENTS = ("studio", "daylight", "night")

#: Pixels along a side, of the picture and of the truth.
SIDE = 24

#: Paths of a pixel in a round of the truth; the standard error at which no more are needed, and the seconds of the
#: processor.
PATHS, ENOUGH, SECONDS = 16, 0.02, 60.0


def scene_of(preset: Preset, environment: str) -> tl.Scene:
    """The ball, filled with a preset, in the environment of a stage."""
    ball = tl.Object(tl.load_mesh(mesh_path("sphere")), preset.medium, surface=tl.Surface(roughness=preset.roughness))
    camera = tl.Camera.framing(ball.mesh.vertices, (SIDE, SIDE), direction=(-0.35, -0.3, -1.0), fov_y=28.0)
    return tl.Scene([ball], camera, environment=STAGES[environment].environment())


def truth_of(renderer: tl.Renderer, scene: tl.Scene, mask: npt.NDArray[np.bool_]) -> tuple[Any, Any, int]:
    """Mean color (3,) of the pixels of a mask by random paths, its standard error (3,), and paths of each pixel."""
    means, errors = [], []
    began = time.process_time()
    for seed in count():
        frame = renderer.render(scene, (SIDE, SIDE), tl.PathTraced(PATHS, seed))
        assert frame.standard_error is not None
        means.append(frame.radiance[mask].mean(axis=0, dtype=np.float64))
        errors.append((frame.standard_error[mask].astype(np.float64) ** 2).sum(axis=0) / mask.sum() ** 2)
        mean, error = np.mean(means, axis=0), np.sqrt(np.sum(errors, axis=0)) / len(errors)
        if (error <= ENOUGH * mean).all() or (len(means) > 1 and time.process_time() - began > SECONDS):
            return mean, error, PATHS * len(means)
    raise AssertionError


def measure(
    renderer: tl.Renderer, preset: Preset, environments: list[str], known: dict[str, Any] | None
) -> dict[str, Any]:
    """Mean colors of a preset in environments; `known`: rows whose truth is kept and whose picture is drawn anew."""
    rows = {}
    for environment in environments if known is None else known:
        scene = scene_of(preset, environment)
        counts = tl.reference.hit_counts(scene, (SIDE, SIDE))
        mask = tl.interior(counts) & (counts > 0)
        drawn = renderer.render(scene, (SIDE, SIDE), samples=1).radiance[mask].mean(axis=0, dtype=np.float64)
        if known is None:
            truth, error, paths = truth_of(renderer, scene, mask)
            rows[environment] = {"truth": truth.tolist(), "error": error.tolist(), "paths": paths}
        else:
            rows[environment] = {name: known[environment][name] for name in ("truth", "error", "paths")}
        rows[environment]["drawn"] = drawn.tolist()
        mean, error = (np.array(rows[environment][name]) for name in ("truth", "error"))
        print(
            f"{preset.name:26} {environment:9} {np.round(drawn / mean, 3)} +- {np.round(error / mean, 3)} "
            f"mean {np.round(mean, 4)}",
            flush=True,
        )
    return rows


def numbers_of(preset: Preset) -> list[Any]:
    """Numbers that the measurement of a preset depends on."""
    medium = preset.medium
    values = [medium.absorption, medium.scattering, medium.anisotropy, medium.ior, preset.roughness]
    return [np.asarray(value).tolist() for value in values]


def main() -> None:
    """Measure what is asked for, or has changed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--drawn", action="store_true", help="pictures alone anew, against the truths that are known")
    parser.add_argument("--all", action="store_true", help="all presets anew")
    parser.add_argument(
        "--environment", action="append", choices=ENVIRONMENTS, help="no other; may be repeated. Default: all"
    )
    asked = parser.parse_args()
    known = json.loads(FILE.read_text(encoding="utf-8"))["presets"] if FILE.is_file() else {}
    wanted = [tl.preset(name) for name in asked.names] or [
        one
        for one in tl.presets().values()
        if asked.all
        or (one.name in known if asked.drawn else known.get(one.name, {}).get("numbers") != numbers_of(one))
    ]
    environments = asked.environment or list(ENVIRONMENTS)
    with tl.Renderer() as renderer:
        for one in wanted:
            old = known[one.name]["colors"] if asked.drawn else None
            before, numbers = known.get(one.name, {}), numbers_of(one)
            kept_colors = before["colors"] if before.get("numbers") == numbers else {}
            colors = {**kept_colors, **measure(renderer, one, environments, old)}
            known[one.name] = {"numbers": numbers, "colors": colors}
            kept = {name: known[name] for name in tl.presets() if name in known}
            day = date.today().isoformat()
            data = {"written": day, "renderer": renderer.provenance["renderer"], "side": SIDE, "presets": kept}
            FILE.parent.mkdir(exist_ok=True)
            write_text_atomically(FILE, json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
