"""Renders some of the toolkit's meshes into out/, and says for each what ran, how fast, and how far from the truth."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import translucent as tl
from translucent.assets import mesh_path
from translucent.frames.metrics import interior
from translucent.scene.showcase import framing
from translucent.scene.stages import stage_named

SIZE = (960, 720)
OUT = Path("out")

#: A young red wine: what 2 cm of it leave of white light. Merlot as it was measured is nearly black in a glass.
RED_WINE = tl.Medium.from_color((0.62, 0.05, 0.09), distance=0.02, ior=1.34)

#: Each picture: bodies as (mesh, its medium); the first has what two of them claim.
PICTURES = {
    "bear": [("bear", tl.preset("gummy").medium)],
    "wine": [("goblet", tl.preset("crystal").medium), ("wine", RED_WINE)],
}


def scene_of(bodies: list[tuple[str, tl.Medium]]) -> tl.Scene:
    """The bodies, framed together for a studio."""
    objects = [
        tl.Object(tl.load_mesh(mesh_path(name)), medium, priority=-number)
        for number, (name, medium) in enumerate(bodies)
    ]
    camera = framing(objects, SIZE, stage=stage_named("studio"))
    return tl.Scene(objects, camera, overlap="priority" if len(objects) > 1 else "add")


def main() -> int:
    OUT.mkdir(exist_ok=True)
    try:
        renderer = tl.Renderer()
    except tl.RenderError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    with renderer:
        print(f"backend {renderer.provenance['backend']}: {renderer.provenance['renderer']}\n")
        for name, bodies in PICTURES.items():
            scene = scene_of(bodies)
            path = OUT / f"{name}.png"
            renderer.render(tl.staged(scene), SIZE, samples=8).save(path, tone="neutral")
            frame = renderer.render(
                scene, SIZE
            )  # once more at one sample: shaders are compiled, and rays are the reference's
            started = time.perf_counter()
            truth = tl.reference.render(scene, SIZE, refraction=False)  # thickness is that of straight rays anyway
            seconds = time.perf_counter() - started
            errors = tl.compare(frame, truth, mask=interior(tl.reference.hit_counts(scene, SIZE)))
            print(f"{path}: {', '.join(mesh for mesh, _ in bodies)}, {SIZE[0]}x{SIZE[1]}")
            print(f"  plan: {frame.plan}")
            print("  time: " + ", ".join(f"{step} {1e3 * s:.1f} ms" for step, s in frame.seconds.items()))
            print(f"  error against the float64 reference ({seconds:.1f} s on the CPU), in metres:")
            print(f"    {errors}")
            print(f"    p99.9 is {errors.p999 / scene.diagonal:.1e} of the scene's diagonal\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
