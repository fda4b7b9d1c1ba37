"""How many rays a second a bake traces, beside Embree alone on the same rays.

Run it with ``python tools/bake_throughput.py [MESH] [--size 1024] [--rays 64] [--threads N] [--rounds 3]``.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt

from translucent.assets import mesh_path
from translucent.bake.bake import bake_thickness
from translucent.bake.measure import CHUNK_RAYS, Measure
from translucent.bake.settings import BakeSettings
from translucent.bake.surface import Points, Surface
from translucent.bake.texels import Atlas
from translucent.bake.unwrap import Unwrapped, unwrap
from translucent.cpu.threads import in_threads, processors
from translucent.geometry.mesh import Mesh
from translucent.mesh_files import load_mesh

#: Rays that Embree alone traces in a round: enough for some seconds, and little memory.
SAMPLE = 1 << 23


def throughput(
    mesh: Mesh, size: int = 1024, rays: int = 64, threads: int | None = None, rounds: int = 3
) -> dict[str, float]:
    """Medians over interleaved rounds, in millions of rays a second.

    Parameters
    ----------
    mesh : Mesh
    size, rays : int
        Of the map.
    threads : int, optional
        Default: as many as there are processors.
    rounds : int

    Returns
    -------
    dict of str to float
        ``embree``: Embree alone, first hits in float32, on every so many of the bake's texels with all their rays,
        made ready beforehand, in as many threads. ``bake``: the whole call but for the texture coordinates, from the
        preparation of the mesh to the padded map. ``share``: of the second in the first.
    """
    threads = threads or processors()
    unwrapped = unwrap(mesh, size, None)
    settings = BakeSettings(size=size, rays=rays)
    surface = Surface.of(unwrapped.mesh)
    measure = Measure.of(surface, settings)
    prepared = _prepared(measure, _some_points(surface, unwrapped, size, SAMPLE // rays))
    count = sum(len(origins) for origins, _ in prepared)
    found: dict[str, list[float]] = {"embree": [], "bake": []}
    for _ in range(rounds):
        started = time.perf_counter()
        in_threads(lambda ray: surface.embree.scene.run(*ray), prepared, threads)
        found["embree"].append(count / (time.perf_counter() - started) / 1e6)
        report = bake_thickness(unwrapped.mesh, size, rays=rays, threads=threads).report
        found["bake"].append(report.mrays_per_second)
    medians = {name: float(np.median(rates)) for name, rates in found.items()}
    return {**medians, "share": medians["bake"] / medians["embree"], "rays": float(report.rays)}


def _some_points(surface: Surface, unwrapped: Unwrapped, size: int, most: int) -> Points:
    """Points of texels from all over the map, in the order in which the bake takes them."""
    texels = Atlas(unwrapped.uv[surface.faces], size, size).strip(0, size)
    step = max(1, len(texels.face) // most)
    # Runs of texels, as a bake has them: neighbors find the same parts of Embree's tree in the cache.
    kept = (np.arange(len(texels.face)) // 256) % step == 0
    return surface.points(texels.face[kept], texels.barycentric[kept])


def _prepared(measure: Measure, points: Points) -> list[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]]:
    """Origins and directions (n, 3) of the rays of points, in the portions that a bake traces at a time."""
    rays = measure.settings.rays
    step, parts = max(1, CHUNK_RAYS // rays), []
    for begin in range(0, len(points), step):
        some = points[begin : begin + step]
        origins = np.repeat(measure.rays.starts(some), rays, axis=0)
        directions = measure.directions.at(some, 0, rays).reshape(3, -1).T
        parts.append((origins, np.ascontiguousarray(directions)))
    return parts


@click.command()
@click.argument("mesh", type=click.Path(exists=True, dir_okay=False, path_type=Path), required=False)
@click.option("--size", default=1024, show_default=True, help="Texels along each side.")
@click.option("--rays", default=64, show_default=True, help="Rays from each texel.")
@click.option("--threads", type=int, help="Default: as many as there are processors.")
@click.option("--rounds", default=3, show_default=True, help="Of both; the medians are printed.")
def main(mesh: Path | None, size: int, rays: int, threads: int | None, rounds: int) -> None:
    """Rays a second of a bake of MESH (default: the bear of the toolkit), and of Embree alone."""
    found = throughput(load_mesh(mesh or mesh_path("bear")), size, rays, threads, rounds)
    click.echo(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
