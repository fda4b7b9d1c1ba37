"""Measure all that a graphics card decides, in one go: ``make gpu-report``, or ``python tools/gpu_report.py [OUT]``.

Into OUT (default: out/gpu-report): the tests of rendering on this device (tests.txt), the report of all methods
(report.json, .svg, .html), frames of large models of glass, wine and wax (frames.json), frame times of the previewer
where there is a display (preview.txt), our results on the benchmark as one file to send (benchmark/ours.zip), and
summary.md with what came of each. With ``--keep`` the report and the frames become docs/reports/gpu.json, gpu.svg and
gpu-frames.json. A step that fails is named at the end, and leaves the others alone. On a software rasterizer only with
``--software``, to try this tool out: models and frames are small then.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import trimesh

import translucent as tl

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "docs" / "reports"

#: Subdivisions of a ball whose 20 * 4^n triangles are 1.3 and 5.2 million; and those of a trial.
LARGE, SMALL = (8, 9), (4, 5)
SCREENS, LITTLE = ((1920, 1080), (3840, 2160)), ((160, 90), (320, 180))

#: Frames of each kind: their median counts.
FRAMES = 9


def looks() -> dict[str, tuple[tl.Medium, dict[str, Any]]]:
    """Media for a ball of 10 cm, and how they are shown."""
    wine = tl.Medium(absorption=(12.0, 60.0, 40.0))
    wax = tl.scattering_medium((0.9, 0.8, 0.6), mean_free_path=0.002, ior=1.44)
    return {
        "absorbing": (wine, {}),
        "glass": (replace(wine, ior=1.5), {}),
        "glass, in screen space": (replace(wine, ior=1.5), {"interfaces": tl.ScreenInterfaces()}),
        "wax": (wax, {}),
        "glass, 4 random paths": (replace(wine, ior=1.5), {"method": tl.PathTraced(4)}),
    }


def bumpy_ball(subdivisions: int) -> tl.Mesh:
    """Ball of 5 cm with bumps that rays cross several times."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.05)
    return tl.Mesh(ball.vertices * (1.0 + 0.1 * np.sin(120.0 * ball.vertices)), ball.faces, name="bumpy ball")


def measure_frames(renderer: tl.Renderer, small: bool) -> list[dict[str, Any]]:
    """Seconds of first and later frames for each look, size of model and size of picture, turned a little each time."""
    rows = []
    for subdivisions in SMALL if small else LARGE:
        begun = time.perf_counter()
        mesh = bumpy_ball(subdivisions)
        made = time.perf_counter() - begun
        for look, (medium, how) in looks().items():
            for size in LITTLE if small else SCREENS:
                row: dict[str, Any] = {"look": look, "triangles": len(mesh.faces), "size": size, "made": made}
                try:
                    row |= frame_times(renderer, mesh, medium, how, size)
                except tl.TranslucentError as error:
                    row["refused"] = str(error)
                rows.append(row)
                click.echo(told(row))
    return rows


def frame_times(
    renderer: tl.Renderer, mesh: tl.Mesh, medium: tl.Medium, how: dict[str, Any], size: tuple[int, int]
) -> dict[str, float]:
    """Seconds of the first frame, of later ones, and of those what passes take, read-back left out."""
    scene = tl.showcase(mesh, medium, stage="none")
    taken, passes = [], []
    for number in range(FRAMES + 1):
        around = np.radians(3.0 * number)
        direction = -np.sin(around), -0.35, -np.cos(around)
        turned = replace(scene, camera=tl.Camera.framing(mesh.bounds, size, direction))
        begun = time.perf_counter()
        frame = renderer.render(turned, size, **how)
        taken.append(time.perf_counter() - begun)
        passes.append(sum(seconds for name, seconds in frame.seconds.items() if name != "total"))
    return {
        "first": taken[0],
        "frame": statistics.median(taken[1:]),
        "slowest": max(taken[1:]),
        "passes": statistics.median(passes[1:]),
    }


