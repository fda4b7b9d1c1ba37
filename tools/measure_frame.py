"""Cost of a frame against a depth-only pass over its triangles: ``python tools/measure_frame.py [SIDE] [ROUNDS]``.

All is drawn in turns, the depth buffer before and after each; one sample is the quotient of processor times, which
other programs hardly change, and the table has medians, with the distance of the quartiles. Of bodies that absorb:

- thickness: the passes that find it
- drawn: with the pass over pixels
- rendered: `Renderer.render` with its read-back, and radiance, thickness and validity taken
- all arrays: with optical depth, transmittance and coverage, too
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
import trimesh

import translucent as tl
from translucent.bench.cases import CASES
from translucent.bench.drawing import BenchContext, FloorDrawing, PlanDrawing
from translucent.gpu.targets import Targets

COLUMNS = ("thickness", "drawn", "rendered", "all arrays")


def ball() -> tl.Scene:
    """An icosphere of 81,920 triangles."""
    mesh = trimesh.creation.icosphere(subdivisions=6)
    medium = tl.Medium.from_color((0.2, 0.6, 0.4), distance=1.0)
    camera = tl.Camera.look_at((0.0, 0.0, 3.2), (0.0, 0.0, 0.0))
    return tl.Scene([tl.Object(tl.Mesh(mesh.vertices, mesh.faces), medium)], camera)


def scenes(size: tuple[int, int]) -> dict[str, tl.Scene]:
    """The ball, and scenes of the report."""
    cases = {case.name: case for case in CASES}
    return {"ball": ball(), **{name: cases[name].scene(size) for name in ("knot", "two media", "slab")}}


def seconds(action: Callable[[], object]) -> float:
    """Processor time that an action takes."""
    began = time.process_time()
    action()
    return time.process_time() - began


def measured(studio: BenchContext, scene: tl.Scene, size: tuple[int, int], rounds: int) -> np.ndarray:
    """(rounds, 1 + columns): processor time of the floor, and the quotient of each column."""
    renderer = studio.renderer
    floor = FloorDrawing(studio, scene, Targets(studio.gl, size))
    planned = PlanDrawing(studio, scene, Targets(studio.gl, size), renderer.plan(scene))

    def rendered() -> None:
        frame = renderer.render(scene, size)
        _ = frame.radiance, frame.thickness, frame.valid

    def everything() -> None:
        _ = renderer.render(scene, size).arrays

    found = []
    for number in range(rounds + 2):
        before = floor.draw().part
        drawn = planned.draw()
        between = floor.draw().part
        part = seconds(rendered)
        after = floor.draw().part
        whole = seconds(everything)
        last = floor.draw().part
        first, second, third = before + between, between + after, after + last
        row = [before, 2 * drawn.part / first, 2 * drawn.whole / first, 2 * part / second, 2 * whole / third]
        if number >= 2:
            found.append(row)
    planned.release()
    floor.release()
    return np.array(found)


def main(side: int = 1024, rounds: int = 20) -> None:
    """Measure with whatever OpenGL there is."""
    size = side, side
    with tl.Renderer() as renderer, renderer.gpu.context.current():
        print(renderer.provenance["renderer"])
        print(f"{'scene':12s}{'floor':>10s}" + "".join(f"{name:>16s}" for name in COLUMNS))
        studio = BenchContext(renderer)
        for name, scene in scenes(size).items():
            rows = measured(studio, scene, size, rounds)
            low, median, high = np.quantile(rows, (0.25, 0.5, 0.75), axis=0)
            cells = "".join(f"{m:9.2f} ({d:4.2f})" for m, d in zip(median[1:], (high - low)[1:], strict=True))
            print(f"{name:12s}{1e3 * median[0]:7.1f} ms{cells}")
        studio.release()


if __name__ == "__main__":
    main(*(int(value) for value in sys.argv[1:]))
