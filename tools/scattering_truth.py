"""Path trace the truth of the scattering scenes of the report anew, where a scene has changed or with --all.

``python tools/scattering_truth.py [--all | NAME ...]`` writes translucent/bench/scattering_truth/*.npz, the same
for the same seeds; all of them take about twenty minutes of one processor.
"""

from __future__ import annotations

import sys
from pathlib import Path

import translucent as tl
from translucent.bench.cases import CASES, Case
from translucent.bench.truth import StoredTruth, stored_truth, truth_file
from translucent.errors import InputError
from translucent.files.paths import write_atomically

FOLDER = Path(tl.__file__).parent / "bench"


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
        size = one.compared, one.compared
        scene = one.scene(size)
        if one.by_opengl:
            with tl.Renderer() as renderer:
                truth = StoredTruth.by_opengl(renderer, scene, size, one.paths)
        else:
            truth = StoredTruth.traced(scene, size, one.paths)
        content = truth.to_bytes()
        store(one, content)
        print(
            f"{one.name}: {truth.paths} paths, {truth.seconds:.0f} s, mean {truth.halves.mean():.3f}, "
            f"standard error {truth.noise:.1%} of it, {len(content) / 1000:.0f} kB",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
