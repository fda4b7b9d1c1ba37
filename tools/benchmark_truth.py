"""Render the truth of the benchmark's scenes, and test it against two other renderers.

``python tools/benchmark_truth.py [NAME ...]``: those named, else all that are missing or whose scene has changed, into
translucent/benchmark/truth/. ``--judge`` renders the others alone, and leaves the
stored pictures as they are; ``--seconds`` gives them longer.

The stored halves are random paths of `PathTraced`, for their number: the reference takes ten to fifty times as long.
The judges are that reference (`translucent.reference.path_trace`: NumPy, float64, other code), and Mitsuba 3 (extra
``truth``), wherever it has words for the scene. Both spread their rays over pixels, and are compared pixel by pixel
with standard errors. ``--larger N`` writes pictures of N times the width and height into out/truth/ instead.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np

import translucent as tl
from translucent import reference
from translucent.arrays import Array, Mask
from translucent.bench.truth import scene_parameters
from translucent.benchmark.export import mitsuba_scene
from translucent.benchmark.scenes import SCENES, BenchmarkScene, scene_named
from translucent.benchmark.truth import (
    TruthAgreement,
    TruthPicture,
    TruthRecord,
    agreement_with,
    read_records,
    stored_truth_of,
    truth_path,
)
from translucent.files.paths import write_text_atomically
from translucent.frames.metrics import interior

#: Noise of a half that is wanted: of clear scenes, and of those that scatter.
WANTED, WANTED_SCATTERING = 0.028, 0.076

#: Paths of a trial, and the fewest and most of a half.
TRIAL, FEWEST, MOST = 32, 128, 3000

#: Paths begin at the centers of so many parts of each pixel, across and down: its mean is that of a box filter. More of
#: them where nothing else is random.
PARTS, PARTS_SHARP = 4, 8

#: Processor time that a judge takes for a scene, in seconds, and the noise that is enough.
JUDGE_SECONDS, JUDGE_NOISE = 4.0, 0.03

#: Batches of Mitsuba, whose spread is its standard error.
BATCHES = 8


def halves_of(
    renderer: tl.Renderer, scene: BenchmarkScene, size: tuple[int, int], mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int, float]:
    """Two halves, standard error of their mean, paths of each, processor time."""
    parts = PARTS_SHARP if scene.sharp else PARTS
    made, fine = scene.make(), (parts * size[0], parts * size[1])
    begin = time.process_time()
    trial = renderer.render(made, size, tl.PathTraced(TRIAL, 9))
    spread, shown = (np.asarray(part, np.float64)[mask] for part in (trial.standard_error, trial.radiance))
    noise = float(np.sqrt((spread**2).mean()) / shown.mean())
    wanted = WANTED_SCATTERING if "scattering" in scene.needs else WANTED
    wished = np.clip(TRIAL * (noise / wanted) ** 2, FEWEST, MOST)
    each = max(int(np.ceil(wished / parts**2)), 2)
    halves, variance = [], np.zeros((size[1], size[0], 3))
    for seed in (1, 2):
        frame = renderer.render(made, fine, tl.PathTraced(each, seed))
        halves.append(means(np.asarray(frame.radiance, np.float64), size))
        variance += means(np.asarray(frame.standard_error, np.float64) ** 2, size) / parts**2
    return np.stack(halves).astype(np.float32), 0.5 * np.sqrt(variance), each * parts**2, time.process_time() - begin


def means(fine: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Means over the parts of each pixel."""
    return fine.reshape(size[1], len(fine) // size[1], size[0], len(fine) // size[1], -1).mean(axis=(1, 3))


def by_reference(
    scene: BenchmarkScene, truth: tuple[np.ndarray, np.ndarray], seconds: float = JUDGE_SECONDS
) -> TruthAgreement:
    """The float64 reference, at half the size, as long as its time allows: by random paths where media scatter or
    opaque objects are, and else by rays that take every branch (`light_over_pixels`), which have less noise.
    """
    made, size = scene.make(), (scene.size[0] // 2, scene.size[1] // 2)
    halved = means(truth[0], size), np.sqrt(means(truth[1] ** 2, size) / 4)
    begin = time.process_time()
    if "scattering" in scene.needs or "shadows" in scene.needs or "sheets" in scene.needs or scene.sharp:
        tl.reference.path_trace(made, (16, 16), 8, 5, spread=True)
        each = (time.process_time() - begin) / 8 * (size[0] / 16) ** 2
        paths = int(np.clip(seconds / max(each, 1e-3), 8, 256 * max(seconds / JUDGE_SECONDS, 1)))
        frame, error = tl.reference.path_trace(made, size, paths, 5, spread=True)
        return agreement_with("reference, random paths", paths, halved, (frame.radiance, error))
    everywhere = np.ones(size[::-1], bool)
    parts = []
    while len(parts) < 4 or (time.process_time() - begin < seconds and len(parts) < 16):
        found, _ = tl.reference.light_over_pixels(made, size, everywhere, 2, 1e-5, 128, len(parts))
        parts.append(found.reshape(*size[::-1], 3))
    error = np.std(parts, axis=0, ddof=1) / np.sqrt(len(parts))
    return agreement_with("reference, all branches", 2 * len(parts), halved, (np.mean(parts, axis=0), error))


def by_mitsuba(
    scene: BenchmarkScene, truth: tuple[np.ndarray, np.ndarray], seconds: float = JUDGE_SECONDS
) -> TruthAgreement:
    """Mitsuba 3, in batches with seeds of their own."""
    try:
        mitsuba: Any = importlib.import_module("mitsuba")
    except ImportError:
        return TruthAgreement("Mitsuba", 0, explained="not installed here: pip install mitsuba")
    mitsuba.set_variant("llvm_ad_rgb")
    name = f"Mitsuba {mitsuba.__version__}"
    made = scene.make()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            described = mitsuba_scene(made, scene.size)
        described["sensor"]["far_clip"] = 1e9  # of a body 2000 m away
        loaded = mitsuba.load_dict(described)
    except tl.InputError as error:
        return TruthAgreement(name, 0, explained=str(error).split("; ")[1])
    begin = time.process_time()
    pair = [np.array(mitsuba.render(loaded, spp=TRIAL, seed=seed), np.float64) for seed in (90, 91)]
    each = (time.process_time() - begin) / (2 * TRIAL)
    noise = float(np.sqrt(((pair[0] - pair[1]) ** 2).mean() / 2) / pair[0].mean())
    paths = int(np.clip(TRIAL * (noise / JUDGE_NOISE) ** 2, 256, seconds / max(each, 1e-4)))
    parts = np.stack([np.array(mitsuba.render(loaded, spp=paths // BATCHES + 1, seed=s)) for s in range(BATCHES)])
    parts = parts.astype(np.float64)
    error = parts.std(axis=0, ddof=1) / np.sqrt(BATCHES)
    return agreement_with(name, paths, truth, (parts.mean(axis=0), error), EXPLAINED.get(scene.name, ""))


#: Why Mitsuba differs on a scene.
EXPLAINED = dict.fromkeys(
    ("frosted-ball", "frosted-pebble"), "its rough dielectrics have no scattering among facets, and lose light"
)


def is_current(scene: BenchmarkScene) -> bool:
    """True if the stored truth is that of the scene as it is."""
    try:
        stored_truth_of(scene)
    except tl.InputError:
        return False
    return True


def geometry_truth(scene: BenchmarkScene) -> tuple[Mask, Array | None]:
    """Pixels that show something of a scene, and thickness in metres where it is defined; by the reference, float64."""
    made, size = scene.make(), scene.size
    counts = reference.hit_counts(made, size)
    opaque = reference.opaque_counts(made, size)
    mask = counts > 0
    away = interior(counts)
    for found in opaque:
        mask |= found > 0
        away &= interior(found)
    if not scene.thickness:
        return mask, None
    frame = reference.render(made, size, bounces=1)
    return mask, np.where(away & frame.valid, frame.thickness, np.nan).astype(np.float32)


def write_records(records: dict[str, TruthRecord]) -> None:
    """Write the records of all stored truths."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(one) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        return float(f"{value:.4g}") if isinstance(value, float) else value

    ordered = {name: plain(asdict(records[name])) for name in sorted(records)}
    text = json.dumps(ordered, indent=1).replace("NaN", "null") + "\n"
    path = truth_path("x").with_name("agreement.json")
    path.parent.mkdir(exist_ok=True)
    write_text_atomically(path, text)


@click.command()
@click.argument("names", nargs=-1)
@click.option("--judge", is_flag=True, help="Leave the stored pictures; render the judges anew.")
@click.option("--larger", default=1, help="Write pictures so many times as wide and high into out/truth/ instead.")
@click.option("--seconds", default=JUDGE_SECONDS, help="Processor time of each judge for each scene.")
def main(names: tuple[str, ...], judge: bool, larger: int, seconds: float) -> None:
    """Render truths that are missing or out of date, or those NAMED."""
    records = read_records()
    chosen = [scene_named(name) for name in names] or [
        scene for scene in SCENES if judge or larger > 1 or not is_current(scene)
    ]
    with tl.Renderer() as renderer:
        for scene in chosen:
            size = scene.size[0] * larger, scene.size[1] * larger
            mask, thickness = geometry_truth(scene)
            judged = np.kron(mask, np.ones((larger, larger), bool))
            if judge:
                found = stored_truth_of(scene)
                before = records.get(scene.name)
                spread = np.abs(found.halves[0].astype(np.float64) - found.halves[1]) / 2
                judge_of(scene, found, spread, 0.0 if before is None else before.seconds, seconds)
                continue
            halves, error, paths, taken = halves_of(renderer, scene, size, judged)
            if larger > 1:
                folder = Path("out/truth")
                folder.mkdir(parents=True, exist_ok=True)
                TruthPicture(halves, judged, None, scene_parameters(scene.make()), 2 * paths).write(
                    folder / f"{scene.name}.exr"
                )
                continue
            found = TruthPicture(halves, mask, thickness, scene_parameters(scene.make()), 2 * paths)
            truth_path(scene.name).parent.mkdir(exist_ok=True)
            found.write(truth_path(scene.name))
            judge_of(scene, found, error, taken, seconds)


def judge_of(scene: BenchmarkScene, found: TruthPicture, error: np.ndarray, taken: float, seconds: float) -> None:
    """Let the judges render a scene, and keep and print what they say of its truth with a standard error (h, w, 3)."""
    truth = found.radiance, error
    agreements = by_reference(scene, truth, seconds), by_mitsuba(scene, truth, seconds)
    write_records({**read_records(), scene.name: TruthRecord(found.paths, found.noise, taken, agreements)})
    said = "; ".join(
        f"{one.renderer}: {one.within:.1%} within 4, bias {one.bias:+.2%}, noise {one.noise:.1%}, {one.paths}"
        if one.paths
        else f"{one.renderer}: {one.explained}"
        for one in agreements
    )
    print(f"{scene.name}: {found.paths} paths, {taken:.0f} s, noise {found.noise:.2%}; {said}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
