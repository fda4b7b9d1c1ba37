"""Errors of pictures against images of full light transport: ``python tools/measure_transport.py [FOLDER [NAME ...]]``.

FOLDER holds `scenes.py`, with ``SCENES`` (all names) and ``make(name)`` (a scene, and the side of its picture in
pixels), and for each name an .npz file of two independent pictures ``a`` and ``b`` (h, w, 3), whose difference is
noise, and ``mask`` (h, w): the pixels that count. Further masks may be there, such as ``ground``. Scenes without a
file are left out; ``tools/transport_truth.py`` makes files. ``CHOICES`` may hold arguments of `Renderer.render` for
some names.

Printed are shares of the mean of the truth: the RMS error (as the mean of (x - a)(x - b), which noise of the truth
does not change), the same of means of 4 x 4 pixels, the bias of R, G and B, and the noise of the truth; and seconds
of processor time.

``--every`` also traces all samples of all pixels, and prints the samples that adaptive sampling traced. ``--paths N``
draws by N random paths for each of two samples instead, and prints how far the mean is off in standard errors, and
the fraction of pixels within four. ``--save FOLDER`` keeps the pictures.

``--cycles PYTHON`` prints the errors of Cycles with Open Image Denoise as well; PYTHON has Blender as a module
(`bpy`). Times are then those of the third picture of a scene, which both renderers keep. `scenes.py` may have
``LAMPS``, radii of the balls that point lights are in the truth.

``--furnace``, which needs no FOLDER: white bodies that absorb nothing in even light of radiance 1, which they leave
as it is. Printed are the largest and the median |L - 1| of ball, torus, cube and thin wall.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import translucent as tl
from translucent.arrays import Array
from translucent.benchmark import peers
from translucent.benchmark.export import export_scene
from translucent.benchmark.scenes import BenchmarkScene
from translucent.files.images import read_exr
from translucent.geometry.solids import Box, Sphere, Torus

SHAPES = {
    "ball": Sphere().tessellate(48),
    "torus": Torus(1.0, 0.25).tessellate(64),
    "cube": Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).tessellate(),
    "wall": Box((-0.5, -0.5, -0.02), (0.5, 0.5, 0.02)).tessellate(),
}

#: Media of the furnace: indices of refraction, scattering in 1/m (bodies are 1 to 2.5 m wide), anisotropies.
FURNACE = (1.0, 1.33, 1.6), (4.0, 60.0, 400.0), (0.0, 0.8)

#: Renders an exported scene for each line of its input, and prints the processor time of the last of some pictures.
CYCLES = """
import json, pathlib, resource, runpy, sys
import bpy
scenes = runpy.run_path(sys.argv[1])
def processor():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)
for line in sys.stdin:
    given = json.loads(line)
    scenes["build"](pathlib.Path(given["folder"]), "cycles", given["samples"])
    scene = bpy.context.scene
    for lamp in bpy.data.lights:
        if lamp.type == "POINT":
            lamp.shadow_soft_size, lamp.use_soft_falloff = given["radius"], False
    scene.render.use_persistent_data, scene.render.filepath = True, given["picture"]
    for seed in range(3):
        scene.cycles.seed, began = seed, processor()
        bpy.ops.render.render(write_still=True)
    print("seconds", processor() - began, flush=True)
