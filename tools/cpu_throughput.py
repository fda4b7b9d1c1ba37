"""Measure the rays a second that the CPU backend traces, beside Embree alone on the same rays.

``python tools/cpu_throughput.py [MESH]`` prints millions of rays a second; default: the bear of the toolkit.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

import numpy as np

from translucent.assets import mesh_path
from translucent.cpu.hits import Band, PictureRays, PixelTracer, TracedMesh
from translucent.cpu.renderer import CpuRenderer
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import BEFORE
from translucent.mesh_files import load_mesh
from translucent.planning.plan import plan
from translucent.scene.showcase import showcase
from translucent.threads import in_threads, processors


def throughput(
    mesh: Mesh, size: tuple[int, int] = (1024, 1024), threads: int | None = None, rounds: int = 5
) -> dict[str, float]:
    """Medians over interleaved rounds, in millions of rays (pixels) a second.

    Parameters
    ----------
    mesh : Mesh
        Seen from a little above, filling the picture.
    size : (width, height)
        In pixels.
    threads : int, optional
        Default: as many as there are processors.
    rounds : int

    Returns
    -------
    dict of str to float
        ``first_hit``: Embree alone, nearest hits in float32. ``all_hits``: every surface, exact, in order. ``frame``:
        that with shading, from call to arrays. Beside them ``hits_per_ray``, and ``last_resort``, the share of rays
        that tried all faces, since what Embree had found was not proved to be all.
    """
    threads = threads or processors()
    scene = showcase(mesh, size=size, stage="none")
    (body,) = scene.objects
    picture = PictureRays.of(scene.camera, size)
    tracer = PixelTracer(TracedMesh.of(mesh), body, picture)
    bands, pixels = list(picture.bands()), size[0] * size[1]
    renderer, chosen = CpuRenderer(threads), plan(scene)
    work: dict[str, Callable[[], object]] = {
        "first_hit": _first_hits(tracer, bands, threads),
        "all_hits": lambda: in_threads(tracer.hits, bands, threads),
        "frame": lambda: renderer.render(chosen, size),
    }
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds + 1):
        for name, run in work.items():
            started = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - started)
    # The first round warms up.
    rates = {name: pixels / float(np.median(taken[1:])) / 1e6 for name, taken in seconds.items()}
    found = in_threads(tracer.search, bands, threads)
    hits, incomplete = (sum(counts) for counts in zip(*((len(h.pixel), int(i.sum())) for h, i in found), strict=True))
    return {**rates, "hits_per_ray": hits / pixels, "last_resort": incomplete / pixels}


def _first_hits(tracer: PixelTracer, bands: list[Band], threads: int) -> Callable[[], object]:
    """Let Embree find the nearest hit of all rays of a picture, these made ready beforehand."""
    rays = []
    for band in bands:
        origins, directions = tracer.rays(band, np.arange(band.pixels))
        start = -np.einsum("ki,ki->k", origins, directions) - BEFORE
        with np.errstate(under="ignore"):
            at = (origins + start[:, None] * directions).astype(np.float32)
            rays.append((at, directions.astype(np.float32)))
    return lambda: in_threads(lambda ray: tracer.embree.scene.run(*ray, output=True), rays, threads)


if __name__ == "__main__":
    print(json.dumps(throughput(load_mesh(sys.argv[1] if len(sys.argv) > 1 else mesh_path("bear"))), indent=1))
