"""Mean color of a ball of exported material in Blender's Cycles, against our path-traced truth.

``python tools/measure_blender.py [NAME ...]`` writes ``docs/presets/blender.json``. Each material is what ``extinction
--as blender`` prints. Blender runs it, and Cycles renders it on the toolkit's ball (4 cm), before the same camera, lit
by a white world and by the studio, without bias but that of the number of bounces: Blender's, or the material's. The
truth is `PathTraced`. Both see the ball at the same points, the centers of pixels. Needs Blender: the module ``bpy`` in
this Python or in that of BLENDER_PYTHON, or the program.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import translucent as tl
from translucent.assets import mesh_path
from translucent.files.images import write_exr
from translucent.files.paths import write_text_atomically
from translucent.materials import text_block

FILE = Path(__file__).resolve().parents[1] / "docs" / "presets" / "blender.json"
SCRIPT = Path(__file__).with_name("blender_ball.py")

#: Where Blender was looked for.
ABSENT = (
    "Blender is absent: no program of that name, and no module bpy (it may be in a Python of its own: "
    "pip install bpy, and set BLENDER_PYTHON to that Python)"
)

#: Pixels along a side; samples of a pixel with a seed in Cycles; paths of one in a round of ours, the
#: relative standard error at which there are enough, and the seconds.
SIDE, SAMPLES, PATHS, ENOUGH, SECONDS = 32, 512, 64, 0.002, 30.0

#: Columns are the axes of glTF in Blender.
AXES = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])

#: Media and roughness beside the presets, which have theirs.
OTHERS = {
    "glass": (tl.Medium(ior=1.5), 0.0),
    "frosted glass": (tl.Medium(ior=1.5), 0.4),
    "red glass": (tl.Medium.from_color((0.8, 0.1, 0.08), 0.02, ior=1.5), 0.0),
    "frosted red glass": (tl.Medium.from_color((0.8, 0.1, 0.08), 0.02, ior=1.5), 0.4),
    "matched absorber": (tl.Medium.from_color((0.18, 0.62, 0.35), 0.02), 0.0),
    "matched cloud": (tl.Medium(absorption=(1, 4, 20), scattering=(200, 150, 100), anisotropy=0.6), 0.0),
    "glow in glass": (
        tl.Medium(absorption=(20, 40, 80), scattering=(30, 30, 30), emission=(40, 20, 5), ior=1.5),
        0.0,
    ),
}
PRESETS = ("merlot", "amber", "jade", "skin1", "wax", "soap", "whole_milk", "espresso")

ENVIRONMENTS = {
    "white": tl.Environment.constant((1.0, 1.0, 1.0)),
    "studio": tl.Environment.studio(exposure=-1.0),
}


def blender_command() -> list[str] | None:
    """Command that starts a script in Blender: by a Python that has its module, or by the program; None without it."""
    if python := os.environ.get("BLENDER_PYTHON"):
        return [python, "-W", "error"]
    if importlib.util.find_spec("bpy") is not None:
        return [sys.executable, "-W", "error"]
    program = shutil.which("blender")
    return program and [program, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]


def in_cycles(command: list[str], scene: tl.Scene, snippet: str, side: int, samples: int) -> npt.NDArray[np.float64]:
    """(2, side, side, 3): radiance of a scene of one body, with the material of a snippet, by Cycles with two seeds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        mesh, environment = scene.objects[0].mesh, scene.environment
        np.savez(folder / "mesh.npz", vertices=mesh.vertices @ AXES.T, faces=mesh.faces)
        pose = np.eye(4)
        pose[:3] = AXES @ scene.camera.pose[:3]
        light: Any = environment.first.tolist()
        if environment.map is not None:
            # Its middle is -Z here, and +X in Blender.
            turned = np.roll(environment.map.pixels * 2.0**environment.exposure, -environment.map.size[0] // 4, axis=1)
            write_exr(folder / "world.exr", dict(zip("RGB", np.moveaxis(turned, 2, 0), strict=True)), {})
            light = str(folder / "world.exr")
        job = {
            "snippet": snippet, "mesh": str(folder / "mesh.npz"), "pose": pose.tolist(),
            "fov": float(np.radians(scene.camera.fov_y)), "side": side, "samples": samples,
            "environment": light, "result": str(folder / "result.npy"),
        }  # fmt: skip
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        done = subprocess.run(
            [*command, str(SCRIPT), "--", str(folder / "job.json")], capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            raise RuntimeError(f"Blender failed:\n{done.stdout}{done.stderr}")
        return np.load(folder / "result.npy").astype(np.float64)


def ball(medium: tl.Medium, roughness: float, environment: tl.Environment, side: int = SIDE) -> tl.Scene:
    """The toolkit's ball, filled with a medium."""
    body = tl.Object(tl.load_mesh(mesh_path("sphere")), medium, surface=tl.Surface(roughness=roughness))
    camera = tl.Camera.framing(body.mesh.vertices, (side, side), direction=(-0.35, -0.3, -1.0), fov_y=28.0)
    return tl.Scene([body], camera, environment=environment)


def truth_of(renderer: tl.Renderer, scene: tl.Scene, inside: npt.NDArray[np.bool_]) -> tuple[Any, Any, int]:
    """Radiance (side, side, 3) by random paths, its standard error, and paths of each pixel."""
    means: list[Any] = []
    errors: list[Any] = []
    began = time.perf_counter()
    while True:
        frame = renderer.render(scene, (SIDE, SIDE), tl.PathTraced(PATHS, len(means)))
        assert frame.standard_error is not None
        means.append(frame.radiance.astype(np.float64))
        errors.append(frame.standard_error.astype(np.float64))
        mean, error = np.mean(means, axis=0), np.sqrt(np.sum(np.square(errors), axis=0)) / len(errors)
        share = np.sqrt((error[inside] ** 2).sum(axis=0)) / mean[inside].sum(axis=0)
        if (share <= ENOUGH).all() or time.perf_counter() - began > SECONDS:
            return mean, error, PATHS * len(means)


def measure(
    command: list[str], renderer: tl.Renderer, medium: tl.Medium, roughness: float, environment: str
) -> dict[str, Any]:
    """Mean colors of the ball by Cycles and by random paths, and how far the backgrounds are apart."""
    scene = ball(medium, roughness, ENVIRONMENTS[environment])
    counts = tl.reference.hit_counts(scene, (SIDE, SIDE))
    inside, outside = tl.interior(counts) & (counts > 0), tl.interior(counts) & (counts == 0)
    distance = 1.0 / max(float(medium.extinction.max()), 1.0)
    snippet = text_block("blender", medium, medium.transmittance(distance), distance, roughness)
    halves = in_cycles(command, scene, snippet, SIDE, SAMPLES)
    seen, noise = halves.mean(axis=0), np.diff(halves, axis=0)[0] / 2
    mean, error, paths = truth_of(renderer, scene, inside)
    error = np.hypot(error, noise)
    behind = float(np.abs(seen[outside] - mean[outside]).max())
    assert behind <= 0.02 * float(mean[outside].max()), f"another background: {behind}"
    return {
        "cycles": seen[inside].mean(axis=0).tolist(),
        "truth": mean[inside].mean(axis=0).tolist(),
        "error": (np.sqrt((error[inside] ** 2).sum(axis=0)) / inside.sum()).tolist(),
        "paths": paths,
    }


def main() -> None:
    """Measure all materials, or those that are named."""
    known = {**OTHERS, **{name: (tl.preset(name).medium, tl.preset(name).roughness) for name in PRESETS}}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(known)}; default: all")
    asked = parser.parse_args().names or list(known)
    if (command := blender_command()) is None:
        print(ABSENT)
        return
    found = json.loads(FILE.read_text(encoding="utf-8"))["materials"] if FILE.is_file() else {}
    with tl.Renderer() as renderer:
        for name in asked:
            medium, roughness = known[name]
            found[name] = {"colors": {}}
            for environment in ENVIRONMENTS:
                found[name]["colors"][environment] = one = measure(command, renderer, medium, roughness, environment)
                mean, error, seen = (np.array(one[key]) for key in ("truth", "error", "cycles"))
                ratio, doubt = np.round(seen / mean, 3), np.round(error / mean, 4)
                print(f"{name:18} {environment:7} {ratio} +- {doubt} {np.round(mean, 4)}", flush=True)
            kept = {name: found[name] for name in known if name in found}
            data = {"written": date.today().isoformat(), "materials": kept}
            write_text_atomically(FILE, json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
