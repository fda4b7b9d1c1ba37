"""Path trace the truth of the scattering scenes of the report anew, where a scene has changed or with --all.

``python tools/scattering_truth.py [--all | NAME ...]`` writes translucent/bench/scattering/truth/*.npz, the same for
the same seeds; all of them take about twenty minutes of one processor.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import translucent as tl
from translucent.bench.scattering.scenes import SCENES, ScatteringScene
from translucent.bench.scattering.stored import StoredTruth, file_name, scene_parameters, stored_truth
from translucent.errors import InputError

FOLDER = Path(tl.__file__).parent / "bench" / "scattering" / "truth"

#: Seeds of the two halves.
SEEDS = (1, 2)


def trace(one: ScatteringScene) -> StoredTruth:
    """Path trace two independent halves of a scene."""
    scene, size = one.make(), (one.side, one.side)
    began = time.perf_counter()
    found = [tl.reference.path_trace(scene, size, one.paths, seed) for seed in SEEDS]
    seconds = time.perf_counter() - began
    mask = found[0][0].coverage
    halves = np.stack([frame.radiance[mask] for frame, _ in found])
    error = 0.5 * np.sqrt(sum(spread[mask] ** 2 for _, spread in found))
    return StoredTruth(halves, error, mask, scene_parameters(scene), 2 * one.paths, seconds)


def is_current(one: ScatteringScene) -> bool:
    """True if the stored truth is that of the scene as it is."""
    try:
        stored_truth(one.name, one.make())
    except InputError:
        return False
    return True


def main(arguments: list[str]) -> None:
    """Trace what is asked for, or what has changed."""
    FOLDER.mkdir(exist_ok=True)
    for one in SCENES:
        wanted = one.name in arguments if arguments and "--all" not in arguments else not is_current(one)
        if not wanted and "--all" not in arguments:
            continue
        truth = trace(one)
        content = truth.to_bytes()
        temporary = FOLDER / f".{file_name(one.name)}.part"
        temporary.write_bytes(content)
        temporary.replace(FOLDER / file_name(one.name))
        print(
            f"{one.name}: {truth.paths} paths, {truth.seconds:.0f} s, mean {truth.halves.mean():.3f}, "
            f"standard error {truth.noise:.1%} of it, {len(content) / 1000:.0f} kB",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