"""

#: Side in pixels of what is averaged for errors that the eye sees.
BLOCK = 4


def blocks(picture: Array) -> Array:
    """Means of blocks of pixels, of a picture (h, w, ...)."""
    height, width = (side // BLOCK for side in picture.shape[:2])
    whole = picture[: height * BLOCK, : width * BLOCK]
    return np.asarray(whole.reshape(height, BLOCK, width, BLOCK, -1).mean(axis=(1, 3)))


def errors(radiance: Array, a: Array, b: Array, mask: Array) -> str:
    """Errors of a picture (h, w, 3) in the pixels of a mask (h, w), as a line of text."""
    truth = 0.5 * (a + b)
    mean = truth[mask].mean()
    inside = blocks(mask.astype(np.float64))[..., 0] == 1.0
    square = ((radiance - a) * (radiance - b))[mask].mean()
    coarse = ((blocks(radiance) - blocks(a)) * (blocks(radiance) - blocks(b)))[inside].mean() if inside.any() else 0.0
    bias = " ".join(f"{100 * share:+.1f}" for share in radiance[mask].mean(axis=0) / truth[mask].mean(axis=0) - 1.0)
    noise = 0.5 * np.sqrt(np.square(a - b)[mask].mean()) / mean
    rms, rough = (np.sqrt(max(value, 0.0)) / mean for value in (square, coarse))
    return f"error {rms:.4f}, in blocks {rough:.4f}, bias {bias} %, noise of the truth {noise:.4f}"


def deviations(frame: tl.Frame, a: Array, b: Array, mask: Array) -> str:
    """Line of text: error of random paths in standard errors, which combine those of the paths and of the truth."""
    assert frame.standard_error is not None
    off = frame.radiance.astype(np.float64) - 0.5 * (a + b)
    # The variance of a pixel of the truth is that of two numbers: it is averaged with its neighbors.
    variance = 0.25 * np.square(a - b)
    known = np.repeat(np.repeat(blocks(variance), BLOCK, axis=0), BLOCK, axis=1)
    height, width = known.shape[:2]
    mask, off = mask[:height, :width], off[:height, :width]
    spread = np.sqrt(np.square(frame.standard_error[:height, :width].astype(np.float64)) + known)
    mean = off[mask].mean(axis=0) / (np.sqrt(np.square(spread)[mask].sum(axis=0)) / mask.sum())
    within = (np.abs(off) <= 4.0 * spread)[mask].mean()
    return f"mean off by {' '.join(f'{value:+.1f}' for value in mean)} standard errors, {within:.2%} of pixels within 4"


class Cycles:
    """Blender in a process of its own."""

    def __init__(self, python: str) -> None:
        builder = str(Path(peers.__path__[0]) / "blender_scene.py")
        self._folder = tempfile.TemporaryDirectory()
        self._process = subprocess.Popen(
            [python, "-c", CYCLES, builder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def picture(self, name: str, scene: tl.Scene, side: int, samples: int, radius: float) -> tuple[Array, float]:
        """Radiance (h, w, 3) of a scene, and seconds of processor time."""

        class Square(BenchmarkScene):
            size = property(lambda self: (side, side))

        folder = Path(self._folder.name) / name
        export_scene(Square(name, name, name, "interfaces", (), lambda: scene), folder)
        told = {"folder": str(folder), "samples": samples, "picture": f"{folder}.exr", "radius": radius}
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(told) + "\n")
        self._process.stdin.flush()
        seconds = next((line.split()[1] for line in self._process.stdout if line.startswith("seconds ")), None)
        if seconds is None:
            raise SystemExit(f"Cycles could not draw {name}; what it says is above")
        _, channels = read_exr(f"{folder}.exr", "the picture of Cycles")
        return np.stack([channels[one] for one in "RGB"], axis=-1).astype(np.float64), float(seconds)


def measure(renderer: tl.Renderer, folder: Path, chosen: argparse.Namespace) -> None:
    """Print errors of the scenes of a folder."""
    sys.path.insert(0, str(folder))
    scenes = import_module("scenes")
    cycles = Cycles(chosen.cycles) if chosen.cycles else None
    for name in chosen.names or scenes.SCENES:
        if not (folder / f"{name}.npz").is_file():
            print(f"{name}: no truth in {folder}", flush=True)
            continue
        scene, side = scenes.make(name)
        own = getattr(scenes, "CHOICES", {}).get(name, {})
        choices: list[dict[str, Any]] = [{"samples": chosen.samples, **own}]
        if chosen.paths:
            choices = [{"samples": 2, "method": tl.PathTraced(paths=chosen.paths)}]
        elif chosen.every:
            choices.append({"samples": chosen.samples, "adaptive": False, **own})
        with np.load(folder / f"{name}.npz") as stored:
            pictures = {key: stored[key] for key in stored.files}
        a, b = pictures.pop("a").astype(np.float64), pictures.pop("b").astype(np.float64)
        if cycles is not None:
            radius = getattr(scenes, "LAMPS", {}).get(name, 0.0)
            radiance, seconds = cycles.picture(name, scene, side, chosen.samples, radius)
            for which, mask in pictures.items():
                print(f"{name}, {which}, Cycles: {errors(radiance, a, b, mask)}, {seconds:.2f} s", flush=True)
        for choice in choices:
            for _ in range(1 if cycles is None else 3):
                began = time.process_time()
                frame = renderer.render(scene, (side, side), denoise=chosen.denoise, **choice)
                radiance = frame.radiance.astype(np.float64)
                seconds = time.process_time() - began
            for which, mask in pictures.items():
                print(f"{name}, {which}: {errors(radiance, a, b, mask)}, {seconds:.2f} s", flush=True)
                if chosen.paths:
                    print(f"  {deviations(frame, a, b, mask)}", flush=True)
            if chosen.every:
                print(f"  samples traced: {frame.provenance.get('traced_samples', 'all')}", flush=True)
            if chosen.save is not None:
                chosen.save.mkdir(parents=True, exist_ok=True)
                np.save(chosen.save / f"{name}.npy", radiance)


def furnace(renderer: tl.Renderer, samples: int) -> None:
    """Print what bodies that absorb nothing add to even light, or take of it."""
    even, worst = tl.Environment.constant((1, 1, 1)), 0.0
    medians: list[float] = []
    for (shape, mesh), ior, scattering, anisotropy in product(SHAPES.items(), *FURNACE):
        away = 1.4 if shape in ("ball", "torus") else 1.0
        camera = tl.Camera.look_at((0.8 * away, 1.4 * away, 2.4 * away), (0, 0, 0), fov_y=40.0)
        medium = tl.Medium(scattering=scattering, anisotropy=anisotropy, ior=ior)
        frame = renderer.render(tl.Scene([tl.Object(mesh, medium)], camera, [], even), (48, 48), samples=samples)
        off = np.abs(frame.radiance[frame.coverage] - 1.0).max(axis=-1)
        worst = max(worst, float(off.max()))
        medians.append(float(np.median(off)))
        what = f"{shape}, ior {ior:g}, {scattering:g} / m, g {anisotropy:g}"
        print(f"{what}: largest {off.max():.4f}, median {np.median(off):.4f}", flush=True)
    print(f"all {len(medians)}: largest {worst:.4f}, largest median {max(medians):.4f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("names", nargs="*", metavar="name")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--every", action="store_true")
    parser.add_argument("--paths", type=int, default=0)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--cycles", metavar="PYTHON")
    parser.add_argument("--denoise", action="store_true", help="take noise out of our pictures, too")
    parser.add_argument("--furnace", action="store_true")
    chosen = parser.parse_args()
    if chosen.folder is None and not chosen.furnace:
        parser.error("nothing to measure; give a folder with scenes.py and its images, or --furnace")
    with tl.Renderer() as renderer:
        if chosen.furnace:
            furnace(renderer, chosen.samples)
        if chosen.folder is not None:
            measure(renderer, chosen.folder, chosen)


if __name__ == "__main__":
    main()