def told(row: dict[str, Any]) -> str:
    """A row in words."""
    width, height = row["size"]
    what = f"{row['look']}, {row['triangles'] / 1e6:.2g} million triangles, {width} x {height}"
    if "refused" in row:
        return f"{what}: {row['refused']}"
    return (
        f"{what}: first {row['first']:.2f} s, then {1e3 * row['frame']:.1f} ms with read-back "
        f"(slowest {1e3 * row['slowest']:.1f}), passes {1e3 * row['passes']:.2f} ms"
    )


def run(command: list[str], log: Path | None = None) -> str:
    """Run a command of this Python in the project; its last line. Raises `RuntimeError` if it fails."""
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=False)
    if log is not None:
        log.write_text(done.stdout + done.stderr)
    lines = (done.stdout.strip() or done.stderr.strip()).splitlines() or ["no output"]
    if done.returncode:
        raise RuntimeError(f"exit code {done.returncode}: {lines[-1]}")
    return lines[-1]


@click.command(help=__doc__)
@click.argument("output", type=click.Path(path_type=Path), default=ROOT / "out" / "gpu-report")
@click.option("--keep", is_flag=True, help="Put the report and the frames into docs/reports/.")
@click.option("--software", is_flag=True, help="Go on with a software rasterizer, small.")
@click.option(
    "--only", type=click.Choice(["tests", "report", "frames", "preview", "benchmark"]), help="One step alone."
)
def main(output: Path, keep: bool, software: bool, only: str | None) -> None:
    """Do all steps, and tell what came of them."""
    output.mkdir(parents=True, exist_ok=True)
    with tl.Renderer() as renderer:
        device = renderer.provenance["renderer"]
        small = "software" in renderer.provenance["renderer"]
    if small and not software:
        raise SystemExit(f"gpu-report: the device is {device}; run it where there is a GPU, or try it with --software")
    if small and keep:
        raise SystemExit(f"gpu-report --keep: the device is {device}, and docs/reports/gpu.json is a GPU's")
    click.echo(f"device: {device}")

    def frames() -> str:
        with tl.Renderer() as renderer:
            rows = measure_frames(renderer, small)
            record = {"provenance": renderer.provenance, "rows": rows}
        (output / "frames.json").write_text(json.dumps(record, indent=1))
        if keep:
            shutil.copy(output / "frames.json", KEPT / "gpu-frames.json")
        return "\n".join(["", *(f"  - {told(row)}" for row in rows)])

    def report() -> str:
        quick = ["--quick", "--only", "scaling"] if small else []
        found = run(["-m", "translucent", "report", "-o", str(output), *quick], output / "report.txt")
        if keep:
            for name in ("json", "svg"):
                shutil.copy(output / f"report.{name}", KEPT / f"gpu.{name}")
        return found

    def tests() -> str:
        suites = ["tests/gpu/test_accuracy.py"] if small else ["tests/gpu", "tests/glsl"]
        return run(["-m", "pytest", "-q", "-p", "no:cacheprovider", *suites], output / "tests.txt")

    def benchmark() -> str:
        few = ["--only", "thickness"] if small else []
        where = ["-o", str(output / "benchmark")]
        return run(["-m", "translucent", "benchmark", "run", "ours", *where, *few], output / "benchmark.txt")

    def preview() -> str:
        if "DISPLAY" not in os.environ:
            return "left out: there is no display"
        return run(
            ["tools/compare_checkouts.py", "--scene", "orbit", "--clock", "--pairs", "1"], output / "preview.txt"
        )

    # What is lost least if the time on a borrowed machine ends comes last.
    steps: dict[str, Callable[[], str]] = {"frames": frames, "report": report, "tests": tests, "preview": preview}
    steps |= {"benchmark": benchmark}
    lines, failed = [f"# {device}", ""], False
    for name, step in steps.items():
        if only in (None, name):
            click.echo(f"{name} ...")
            try:
                lines.append(f"- {name}: {step()}")
            except Exception as error:  # noqa: BLE001 - the other steps go on
                failed = True
                lines.append(f"- {name}: FAILED, {type(error).__name__}: {error}")
            (output / "summary.md").write_text("\n".join(lines) + "\n")
    click.echo("\n".join(lines))
    sys.exit(failed)


if __name__ == "__main__":
    main()
