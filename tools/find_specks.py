"""Specks in pictures of media: isolated pixels far off their neighbors, over presets, meshes and stages.

    python tools/find_specks.py --presets jade,soap --meshes cube,spike --out out/specks

A pixel is a speck if it is farther from the median of its eight neighbors than four times the spread of the 24 around
it, and each of the eight is at least half as far away from it: lines, edges and corners of things are none. What is
still there with four times as many samples is counted apart: highlights that are a pixel wide, or faults that no sample
mends, to be looked at.

Prints a row for each picture with specks, and writes the
pictures in which they are, marked.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_erosion

import translucent as tl
from translucent.assets import mesh_path
from translucent.geometry.solids import Box, Sphere, revolve
from translucent.scene.showcase import showcase

Array = npt.NDArray[np.float64]

#: Spreads by which a pixel is off, the least spread as a fraction of the median, and pixels left out at silhouettes.
MOST, LEAST_SPREAD, RIM = 4.0, 0.02, 3

#: Normalisation of the median absolute deviation to a standard deviation.
_NORMAL = 1.4826


def specks(radiance: Array, inside: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(h, w): isolated pixels of a picture (h, w, 3), of those `inside` (h, w) a silhouette."""
    light = radiance.mean(axis=-1)
    around, wide = _shifted(light, 1), _shifted(light, 2)
    median = np.median(around, axis=0)
    spread = _NORMAL * np.median(np.abs(wide - np.median(wide, axis=0)), axis=0)
    off = np.abs(light - median)
    far = off > MOST * np.maximum(spread, LEAST_SPREAD * np.abs(median))
    alone = np.abs(around - light).min(axis=0) > 0.5 * off
    return np.asarray(far & alone & binary_erosion(inside, iterations=RIM))


def _shifted(light: Array, reach: int) -> Array:
    """(k, h, w): all neighbors of each pixel up to so many pixels away."""
    steps = range(-reach, reach + 1)
    return np.stack([np.roll(light, (dy, dx), (0, 1)) for dy in steps for dx in steps if (dy, dx) != (0, 0)])


def _spike() -> tl.Mesh:
    """A ball with a tail that ends in a point."""
    angle = np.linspace(0.0, 0.85 * np.pi, 40)
    ball = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    along = np.linspace(0.05, 1.0, 40)[:, None]
    tail = ball[-1] + along * (np.array([0.0, 4.0]) - ball[-1])
    tail[:, 0] = ball[-1, 0] * (1.0 - along[:, 0]) ** 1.5
    profile = np.concatenate([ball, tail])
    profile[0, 0] = profile[-1, 0] = 0.0
    return tl.Mesh(*revolve(profile, 64))


def _fine() -> tl.Mesh:
    """The bear with four times as many triangles: 90,000."""
    import trimesh

    bear = tl.load_mesh(mesh_path("bear"))
    return tl.Mesh(*trimesh.remesh.subdivide(bear.vertices, bear.faces))


MESHES: dict[str, Callable[[], tl.Mesh]] = {
    "smooth": lambda: Sphere().tessellate(48),
    "cube": lambda: Box().tessellate(),
    "thin": lambda: Box((-1, -0.03, -0.7), (1, 0.03, 0.7)).tessellate(),
    "spike": _spike,
    "hollow": lambda: tl.load_mesh(mesh_path("shell")),
    "coarse": lambda: Sphere().tessellate(30),
    "fine": _fine,
}


def main() -> None:
    """Render, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presets", default=",".join(tl.presets()))
    parser.add_argument("--meshes", default=",".join(MESHES))
    parser.add_argument("--stages", default="none")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--size", type=float, default=0.06, help="longest side of the bodies in metres")
    parser.add_argument("--out", type=Path, default=None, help="folder for pictures with specks")
    options = parser.parse_args()
    size, total = (options.width, options.width * 3 // 4), 0
    with tl.Renderer() as renderer:
        for shape in options.meshes.split(","):
            mesh = MESHES[shape]()
            extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
            mesh = tl.Mesh(mesh.vertices * (options.size / extent), mesh.faces)
            for stage in options.stages.split(","):
                for name in options.presets.split(","):
                    scene = showcase(mesh, tl.preset(name), size, stage=None if stage == "none" else stage)
                    frame = renderer.render(scene, size, samples=options.samples)
                    light, covered = np.asarray(frame.radiance, np.float64), np.asarray(frame.coverage)
                    found = specks(light, covered)
                    if not found.any():
                        continue
                    more = renderer.render(scene, size, samples=4 * options.samples)
                    settled = found & specks(np.asarray(more.radiance, np.float64), covered)
                    total += int(found.sum() - settled.sum())
                    row, column = np.argwhere(found)[0]
                    counts = f"{found.sum() - settled.sum()} specks, {settled.sum()} that stay"
                    print(f"{shape} {stage} {name}: {counts}, the first at {column}, {row}", flush=True)
                    if options.out is not None:
                        options.out.mkdir(parents=True, exist_ok=True)
                        frame.save(options.out / f"{shape}-{stage}-{name}.png")
    print(f"{total} specks in all")


if __name__ == "__main__":
    main()
