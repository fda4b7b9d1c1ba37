"""Time and error of light that is scattered once: points of fragment lists, and marching.

``python tools/measure_scattering.py [PIXELS]`` prints a table for the two milky bodies of the report, with that many
pixels along a side (96). Marching is measured twice: with the depth towards a light from the same lists, which is
exact and costs one look for a step; and through a body that is a grid of voxels (all of density 1, so that the picture
is the same), where each step marches on to the light, voxel by voxel, as it is done where there are no lists. For each
number of points the last columns tell how many times as long marching takes for the same error, interpolated between
its steps.
"""

from __future__ import annotations

import dataclasses
import sys
import time

import numpy as np

import translucent as tl
from translucent.bench.cases import CASES

SIZE = (int(sys.argv[1]),) * 2 if len(sys.argv) > 1 else (96, 96)
POINTS = (2, 4, 8, 16)
STEPS = (8, 16, 32, 64, 128)
VOXELS = 32
ROUNDS = 3


def measure(renderer: tl.Renderer, scene: tl.Scene, method: tl.Method, truth: tl.Frame) -> tuple[float, float]:
    """Processor seconds of a frame, and relative RMS error of its radiance."""
    inside = tl.interior(tl.reference.hit_counts(scene, SIZE)) & truth.coverage & truth.valid
    found = renderer.render(scene, SIZE, method).radiance
    seconds = []
    for _ in range(ROUNDS):
        began = time.process_time()
        renderer.render(scene, SIZE, method)
        seconds.append(time.process_time() - began)
    square = ((found - truth.radiance)[inside] ** 2).mean() / (truth.radiance[inside] ** 2).mean()
    return float(np.median(seconds)), float(np.sqrt(square))


def time_at(error: float, times: np.ndarray, errors: np.ndarray) -> float:
    """Seconds for an error, on straight lines between measured ones with logarithmic axes; NaN beyond them."""
    order = np.argsort(errors)
    x, y = np.log(errors[order]), np.log(times[order])
    return float(np.exp(np.interp(np.log(error), x, y, left=np.nan, right=np.nan)))


def table(renderer: tl.Renderer, name: str) -> None:
    """Print what there is to tell of one case."""
    case = next(case for case in CASES if case.name == name)
    scene = case.scene(SIZE)
    body = dataclasses.replace(scene.objects[0], density=tl.DensityGrid(np.ones((VOXELS,) * 3)))
    voxels = dataclasses.replace(scene, objects=[body])
    truth = tl.reference.render(scene, SIZE, tolerance=case.tolerance)
    print(f"{case.title}, {SIZE[0]}x{SIZE[1]}")
    marched = {}
    for kind, shown in (("lists", scene), ("voxels", voxels)):
        rows = [measure(renderer, shown, tl.RayMarched(steps), truth) for steps in STEPS]
        marched[kind] = np.array(rows).T
        for steps, (seconds, error) in zip(STEPS, rows, strict=True):
            print(f"  marched, light by {kind:6} {steps:4} steps {1e3 * seconds:9.0f} ms {error:9.1e}", flush=True)
    for points in POINTS:
        seconds, error = measure(renderer, scene, tl.FragmentLists(light_points=points), truth)
        ratios = {kind: time_at(error, *found) / seconds for kind, found in marched.items()}
        print(
            f"  FragmentLists          {points:4} points {1e3 * seconds:9.0f} ms {error:9.1e}; as long to march: "
            f"{ratios['lists']:.1f} times, by voxels {ratios['voxels']:.0f} times",
            flush=True,
        )


def main() -> None:
    """Measure with whatever OpenGL there is."""
    with tl.Renderer() as renderer:
        print(renderer.provenance["renderer"])
        for name in ("scattering", "deep scattering"):
            table(renderer, name)


if __name__ == "__main__":
    main()
