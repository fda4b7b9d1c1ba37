"""Measure what loading takes: processor seconds and memory of `load_mesh` and its diagnosis, beside trimesh's.

    python tools/measure_loading.py [SUBDIVISIONS] [--formats glb,stl,ply,obj] [--rounds 3] [--json OUT]

Writes a dented ball of 20 * 4^SUBDIVISIONS triangles (8: 1.3 million, 9: 5.2 million) into a temporary folder in each
format, and reads it in turns (A B C A B C), after a small file of the same format, so that no import is counted:

- `trimesh.load`, as it is called without arguments: of .stl it welds what is equal, of .glb it makes views of the file;
- `trimesh.load_mesh`, which joins the parts of a scene;
- `trimesh.load_mesh`, and then what `load_mesh` makes sure of: welding, winding, closedness, parts, volume;
- `tl.load_mesh`, and then `mesh.diagnosis`.

Seconds are those of the processor, the median of the rounds: other programs do not count. Memory is the largest that a
process of its own holds while it loads and diagnoses, less what it held before, beside the arrays of the mesh as they
are kept (float64 and int32), and the file.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FORMATS = ("glb", "stl", "ply", "obj")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("subdivisions", nargs="?", type=int, default=8)
    parser.add_argument("--formats", default=",".join(FORMATS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--memory-of", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.memory_of:
        print(json.dumps(_memory(given.memory_of)))
        return
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for suffix in given.formats.split(","):
            path = _written(Path(folder), suffix, given.subdivisions)
            small = _written(Path(folder), suffix, 1)
            rows.append(_measured(path, small, given.rounds))
            path.unlink()
            print(_line(rows[-1]), flush=True)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=2) + "\n")


def _written(folder: Path, suffix: str, subdivisions: int) -> Path:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    dented = ball.vertices * (1 + 0.15 * np.sin(5 * x) * np.cos(4 * y) * np.sin(3 * z))[:, None]
    path = folder / f"ball-{subdivisions}.{suffix}"
    trimesh.Trimesh(dented, ball.faces, process=False).export(path)
    return path


def _measured(path: Path, small: Path, rounds: int) -> dict[str, Any]:
    """Row of a file: median processor seconds of each contender, and memory."""
    import trimesh

    from translucent.mesh_files import load_mesh

    contenders: dict[str, Callable[[Path], object]] = {
        "trimesh": lambda path: trimesh.load(path),
        "trimesh, joined": lambda path: trimesh.load_mesh(path),
        "trimesh, checked": lambda path: _checked(trimesh.load_mesh(path)),
        "load_mesh": lambda path: load_mesh(path),
        "load_mesh, diagnosed": lambda path: load_mesh(path).diagnosis,
    }
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for contender in contenders.values():
            contender(small)
        for _ in range(rounds):
            for name, contender in contenders.items():
                begun = time.process_time()
                contender(path)
                seconds[name].append(time.process_time() - begun)
    told = subprocess.run(
        [sys.executable, __file__, "--memory-of", str(path)], check=True, capture_output=True, text=True
    ).stdout
    median = {name: statistics.median(found) for name, found in seconds.items()}
    return {"format": path.suffix[1:], "file": path.stat().st_size, "seconds": median} | json.loads(told)


def _checked(mesh: Any) -> tuple[object, ...]:
    """Checks that `load_mesh` and a diagnosis make, asked of trimesh."""
    mesh.merge_vertices()
    return mesh.is_watertight, mesh.is_winding_consistent, mesh.body_count, mesh.volume


def _memory(path: Path) -> dict[str, int]:
    """Bytes that loading takes at most, those of the mesh that it makes, and its triangles."""
    from translucent.mesh_files import load_mesh

    with tempfile.TemporaryDirectory() as folder:
        load_mesh(_written(Path(folder), path.suffix[1:], 1)).diagnosis  # noqa: B018
    before = _peak()
    mesh = load_mesh(path)
    loaded = _peak()
    mesh.diagnosis  # noqa: B018
    held = mesh.vertices.nbytes + mesh.faces.nbytes
    return {"loading": loaded - before, "diagnosing": _peak() - before, "held": held, "triangles": len(mesh.faces)}


def _peak() -> int:
    """Largest number of bytes that this process has held."""
    status = Path("/proc/self/status")
    if status.exists():  # what getrusage tells includes the process that started this one
        (line,) = [line for line in status.read_text().splitlines() if line.startswith("VmHWM")]
        return 1024 * int(line.split()[1])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _line(row: dict[str, Any]) -> str:
    plain, whole, checked, ours, diagnosed = row["seconds"].values()
    return (
        f"{row['format']}, {row['triangles']} triangles: trimesh.load {plain:.3f} s, load_mesh {whole:.3f} s, "
        f"checked {checked:.2f} s; tl.load_mesh {ours:.3f} s "
        f"({ours / plain:.2f}, {ours / whole:.2f} and {ours / checked:.2f} times), diagnosed {diagnosed:.3f} s "
        f"({diagnosed / checked:.2f} times); file {row['file'] / 1e6:.0f} MB, mesh {row['held'] / 1e6:.0f} MB, "
        f"at most {row['loading'] / 1e6:.0f} MB to load, {row['diagnosing'] / 1e6:.0f} MB to diagnose"
    )


if __name__ == "__main__":
    main()
