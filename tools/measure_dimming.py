"""Measure what rays to lights add to a frame: bodies between lamps and interfaces, against the same bodies, clear.

Frames take turns, so that the load of the machine cancels; times are those of the processor.
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
    """Scenes in which wine is in the light of bodies, by names."""
    wine, glass = tl.Medium(absorption=(1, 8, 5), ior=1.34), tl.Medium(absorption=(2, 1, 2), ior=1.5)
    rough, painted, polished = tl.Surface(roughness=0.3), tl.Surface(transmission=0.0, color=(0.8, 0.8, 0.7)), None
    camera = tl.Camera.look_at((0, 0.4, 2.6), (0, 0, 0), fov_y=32)
    turns = np.linspace(0.0, 1.5, lights)
    lamps = [tl.PointLight((-1.5 * np.cos(a), 1.2, 1.5 * np.sin(a) + 0.6), np.full(3, 4 / lights)) for a in turns]
    found = {}
    for name, surface in {"polished": polished, "rough": rough, "painted": painted}.items():
        bodies = [stand("bear", glass, (0.3, 0, 0), surface), stand("sphere", wine, (-0.3, 0.05, 0.35), surface)]
        found[f"{name}, {lights} lamps"] = tl.Scene(bodies, camera, lamps, tl.Environment.constant(0.1))
    return found


def clear(scene: tl.Scene) -> tl.Scene:
    """The scene with media that take no light."""
    media = [tl.Medium(ior=body.medium.ior) for body in scene.objects if body.medium]
    bodies = [replace(body, medium=medium) for body, medium in zip(scene.objects, media, strict=True)]
    return replace(scene, objects=bodies)


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--save", help="picture of the last scene")
    options = parser.parse_args()
    with tl.Renderer() as renderer:
        for name, wine in {**scenes(1), **scenes(4)}.items():
            times = np.zeros((options.rounds + 1, 2))
            for row in times:
                for i, scene in enumerate((clear(wine), wine)):
                    begun = time.process_time()
                    frame = renderer.render(scene, SIZE, samples=2)
                    row[i] = time.process_time() - begun
            ratio = np.median(times[1:, 1] / times[1:, 0])
            print(f"{name}: {ratio:.2f} times the {np.median(times[1:, 0]) * 1e3:.0f} ms without rays to lights")
        if options.save:
            frame.save(options.save)


if __name__ == "__main__":
    main()
