"""Adaptive sampling against all: ``python tools/measure_sampling.py FOLDER [SCENE[,PIXELS] ...]``.

FOLDER holds `scenes.py` and images of full light transport, as the tests of pictures take them. Of each scene: samples
for which rays were traced, processor seconds, by how much the picture differs from that of all samples over covered
pixels (RMS and mean, as shares of its mean), and, in the size of the image, the error against it, adaptive and all.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np

import translucent as tl

SAMPLES = 16
SCENES = ("sphere_glass", "sphere_glass,288", "knot_glass,288", "amber", "shell_glass", "goblet_wine")


def main(folder: str, *asked: str) -> None:
    """Measure with whatever OpenGL there is."""
    sys.path.insert(0, str(Path(folder)))
    scenes = import_module("scenes")
    with tl.Renderer() as renderer:
        for one in asked or SCENES:
            name, _, pixels = one.partition(",")
            scene, usual = scenes.make(name)
            side = int(pixels or usual)
            frames, seconds = {}, {}
            for adaptive in (True, False):
                renderer.render(scene, (16, 16), samples=SAMPLES, adaptive=adaptive)  # compiles
                began = time.process_time()
                frames[adaptive] = renderer.render(scene, (side, side), samples=SAMPLES, adaptive=adaptive)
                seconds[adaptive] = time.process_time() - began
            few, every = frames[True], frames[False]
            mean = every.radiance[every.coverage].mean(dtype=np.float64)
            off = (few.radiance.astype(np.float64) - every.radiance)[every.coverage] / mean
            line = f"{one}: {few.provenance['traced_samples']}, {seconds[True]:.2f} s, all {seconds[False]:.2f} s, "
            line += f"difference {np.sqrt(np.square(off).mean()):.4f}, mean {off.mean():+.5f}"
            if side == usual:
                truth = scenes.load(name)
                line += ", error " + ", ".join(f"{scenes.errors(f.radiance, truth)['nrmse']:.4f}" for f in (few, every))
            print(line, flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(*sys.argv[1:])
