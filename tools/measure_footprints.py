"""Gain of averaging the environment over the footprint of a pixel, on glass: ``python tools/measure_footprints.py``.

Pictures with a few samples of each pixel, with the average and without it, against 256 samples without: the error of
luminance as nRMSE, the ratio of the means, single bright pixels (more than half a unit over twice the truth), and
processor time. The mean is that of 16 samples which stand for a pixel each, as the only sample of a picture does, over
that of the same samples without the average.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import translucent as tl
from translucent.assets import mesh_path
from translucent.formulas.color import LUMINANCE_WEIGHTS
from translucent.gpu.passes import traced_interfaces
from translucent.scene.showcase import framing
from translucent.scene.stages import STAGES

SIZE, MESHES, ENVIRONMENTS = (80, 60), ("sphere", "knot", "bear"), ("studio", "night")

#: Samples of the pictures, of their truth, and of the measurement of the mean.
SAMPLES, MANY, SOME = (1, 4, 16), 256, 16


@contextmanager
def step(pixels: float) -> Iterator[None]:
    """Footprints of one sample are as wide as this share of a pixel, and 0 is none."""
    usual = traced_interfaces.FOOTPRINT_STEP
    traced_interfaces.FOOTPRINT_STEP = pixels
    try:
        yield
    finally:
        traced_interfaces.FOOTPRINT_STEP = usual


def scene_of(mesh: str, environment: str) -> tl.Scene:
    """A body of crystal before an environment."""
    body = tl.Object(tl.load_mesh(mesh_path(mesh)), tl.preset("crystal").medium)
    return tl.Scene([body], framing([body], SIZE), environment=STAGES[environment].environment())


def measure(renderer: tl.Renderer, mesh: str, environment: str) -> None:
    """Print a line for each number of samples."""
    scene = scene_of(mesh, environment)

    def drawn(samples: int, pixels: float) -> tuple[Any, float]:
        with step(pixels):
            started = time.process_time()
            frame = renderer.render(scene, SIZE, samples=samples, interfaces=tl.TracedInterfaces())
        return (frame.radiance.astype(np.float64) @ LUMINANCE_WEIGHTS)[frame.coverage], time.process_time() - started

    usual = traced_interfaces.FOOTPRINT_STEP
    truth = drawn(MANY, 0.0)[0]
    for samples in SAMPLES:
        drawn(samples, usual)
        words = []
        for pixels in (0.0, usual):
            found, seconds = drawn(samples, pixels)
            error, bright = np.sqrt(np.mean((found - truth) ** 2)) / truth.mean(), (found > 2 * truth + 0.5).sum()
            words.append(f"nRMSE {error:.3f}, {bright} bright, {seconds:.2f} s")
        print(f"{mesh:7} {environment:7} {samples:3} samples: {'; averaged: '.join(words)}", flush=True)
    ratio = drawn(SOME, usual * SOME**0.5)[0].mean() / drawn(SOME, 0.0)[0].mean()
    print(f"{mesh:7} {environment:7} mean {ratio - 1.0:+.4f}", flush=True)


def main() -> None:
    """Measure all."""
    with tl.Renderer() as renderer:
        for mesh in MESHES:
            for environment in ENVIRONMENTS:
                measure(renderer, mesh, environment)


if __name__ == "__main__":
    main()
