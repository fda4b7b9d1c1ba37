"""Truth of scenes for ``tools/measure_transport.py``: ``python tools/transport_truth.py FOLDER [NAME ...]``.

FOLDER holds `scenes.py`, as ``tools/transport`` does, with ``SCENES`` and ``make(name)``. For each name without an .npz
file, or with ``--again``, two independent pictures ``a`` and ``b`` of full light transport are traced and written, and
masks: ``mask``, pixels in which bodies alone are seen, and ``ground``, opaque objects alone, if there are any.

Mitsuba 3 traces the scenes that it knows, if it is installed, and `PathTraced` the others; ``--by`` chooses one. Rough
interfaces lose light in Mitsuba, so that their truth is that of `PathTraced`. Pictures grow by rounds of ``--paths``
paths of each pixel, until the noise of means of 4 x 4 pixels of ``mask`` is below ``--noise`` of their mean, or after
``--seconds``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from measure_transport import blocks

import translucent as tl
from translucent.arrays import Array, Mask
from translucent.files.paths import write_atomically
from translucent.geometry.mesh import Mesh, joined
from translucent.geometry.ray_caster import RayCaster
from translucent.interop.mitsuba import beyond_mitsuba

#: Side of the grid of points in a pixel that are all on bodies, or all on opaque objects, if it counts.
INSIDE = 4

Picture = Callable[[int], Array]


def masks(scene: tl.Scene, side: int) -> dict[str, Mask]:
    """Pixels (side, side) in which bodies alone are seen first, and opaque objects alone."""
    origins, directions = (np.reshape(part, (-1, 3)) for part in scene.camera.rays((INSIDE * side, INSIDE * side)))
    every = joined([(item.world_vertices, item.mesh.faces, None) for item in scene.objects], "all objects")
    face, _ = RayCaster(Mesh(*every[:2])).nearest(origins, directions)
    body = np.concatenate([np.full(len(item.mesh.faces), item.medium is not None) for item in scene.objects])

    def whole(hit: Mask) -> Mask:
        return np.asarray(hit.reshape(side, INSIDE, side, INSIDE).all(axis=(1, 3)))

    ground = whole((face >= 0) & ~body[face])
    return {"mask": whole((face >= 0) & body[face])} | ({"ground": ground} if ground.any() else {})


def known_to_mitsuba(scene: tl.Scene) -> bool:
    """True if Mitsuba is installed, and traces all of the light of a scene."""
    rough = any(body.surface is not None and body.surface.roughness > 0.0 for body in scene.bodies)
    return not rough and not any(beyond_mitsuba(scene)) and find_spec("mitsuba") is not None


def by_mitsuba(scene: tl.Scene, side: int, paths: int) -> Picture:
    """Tracer of pictures by seed: Mitsuba."""
    mitsuba: Any = import_module("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    loaded = mitsuba.load_dict(tl.to_mitsuba(scene, (side, side)))
    return lambda seed: np.array(mitsuba.render(loaded, spp=paths, seed=seed), np.float64)


def by_paths(renderer: tl.Renderer, scene: tl.Scene, side: int, paths: int) -> Picture:
    """Tracer of pictures by seed: `PathTraced`."""
    return lambda seed: renderer.render(scene, (side, side), tl.PathTraced(paths, seed)).radiance.astype(np.float64)


def traced(picture: Picture, mask: Mask, most: float, seconds: float) -> tuple[Array, Array, int, float]:
    """Two pictures, rounds of each, and the noise of blocks of their mean as a fraction."""
    sums: list[Array] = [np.zeros(()), np.zeros(())]
    began, rounds, noise = time.monotonic(), 0, np.inf
    inside = blocks(mask.astype(np.float64))[..., 0] == 1.0
    while noise > most and time.monotonic() < began + seconds:
        sums = [total + picture(2 * rounds + i) for i, total in enumerate(sums)]
        rounds += 1
        a, b = (total / rounds for total in sums)
        noise = 0.5 * float(np.sqrt(np.square(blocks(a) - blocks(b))[inside].mean()) / a[mask].mean())
    return a, b, rounds, noise


def main() -> None:
    """Trace what lacks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="name")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--by", choices=("mitsuba", "paths"))
    parser.add_argument("--paths", type=int, default=64)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--seconds", type=float, default=600.0)
    chosen = parser.parse_args()
    if not (chosen.folder / "scenes.py").is_file():
        parser.error(f"{chosen.folder} holds no scenes.py; copy one, as tools/transport/scenes.py, into this folder")
    sys.path.insert(0, str(chosen.folder))
    scenes = import_module("scenes")
    if unknown := set(chosen.names) - set(scenes.SCENES):
        parser.error(
            f"{chosen.folder}/scenes.py has no scene {', '.join(sorted(unknown))}; it has {', '.join(scenes.SCENES)}"
        )
    with tl.Renderer() as renderer:
        for name in chosen.names or scenes.SCENES:
            target = chosen.folder / f"{name}.npz"
            if target.is_file() and not chosen.again:
                continue
            scene, side = scenes.make(name)
            by = chosen.by or ("mitsuba" if known_to_mitsuba(scene) else "paths")
            tracer = by_mitsuba if by == "mitsuba" else lambda *given: by_paths(renderer, *given)
            found = masks(scene, side)
            a, b, rounds, noise = traced(tracer(scene, side, chosen.paths), found["mask"], chosen.noise, chosen.seconds)

            def write(path: Path, a: Array = a, b: Array = b, found: dict[str, Mask] = found) -> None:
                with path.open("wb") as file:
                    np.savez_compressed(file, a=a.astype(np.float32), b=b.astype(np.float32), **found)

            write_atomically(target, write)
            print(f"{name}: {by}, 2 x {rounds * chosen.paths} paths, noise of blocks {noise:.4f}", flush=True)


if __name__ == "__main__":
    main()
