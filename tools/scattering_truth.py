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
from translucent import reference
from translucent.bench.cases import CASES, Case
from translucent.bench.drawing import Size
from translucent.bench.truth import StoredTruth, scene_parameters, stored_truth, truth_file
from translucent.errors import InputError
from translucent.files.paths import write_atomically
from translucent.planning.methods import PathTraced
from translucent.scene.scene import Scene

FOLDER = Path(tl.__file__).parent / "bench"


def is_current(one: Case) -> bool:
    """True if the stored truth is that of the scene as it is."""
    try:
        stored_truth(one.name, one.scene((one.compared, one.compared)))
    except InputError:
        return False
    return True


def by_opengl(scene: Scene, size: Size, paths: int) -> StoredTruth:
    """Path trace two independent halves of a scene by `PathTraced` on the GPU."""
    began = time.perf_counter()
    with tl.Renderer() as renderer:
        found = [renderer.render(scene, size, PathTraced(paths, seed)) for seed in (1, 2)]
    seconds = time.perf_counter() - began
    mask = reference.path_trace(scene, size, paths=2, max_events=0)[0].coverage
    halves = np.stack([frame.radiance[mask].astype(np.float64) for frame in found])
    spreads = [frame.standard_error for frame in found]
    error = 0.5 * np.sqrt(sum(spread[mask].astype(np.float64) ** 2 for spread in spreads if spread is not None))
    return StoredTruth(halves, error, mask, scene_parameters(scene), 2 * paths, seconds)


def main(arguments: list[str]) -> None:
    """Trace what is asked for, or what has changed."""
    for one in (case for case in CASES if case.paths):
        wanted = one.name in arguments if arguments and "--all" not in arguments else not is_current(one)
        if not wanted and "--all" not in arguments:
            continue
        size = one.compared, one.compared
        scene = one.scene(size)
        trace = by_opengl if one.by_opengl else StoredTruth.traced
        truth = trace(scene, size, one.paths)
        content = truth.to_bytes()
        write_atomically(FOLDER / truth_file(one.name), lambda path, content=content: path.write_bytes(content))
        print(
            f"{one.name}: {truth.paths} paths, {truth.seconds:.0f} s, mean {truth.halves.mean():.3f}, "
            f"standard error {truth.noise:.1%} of it, {len(content) / 1000:.0f} kB",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
