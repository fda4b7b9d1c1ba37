"""Measure the cost of a bake: time for a point beside trimesh, and memory.

``python tools/measure_baking.py [MODEL...]`` measures points a second of the modes ``normal`` and ``inscribed``, beside
``trimesh.proximity.thickness`` with ``ray`` and ``max_sphere`` for the same points and normals; default: the bear and
the knot of the toolkit. Both take one ray for a point, or one sphere; trimesh needs rtree for its spheres. Seconds are
those of the clock, in as many threads as there are processors, of which trimesh uses one; ``--processor-time`` takes
one thread and the processor's time, which other work on the machine changes less. ``--memory`` bakes a map instead, of
4096 x 4096 texels, writes it and tells the most memory that the process has held; rays are traced in strips, so a
``--share`` of the rows takes as much memory as all of them, and less time.
"""

from __future__ import annotations

import dataclasses
import resource
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt
import trimesh

import translucent as tl
from translucent.assets import mesh_path
from translucent.bake.atlas import unwrap
from translucent.bake.measure import Measure
from translucent.bake.rays import PreparedMesh
from translucent.bake.settings import BakeSettings
from translucent.threads import in_threads, processors

Array = npt.NDArray[np.float64]

#: Seconds of a round, and points of the first one, which tells how many fill them, and of the longest.
SECONDS, FEWEST, MOST = 0.3, 50, 200_000

#: What trimesh calls the same.
THEIRS = {"normal": "ray", "inscribed": "max_sphere"}


def sampled(surface: PreparedMesh, count: int) -> tuple[npt.NDArray[np.int64], Array]:
    """Faces (count,) and barycentric weights (count, 3) of points that are spread by area."""
    rng = np.random.default_rng(2)
    a, b, c = surface.corners.transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    return face, 0.02 + 0.94 * rng.dirichlet([1, 1, 1], count)


def seconds(call: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds that a call takes, by a clock."""
    begin = clock()
    call()
    return clock() - begin


def compare(mesh: tl.Mesh, mode: str, rounds: int, processor_time: bool) -> str:
    """One line of the table."""
    smooth = PreparedMesh.of(mesh)
    # trimesh has the normals of the faces.
    surface = dataclasses.replace(smooth, normals=np.repeat(smooth.planes[:, None, :3], 3, axis=1))
    measure = Measure(surface, BakeSettings(mode=mode))  # type: ignore[arg-type]
    face, weights = sampled(surface, MOST)
    position = np.einsum("kc,kci->ki", weights, mesh.vertices[mesh.faces[surface.faces[face]]])
    normals = surface.planes[face, :3]
    peer = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points = surface.points(face, weights)
    threads = 1 if processor_time else processors()
    spent = partial(seconds, clock=time.process_time if processor_time else time.perf_counter)

    def ours(count: int) -> object:
        return in_threads(measure.at, [points[begin:count:threads] for begin in range(threads)], threads)

    def theirs(count: int) -> object:
        with np.errstate(all="ignore"):
            return trimesh.proximity.thickness(peer, position[:count], normals=normals[:count], method=THEIRS[mode])

    calls = ours, theirs
    for call in calls:
        call(FEWEST)  # what it prepares once
    counts = [int(np.clip(FEWEST * SECONDS / spent(partial(call, FEWEST)), FEWEST, MOST)) for call in calls]
    counts = [
        int(np.clip(n * SECONDS / spent(partial(call, n)), FEWEST, MOST)) for call, n in zip(calls, counts, strict=True)
    ]
    pairs = [[n / spent(partial(call, n)) for call, n in zip(calls, counts, strict=True)] for _ in range(rounds)]
    own, other = np.array(pairs).T
    return (
        f"{mesh.name:20} {len(mesh.faces):7} triangles  {mode:9} {np.median(own) / 1e3:9.1f} k points/s, trimesh "
        f"{THEIRS[mode]:10} {np.median(other) / 1e3:9.2f} k points/s: {np.median(own / other):5.1f} times"
    )


def most_memory(mesh: tl.Mesh, rays: int, share: float) -> str:
    """Bake and write a large map whose rows the mesh fills in part; return what it took."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    with_uv = unwrap(mesh, 4096, None).mesh
    assert with_uv.uv is not None
    baked = tl.bake_thickness(dataclasses.replace(with_uv, uv=with_uv.uv * (1.0, share)), 4096, rays=rays)
    with tempfile.TemporaryDirectory() as folder:
        baked.save(Path(folder) / "thickness.exr")
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return (
        f"{mesh.name}: {baked.report.rays / 1e6:.0f} million rays in {baked.report.seconds:.0f} s, at most "
        f"{most:.2f} GB ({before:.2f} GB before)"
    )


@click.command()
@click.argument("models", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--memory", is_flag=True, help="Bake 4096 x 4096 texels of the first MODEL.")
@click.option("--rays", default=64, show_default=True, help="With --memory: from each texel.")
@click.option("--share", default=1.0, show_default=True, help="With --memory: of the rows that the mesh fills.")
@click.option("--rounds", default=5, show_default=True, help="Of each; medians are printed.")
@click.option("--processor-time", is_flag=True, help="Of one thread, in place of the clock's.")
def main(models: tuple[Path, ...], memory: bool, rays: int, rounds: int, share: float, processor_time: bool) -> None:
    """Time for a point beside trimesh, or memory of a large map."""
    meshes = [tl.load_mesh(path) for path in models or (mesh_path("bear"), mesh_path("knot"))]
    if memory:
        click.echo(most_memory(meshes[0], rays, share))
        return
    for mesh in meshes:
        for mode in THEIRS:
            click.echo(compare(mesh, mode, rounds, processor_time))


if __name__ == "__main__":
    main()
