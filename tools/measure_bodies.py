"""Cost of many bodies against one of the same triangles: ``python tools/measure_bodies.py [BODIES] [SIDE]``.

Small balls stand apart on a grid. Processor time in milliseconds, least of several turns: of the plan for a new scene,
of the first frame, which uploads and, where rays are traced, builds hierarchies, and of those that follow; the ratio is
that of a later frame to one of the merged body. Times of other programs on the machine are not in it.

``--different`` instead: the plan of a scene in which each ball is a mesh of its own that nothing is known of, alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import translucent as tl
from translucent.geometry.solids import Sphere

TURNS = 5
BALL = Sphere(radius=0.4).tessellate(10)


def places(count: int) -> tuple[np.ndarray, tl.Camera]:
    """Centers (count, 3) on a square grid, and a camera that sees them."""
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    middle = (side - 1) / 2
    camera = tl.Camera.look_at((middle, middle, 1.5 * side), (middle, middle, 0))
    return np.stack([column, row, np.zeros(count)], axis=1).astype(np.float64), camera


def scattered(count: int, media: int, ior: float = 1.0, **policy: Any) -> tl.Scene:
    """A ball in each place, of the media in turns."""
    centers, camera = places(count)
    kinds = [tl.Medium(absorption=(1.0 + k, 2.0, 3.0), ior=ior) for k in range(media)]
    transforms = np.tile(np.eye(4), (count, 1, 1))
    transforms[:, :3, 3] = centers
    return tl.Scene([tl.Object(BALL, kinds[i % media], at) for i, at in enumerate(transforms)], camera, **policy)


def different(count: int) -> tl.Scene:
    """A ball of its own proportions in each place: as many meshes."""
    centers, camera = places(count)
    shapes = 1.0 + 0.2 * np.random.default_rng(1).random((count, 3))
    medium = tl.Medium(absorption=(1.0, 2.0, 3.0))
    meshes = [tl.Mesh(BALL.vertices * shape + at, BALL.faces) for shape, at in zip(shapes, centers, strict=True)]
    return tl.Scene([tl.Object(mesh, medium) for mesh in meshes], camera)


def merged(count: int, ior: float = 1.0) -> tl.Scene:
    """The same triangles as one body."""
    centers, camera = places(count)
    vertices = (BALL.vertices + centers[:, None]).reshape(-1, 3)
    faces = (BALL.faces + len(BALL.vertices) * np.arange(count)[:, None, None]).reshape(-1, 3)
    return tl.Scene([tl.Object(tl.Mesh(vertices, faces), tl.Medium(absorption=(1.0, 2.0, 3.0), ior=ior))], camera)


def milliseconds(action: Callable[[], object]) -> float:
    """Processor time that an action takes."""
    began = time.process_time()
    action()
    return 1e3 * (time.process_time() - began)


def plan_of_different(count: int = 2000) -> None:
    """Measure the plan of as many meshes; needs no OpenGL."""
    tl.plan(different(8))  # what is imported late
    scenes = [different(count) for _ in range(TURNS)]
    found = [milliseconds(lambda given=given: tl.plan(given)) for given in scenes]
    print(f"{count} different balls of {len(BALL.faces)} triangles: plan {min(found):.0f} ms")


def main(count: int = 2000, side: int = 256) -> None:
    """Measure with whatever OpenGL there is."""
    scenes = {
        "merged": merged(count),
        "1 medium": scattered(count, 1),
        "16 media": scattered(count, 16),
        "60 media, union": scattered(count, 60, overlap="union"),
        "merged, glass": merged(count, ior=1.5),
        "glass": scattered(count, 1, ior=1.5),
    }
    size = (side, side)
    print(f"{count} balls of {len(BALL.faces)} triangles at {side} x {side}")
    print(f"{'scene':>15} | {'plan':>7} | {'first':>7} | {'frame':>7} | ratio")
    with tl.Renderer() as renderer:
        first = {name: milliseconds(lambda given=given: renderer.render(given, size)) for name, given in scenes.items()}
        plans: dict[str, list[float]] = {name: [] for name in scenes}
        frames: dict[str, list[float]] = {name: [] for name in scenes}
        for _ in range(TURNS):
            for name, given in scenes.items():
                again = replace(given)
                plans[name].append(milliseconds(lambda again=again: renderer.plan(again)))
                frames[name].append(milliseconds(lambda again=again: renderer.render(again, size)))
    for name in scenes:
        ratio = min(frames[name]) / min(frames["merged, glass" if "glass" in name else "merged"])
        print(f"{name:>15} | {min(plans[name]):7.1f} | {first[name]:7.0f} | {min(frames[name]):7.1f} | {ratio:5.2f}")


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:] if text != "--different"]
    (plan_of_different if "--different" in sys.argv else main)(*numbers)
