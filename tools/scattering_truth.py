"""Path trace the truth of the scattering scenes of the report anew, where a scene has changed or with --all.

``python tools/scattering_truth.py [--all | NAME ...]`` writes translucent/bench/scattering_truth/*.npz, the same
for the same seeds; all of them take about twenty minutes of one processor.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.truth import StoredTruth, scene_parameters, stored_truth, truth_file
from translucent.errors import InputError
from translucent.files.paths import write_atomically

FOLDER = Path(tl.__file__).parent / "bench"

#: Seeds of the two halves.
SEEDS = (1, 2)


def trace(one: Case) -> StoredTruth:
    """Path trace two independent halves of a scene."""
    size = one.compared, one.compared
    scene = one.scene(size)
    began = time.perf_counter()
    found = [tl.reference.path_trace(scene, size, one.paths, seed) for seed in SEEDS]
    seconds = time.perf_counter() - began
    mask = found[0][0].coverage
    halves = np.stack([frame.radiance[mask] for frame, _ in found])
    error = 0.5 * np.sqrt(sum(spread[mask] ** 2 for _, spread in found))
    return StoredTruth(halves, error, mask, scene_parameters(scene), 2 * one.paths, seconds)


def is_current(one: Case) -> bool:
    """True if the stored truth is that of the scene as it is."""
    try:
        stored_truth(one.name, one.scene((one.compared, one.compared)))
    except InputError:
        return False
    return True


def store(one: Case, content: bytes) -> None:
    """Write the file of a scene, whole or not at all."""

    def write(path: Path) -> None:
        path.write_bytes(content)

    write_atomically(FOLDER / truth_file(one.name), write)


def main(arguments: list[str]) -> None:
    """Trace what is asked for, or what has changed."""
    for one in (case for case in CASES if case.paths):
        wanted = one.name in arguments if arguments and "--all" not in arguments else not is_current(one)
        if not wanted and "--all" not in arguments:
            continue
        truth = trace(one)
        content = truth.to_bytes()
        store(one, content)
        print(
            f"{one.name}: {truth.paths} paths, {truth.seconds:.0f} s, mean {truth.halves.mean():.3f}, "
            f"standard error {truth.noise:.1%} of it, {len(content) / 1000:.0f} kB",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
