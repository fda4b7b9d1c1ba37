"""Specks in pictures of media: isolated pixels far off their neighbors, over presets, meshes and stages.

    python tools/find_specks.py
    python tools/find_specks.py --presets jade,soap --meshes cube,bunny.obj --every --orbit 30 --out out/specks

A pixel is isolated if it is brighter than each of its eight neighbors, or darker, by half as much as it is off their
median, and that is more than four times the spread of the 24 around it: lines, edges, corners and flanks of highlights
are none. It is a speck if the truth, a picture `FINER` times as wide that is averaged to the same pixels, is not off in
the same direction there by half as much. What the truth has, such as grains of frost and glints that are smaller than a
pixel, is counted apart.

Prints a row for each picture with isolated pixels, and writes their pictures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import product
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

#: Pixels of the truth along a side of a pixel, and the part of what a pixel is off that the truth must be off, too.
FINER, CONFIRMED = 4, 0.5

#: Normalisation of the median absolute deviation to a standard deviation.
_NORMAL = 1.4826


def isolated(radiance: Array, inside: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(h, w): isolated pixels of a picture (h, w, 3), of those `inside` (h, w) a silhouette."""
    light = radiance.mean(axis=-1)
    around, wide = _shifted(light, 1), _shifted(light, 2)
    median = np.median(around, axis=0)
    spread = _NORMAL * np.median(np.abs(wide - np.median(wide, axis=0)), axis=0)
    off = light - median
    far = np.abs(off) > MOST * np.maximum(spread, LEAST_SPREAD * np.abs(median))
    alone = (np.sign(off) * (light - around)).min(axis=0) > 0.5 * np.abs(off)
    return np.asarray(far & alone & binary_erosion(inside, iterations=RIM))


def confirmed(radiance: Array, fine: Array) -> npt.NDArray[np.bool_]:
    """(h, w): pixels of a picture (h, w, 3) that are off in a picture (h FINER, w FINER, 3) of the same scene, too."""
    height, width, _ = radiance.shape
    truth = fine.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    off, there = (
        light - np.median(_shifted(light, 1), axis=0) for light in (radiance.mean(axis=-1), truth.mean(axis=-1))
    )
    return np.asarray(there * np.sign(off) > CONFIRMED * np.abs(off))


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
    parser.add_argument(
        "--meshes", default="smooth,cube,thin,spike,hollow,coarse", help="also: files, and fine, 90,000 triangles"
    )
    parser.add_argument("--stages", default="night,studio,daylight", help="none: bodies in the air")
    parser.add_argument("--every", action="store_true", help="show all pairs on every stage, not on one stage in turn")
    parser.add_argument("--orbit", type=float, default=0.0, help="degrees by which bodies are turned about +Y")
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--size", type=float, default=0.06, help="longest side of the bodies in metres")
    parser.add_argument("--out", type=Path, default=None, help="folder for pictures with specks")
    options = parser.parse_args()
    size, pictures, totals = (options.width, options.width * 3 // 4), 0, np.zeros(2, int)
    cosine, sine = np.cos(np.radians(options.orbit)), np.sin(np.radians(options.orbit))
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    with tl.Renderer() as renderer:
        for i, shape in enumerate(options.meshes.split(",")):
            mesh = MESHES[shape]() if shape in MESHES else tl.load_mesh(shape, unit="m")
            extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
            mesh = tl.Mesh(mesh.vertices @ turn.T * (options.size / extent), mesh.faces)
            for (j, name), (k, stage) in product(*map(_numbered, (options.presets, options.stages))):
                if not options.every and (i + j + k) % len(options.stages.split(",")):
                    continue
                scene = showcase(mesh, tl.preset(name), size, stage=None if stage == "none" else stage)
                frame = renderer.render(scene, size, samples=options.samples)
                light, covered = np.asarray(frame.radiance, np.float64), np.asarray(frame.coverage)
                found = isolated(light, covered)
                pictures += 1
                if not found.any():
                    continue
                finer = renderer.render(scene, (FINER * size[0], FINER * size[1]), samples=options.samples)
                specks = np.argwhere(found & ~confirmed(light, np.asarray(finer.radiance, np.float64)))
                totals += len(specks), found.sum() - len(specks)
                places = ", ".join(f"{column} {row}" for row, column in specks) or "none"
                print(f"{shape} {stage} {name}: {found.sum()} isolated pixels, specks: {places}", flush=True)
                if options.out is not None:
                    options.out.mkdir(parents=True, exist_ok=True)
                    frame.save(options.out / f"{Path(shape).stem}-{stage}-{name}.png")
    print(f"{totals[0]} specks in {pictures} pictures, and {totals[1]} isolated pixels of the scenes")


def _numbered(names: str) -> list[tuple[int, str]]:
    """Names that are separated by commas, with their numbers."""
    return list(enumerate(names.split(",")))


if __name__ == "__main__":
    try:
        main()
    except tl.InputError as error:
        raise SystemExit(f"error: {error}") from None
