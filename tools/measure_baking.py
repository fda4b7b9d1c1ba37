"""What a bake costs: time for a point beside trimesh, and memory.

``python tools/measure_baking.py [MODEL...]`` measures points a second of the modes ``normal`` and ``inscribed``, beside
``trimesh.proximity.thickness`` with ``ray`` and ``max_sphere`` for the same points and normals; default: the bear and
the knot of the toolkit. Both take one ray for a point, or one sphere, which a bake starts from 64 rays. ``--memory``
bakes a map instead, of 4096 x 4096 texels with 64 rays each, and tells the most memory that the process has held.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt
import trimesh

import translucent as tl
from translucent.assets import mesh_path
from translucent.bake.measure import Measure
from translucent.bake.settings import BakeSettings
from translucent.bake.surface import Surface
from translucent.bake.unwrap import unwrap
from translucent.cpu.threads import in_threads, processors

Array = npt.NDArray[np.float64]

#: Points of a round: trimesh's spheres take a hundredth of the time for each on large meshes.
POINTS = {"normal": 200_000, "inscribed": 2_000}

#: What trimesh calls the same.
THEIRS = {"normal": "ray", "inscribed": "max_sphere"}

ROUNDS = 5


def sampled(surface: Surface, count: int) -> tuple[npt.NDArray[np.int64], Array]:
    """Faces (count,) and barycentric weights (count, 3) of points that are spread by area."""
    rng = np.random.default_rng(2)
    area = np.linalg.norm(np.cross(*(surface.corners[:, i] - surface.corners[:, 0] for i in (1, 2))), axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    return face, 0.02 + 0.94 * rng.dirichlet([1, 1, 1], count)


def seconds(call: Callable[[], object]) -> float:
    """That a call takes."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def compare(mesh: tl.Mesh, mode: str) -> str:
    """One line of the table."""
    surface = Surface.of(mesh, crease=0.0)
    measure = Measure.of(surface, BakeSettings(mode=mode))  # type: ignore[arg-type]
    face, weights = sampled(surface, POINTS[mode])
    position = np.einsum("kc,kci->ki", weights, mesh.vertices[mesh.faces[surface.faces[face]]])
    normals = surface.planes[face, :3]
    peer = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points = surface.points(face, weights)
    threads = processors()
    parts = [points[begin::threads] for begin in range(threads)]

    def ours() -> object:
        return in_threads(measure.at, parts, threads)

    def theirs() -> object:
        with np.errstate(all="ignore"):
            return trimesh.proximity.thickness(peer, position, normals=normals, method=THEIRS[mode])

    ours(), theirs()  # what both prepare once
    own, other = (
        np.array(times) for times in zip(*[(seconds(ours), seconds(theirs)) for _ in range(ROUNDS)], strict=True)
    )
    rates = POINTS[mode] / np.median(own) / 1e3, POINTS[mode] / np.median(other) / 1e3
    return (
        f"{mesh.name:20} {len(mesh.faces):7} triangles  {mode:9} {rates[0]:9.1f} k points/s, trimesh {THEIRS[mode]:10} "
        f"{rates[1]:9.1f} k points/s: {np.median(other / own):5.1f} times"
    )


def most_memory(mesh: tl.Mesh) -> str:
    """Bake a large map, and tell what it took."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    report = tl.bake_thickness(unwrap(mesh, 4096, None).mesh, 4096, rays=64).report
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return (
        f"{mesh.name}: {report.rays / 1e6:.0f} million rays in {report.seconds:.0f} s, at most {most:.2f} GB "
        f"({before:.2f} GB before)"
    )


@click.command()
@click.argument("models", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--memory", is_flag=True, help="Bake 4096 x 4096 texels of the first MODEL.")
def main(models: tuple[Path, ...], memory: bool) -> None:
    """Time for a point beside trimesh, or memory of a large map."""
    meshes = [tl.load_mesh(path) for path in models or (mesh_path("bear"), mesh_path("knot"))]
    if memory:
        click.echo(most_memory(meshes[0]))
        return
    for mesh in meshes:
        for mode in POINTS:
            click.echo(compare(mesh, mode))


if __name__ == "__main__":
    main()
