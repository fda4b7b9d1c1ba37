"""Caustics of a ball and of a goblet with wine on the ground, against photons of the float64 reference.

Usage: python tools/measure_caustics.py [--truth 1000000] [--size 240x180] [--pictures FOLDER]

Prints the power that the picture's ground gets, relative to the truth, and the root mean square of the difference of
irradiance after a blur by a pixel, as a share of its mean, freed of the truth's noise by two independent halves.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

import translucent as tl
from translucent.assets import mesh_path
from translucent.commands.common import read_size
from translucent.planning.passes import PassName

Array = npt.NDArray[np.floating]

QUAD = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], dtype=np.float64)
GROUND = tl.Object(tl.Mesh(0.5 * QUAD, [(0, 2, 1), (0, 3, 2)], name="ground"), color=(0.7, 0.7, 0.7))
DUSK = tl.Environment.gradient((0.02, 0.02, 0.025), (0.05, 0.05, 0.06))
COUNTS = (62_500, 250_000, 1_000_000, 4_000_000)


def standing(mesh: tl.Mesh, above: float, medium: tl.Medium, **options: int) -> tl.Object:
    """A body whose lowest point is so far above the ground."""
    matrix = np.eye(4)
    matrix[1, 3] = above
    return tl.Object(mesh, medium, matrix, **options)


def ball() -> tl.Scene:
    """A ball of glass in the sun, at rest on the ground."""
    mesh = tl.load_mesh(mesh_path("sphere"))
    radius = 0.04 / (0.5 * float(np.ptp(mesh.vertices[:, 1])))
    matrix = np.diag([radius, radius, radius, 1.0])
    matrix[:3, 3] = np.array((0, 0.0401, 0)) - radius * mesh.center
    body = tl.Object(mesh, tl.Medium(ior=1.5), matrix)
    camera = tl.Camera.look_at((0.05, 0.28, 0.42), (0.02, 0.02, 0), fov_y=32)
    return tl.Scene([body, GROUND], camera, [tl.DirectionalLight((0.4, -1, -0.2), 1.0)], DUSK)


def goblet() -> tl.Scene:
    """A crystal goblet with wine beside a lamp."""
    glass, wine = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    above = 1e-4 - float(glass.bounds[0][1])
    red = tl.Medium.from_color((0.62, 0.05, 0.09), 0.02, ior=1.34)
    bodies = [standing(glass, above, tl.preset("crystal").medium, priority=1), standing(wine, above, red)]
    camera = tl.Camera.look_at((0.0, 0.34, 0.62), (0.06, 0.06, 0.0), fov_y=30)
    return tl.Scene([*bodies, GROUND], camera, [tl.PointLight((-0.5, 0.6, -0.15), 1.2)], DUSK, "priority")


def irradiance(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int], caustics: tl.Caustics) -> Array:
    """(h, w, 3): of photons on the ground, as the picture shows it."""
    gpu, plan = renderer.gpu, renderer.plan(scene, caustics=caustics)
    radiance = []
    with gpu.context.current():
        job = gpu.prepare(scene, size, plan)
        for leave_out in ((PassName.CAUSTICS,), ()):
            gpu.run(job, leave_out=leave_out)
            data = job.targets.opaque().read(components=4, attachment=1, dtype="f4")
            radiance.append(np.frombuffer(data, np.float32).reshape(*size[::-1], 4)[::-1, :, :3].astype(np.float64))
        job.release()
    return (radiance[1] - radiance[0]) * np.pi / np.asarray(GROUND.color)


def areas(scene: tl.Scene, size: tuple[int, int]) -> Array:
    """(h, w, 1): of the ground in each pixel, in square metres."""
    origins, directions = scene.camera.rays(size)
    points = origins[..., 1:2] / -directions[..., 1:2] * directions
    half_width, half_height = scene.camera.half_extent(size)
    ahead = points @ scene.camera.forward
    pixel = 4.0 * half_width * half_height / (size[0] * size[1])
    return np.where(directions[..., 1] < 0, pixel * np.abs(ahead) ** 3 / np.abs(points[..., 1]), 0.0)[..., None]


def blurred(picture: Array) -> Array:
    """Over a pixel: a tent of two."""
    for axis in (0, 1):
        low, high = (np.roll(picture, by, axis) for by in (-1, 1))
        picture = 0.5 * picture + 0.25 * (low + high)
    return picture


def main() -> None:
    """Print a row for each scene and number of photons."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--truth", type=int, default=1_000_000, help="photons of each half of the truth")
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of 1,000,000 photons")
    options = parser.parse_args()
    size = read_size(options.size)
    for name, scene in (("ball", ball()), ("goblet", goblet())):
        halves = [tl.reference.trace_photons(scene, options.truth, seed) for seed in range(2)]
        a, b = (tl.reference.photon_irradiance(scene, size, landed) for landed in halves)
        power = (0.5 * (a + b) * areas(scene, size)).sum()
        with tl.Renderer() as renderer:
            irradiance(renderer, scene, size, tl.Caustics(1000))  # compiles, and builds hierarchies
            for count in COUNTS:
                began = time.perf_counter()
                found = irradiance(renderer, scene, size, tl.Caustics(count))
                seconds = time.perf_counter() - began
                x, low, high = (blurred(picture) for picture in (found, a, b))
                error = np.sqrt(max(((x - low) * (x - high)).mean(), 0.0)) / (0.5 * (low + high)).mean()
                share = (found * areas(scene, size)).sum() / power
                print(
                    f"{name}: {count:,} photons, power {share - 1.0:+.2%}, nRMSE {error:.3f}, {seconds:.1f} s",
                    flush=True,
                )
            if options.pictures is not None:
                frame = renderer.render(scene, (480, 360), samples=4, caustics=tl.Caustics(1_000_000))
                frame.save(options.pictures / f"{name}.png")


if __name__ == "__main__":
    main()
