"""Measure what lights cost: ``python tools/measure_lights.py [--rounds N]``.

First frames of a bear on a ground, whose maps are new, and those that follow, by the number of lights. Then rays that
tell what bodies keep of highlights and paint: scenes whose bodies take next to no light against the same with clear
ones, which cast no such rays, and else look alike. Frames take turns; times are those of the processor, so that what
else runs counts little.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

import translucent as tl
from translucent.assets import mesh_path

SIZE = (320, 240)


def stand(mesh: str, medium: tl.Medium, place: tuple[float, float, float], surface: tl.Surface) -> tl.Object:
    """A mesh of unit diagonal at a place."""
    found = tl.load_mesh(mesh_path(mesh))
    size = float(np.linalg.norm(np.ptp(found.vertices, axis=0)))
    moved = (found.vertices - found.center) / size + place
    return tl.Object(tl.Mesh(moved, found.faces), medium, surface=surface)


def scenes(lights: int) -> dict[str, tl.Scene]:
    """Scenes in which bodies are in each other's light, by names."""
    wine, glass = tl.Medium(absorption=1e-6, ior=1.34), tl.Medium(absorption=1e-6, ior=1.5)
    rough, painted, polished = tl.Surface(roughness=0.3), tl.Surface(transmission=0.0, color=(0.8, 0.8, 0.7)), None
    camera = tl.Camera.look_at((0, 0.4, 2.6), (0, 0, 0), fov_y=32)
    turns = np.linspace(0.0, 1.5, lights)
    shining = [tl.PointLight((-1.5 * np.cos(a), 1.2, 1.5 * np.sin(a) + 0.6), np.full(3, 4 / lights)) for a in turns]
    found = {}
    for name, surface in {"polished": polished, "rough": rough, "painted": painted}.items():
        bodies = [stand("bear", glass, (0.3, 0, 0), surface), stand("sphere", wine, (-0.3, 0.05, 0.35), surface)]
        found[f"{name}, {lights} lights"] = tl.Scene(bodies, camera, shining, tl.Environment.constant(0.1))
    return found


def clear(scene: tl.Scene) -> tl.Scene:
    """The scene with media that take no light."""
    media = [tl.Medium(ior=body.medium.ior) for body in scene.objects if body.medium]
    bodies = [replace(body, medium=medium) for body, medium in zip(scene.objects, media, strict=True)]
    return replace(scene, objects=bodies)


def seconds(renderer: tl.Renderer, scene: tl.Scene, size: tuple[int, int], samples: int) -> float:
    """Processor time of a frame."""
    begun = time.process_time()
    renderer.render(scene, size, samples=samples)
    return time.process_time() - begun


def lit(bare: tl.Scene, count: int) -> tl.Scene:
    """The scene under a square of lights that shine as one."""
    body = bare.bodies[0]
    center, size = body.mesh.center, float(np.linalg.norm(body.bounds[1] - body.bounds[0]))
    side = round(count**0.5)
    steps = (np.arange(side) + 0.5) / side - 0.5
    places = [center + size * np.array([1.5 + x, 2.0, 1.0 + z]) for x in steps for z in steps]
    return replace(bare, lights=[tl.PointLight(place, np.full(3, 4 * size**2 / count)) for place in places])


def measure_rays(renderer: tl.Renderer, rounds: int) -> None:
    """Print what rays to lights add."""
    for name, dimmed in {**scenes(1), **scenes(4)}.items():
        times = np.zeros((rounds + 1, 2))
        for row in times:
            for i, scene in enumerate((clear(dimmed), dimmed)):
                row[i] = seconds(renderer, scene, SIZE, 2)
        ratio = np.median(times[1:, 1] / times[1:, 0])
        print(
            f"{name}: {ratio:.2f} times the {np.median(times[1:, 0]) * 1e3:.0f} ms without rays to lights", flush=True
        )


def measure_maps(renderer: tl.Renderer, rounds: int) -> None:
    """Print what maps of shadows of many lights take, and those of the environment."""
    red = tl.Medium.from_color((0.7, 0.2, 0.2), distance=0.005)
    staged = tl.showcase(tl.load_mesh(mesh_path("bear")), red, size=SIZE)
    bare = replace(staged, lights=[], environment_shadows=0)
    cases = {f"{count} lights": lit(bare, count) for count in (1, 4, 16)}
    cases["32 directions of the environment"] = replace(bare, environment_shadows=32)
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    for number in range(rounds + 1):
        for name, scene in cases.items():
            other = tl.PointLight((1, 1 + number, 1), (1, 1, 1))
            renderer.render(replace(bare, lights=[other]), (16, 12), samples=1)  # the maps are others
            times[name].append((seconds(renderer, scene, SIZE, 1), seconds(renderer, scene, SIZE, 1)))
    for name, found in times.items():
        first, later = 1e3 * np.median(found[1:], axis=0)
        print(f"{name}: first frame {first:.0f} ms, later ones {later:.0f} ms", flush=True)


def main() -> None:
    """Print all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with tl.Renderer() as renderer:
        measure_maps(renderer, options.rounds)
        measure_rays(renderer, options.rounds)


if __name__ == "__main__":
    main()
