"""Time and error of marching through a cloud of 64^3 voxels at 512 x 512: ``python tools/measure_densities.py``.

Errors are those of radiance against the float64 reference, which integrates along the rays to a tolerance far below
them; that of light is slow, so the picture for the lit cloud's error is a smaller one of the same view.
"""

from __future__ import annotations

import time

import numpy as np

import translucent as tl
from translucent.geometry.solids import Sphere

VOXELS = 64
SIZE = (512, 512)
STEPS = (16, 64, 256)
REPEATS = 3


def cloud() -> tl.DensityGrid:
    """Puffs that fade towards the boundary."""
    x, y, z = 2.0 * (np.indices((VOXELS,) * 3) + 0.5) / VOXELS - 1.0
    puffs = 1.0 + 0.8 * np.sin(10 * x) * np.sin(11.5 * y + 1.0) * np.sin(8.5 * z)
    return tl.DensityGrid(2.0 * np.maximum(1.0 - x**2 - y**2 - z**2, 0.0) * puffs)


def scene(lit: bool) -> tl.Scene:
    """The cloud in a ball, lit by the sun or glowing by itself."""
    medium = tl.Medium(absorption=(0.5, 1, 2), scattering=(4, 3, 2), emission=(0.1, 0.2, 0.1), anisotropy=0.3)
    body = tl.Object(Sphere(radius=1).tessellate(64), medium, density=cloud())
    sun = [tl.DirectionalLight((-0.3, -1, 0.2), (2, 2, 2))] if lit else []
    return tl.Scene([body], tl.Camera.look_at((1, 1.5, 3), (0, 0, 0)), sun)


def measure(renderer: tl.Renderer, lit: bool) -> None:
    """Print a row for each number of steps."""
    shown, small = scene(lit), (32, 32) if lit else SIZE
    truth = tl.reference.render(shown, small, tolerance=1e-5)
    inside = tl.interior(tl.reference.hit_counts(shown, small)) & truth.coverage
    for steps in STEPS:
        method = tl.RayMarched(steps)
        found = renderer.render(shown, small, method).radiance
        error = np.abs(found - truth.radiance)[inside]
        rms = np.sqrt((error**2).mean() / (truth.radiance[inside] ** 2).mean())
        renderer.render(shown, SIZE, method)
        seconds = []
        for _ in range(REPEATS):
            began = time.perf_counter()
            renderer.render(shown, SIZE, method)
            seconds.append(time.perf_counter() - began)
        lights = "one light" if lit else "no light"
        print(
            f"{lights:>9} | {steps:5} | {1e3 * np.median(seconds):8.0f} | {rms:7.1e} | {error.max():7.1e}", flush=True
        )


def main() -> None:
    """Measure with whatever OpenGL there is."""
    with tl.Renderer() as renderer:
        print(f"{VOXELS}^3 voxels at {SIZE[0]}x{SIZE[1]} on {renderer.provenance['renderer']}")
        print("   lights | steps |       ms | rms (rel.) |     max")
        for lit in (False, True):
            measure(renderer, lit)


if __name__ == "__main__":
    main()
