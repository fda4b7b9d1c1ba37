"""Measure the rays a second that a bake traces, beside Embree alone on the same rays.

Run it with ``python tools/bake_throughput.py [MESH] [--size 1024] [--rays 64] [--threads N] [--rounds 3]``.

``--batch 200`` bakes so many assets instead, each another size of MESH with UVs of its own, in ``--threads`` processes,
from start to end: processes that start, models that are read, maps that are written. ``--dask`` does so on workers of
Dask, of which all but one come when a tenth of the assets is done, and one is killed, and another comes, at a third;
with ``--dask steady`` all are there from the beginning. ``share_of_workers`` is beside Embree in as many threads as
there were workers at each time, from when the scheduler knows a worker to when it has lost it. ``processor_share`` is
of processor time, which other work on the machine changes less than the clock; it counts all processes, the scheduler
and what a killed worker had not finished as well. Dask's own profiler, which takes a twentieth, is off, and
its clock of event loops, which takes a fiftieth, ticks once a second.
"""

from __future__ import annotations

import json
import logging
import os
import resource
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import numpy.typing as npt

from translucent.assets import mesh_path
from translucent.bake.atlas import Atlas, Unwrapped, unwrap
from translucent.bake.bake import bake_thickness
from translucent.bake.batch import BatchReport, bake_many
from translucent.bake.gltf_builder import mesh_file
from translucent.bake.jobs import Job
from translucent.bake.measure import Measure
from translucent.bake.rays import Points, PreparedMesh
from translucent.bake.record import parts_of, read_record
from translucent.bake.settings import BakeSettings
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import write_gltf
from translucent.mesh_files import load_mesh
from translucent.threads import in_threads, processors

#: Rays that Embree alone traces in a round: enough for some seconds, and little memory.
SAMPLE = 1 << 23
#: Of these, rays that a thread takes at a time: so few that threads end together.
PORTION = 1 << 17


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
        preparation of the mesh to the padded map. ``share``: of the second in the first. ``processor_share``: of
        processor time.
    """
    threads = threads or processors()
    unwrapped = unwrap(mesh, size, None)
    trace = _embree_alone(unwrapped, size, rays, threads)
    found: dict[str, list[float]] = {"embree": [], "bake": [], "share": [], "processor_share": []}
    for _ in range(rounds):
        clock, processor = trace()
        used = time.process_time()
        report = bake_thickness(unwrapped.mesh, size, rays=rays, threads=threads).report
        used = time.process_time() - used
        found["embree"].append(clock)
        found["bake"].append(report.mrays_per_second)
        found["share"].append(report.mrays_per_second / clock)
        found["processor_share"].append(report.rays / 1e6 / used / processor)
    return {**{name: float(np.median(each)) for name, each in found.items()}, "rays": float(report.rays)}


def _embree_alone(unwrapped: Unwrapped, size: int, rays: int, threads: int) -> Callable[[], tuple[float, float]]:
    """A round of Embree alone: millions of rays a second, by the clock and of processor time."""
    surface = PreparedMesh.of(unwrapped.mesh)
    measure = Measure(surface, BakeSettings(size=size, rays=rays))
    prepared = _prepared(measure, _some_points(surface, unwrapped, size, SAMPLE // rays))
    count = sum(len(origins) for origins, _ in prepared) / 1e6

    def trace() -> tuple[float, float]:
        started, used = time.perf_counter(), time.process_time()
        in_threads(lambda ray: surface.embree.scene.run(*ray), prepared, threads)
        return count / (time.perf_counter() - started), count / (time.process_time() - used)

    return trace


def batch(mesh: Mesh, count: int, size: int, rays: int, workers: int, dask: str | None) -> dict[str, Any]:
    """A batch from start to end, beside Embree alone before and after it.

    Returns
    -------
    dict of str to float
        ``embree`` and ``bake`` in millions of rays a second by the clock, ``share`` of the second in the first, and
        ``processor_share``; ``jobs``: seconds of all jobs together, and of these ``bakes``, from mesh to padded map;
        on Dask ``share_of_workers``.
    """
    unwrapped = unwrap(mesh, size, None)
    trace = _embree_alone(unwrapped, size, rays, workers)
    with tempfile.TemporaryDirectory() as folder:
        jobs = []
        for number in range(count):
            scaled = Mesh(unwrapped.mesh.vertices * (1.0 + 0.001 * number), unwrapped.mesh.faces, unwrapped.mesh.uv)
            path = Path(folder) / f"asset{number:03}.glb"
            write_gltf(mesh_file(scaled), path)
            output = str(path.with_suffix(".exr"))
            jobs.append({"model": str(path), "output": output, "settings": {"size": size, "rays": rays}})
        alone, used, started = [trace()], _used(), time.perf_counter()
        present = 0.0
        if dask:
            report, present = _on_dask(jobs, workers, steady=dask == "steady")
        else:
            report = bake_many(jobs, workers=workers)
        seconds, used = time.perf_counter() - started, _used() - used
        alone.append(trace())
        records = [read_record(Path(str(job["output"]))) or {} for job in jobs]
        bakes = sum(part["report"]["seconds"] for record in records for part in parts_of(record))
    traced = sum(asset["rays"] for asset in report.assets if "rays" in asset) / 1e6
    clock, processor = np.mean(alone, axis=0).tolist()
    return {
        "embree": clock,
        "bake": traced / seconds,
        "share": traced / seconds / clock,
        "processor_share": traced / used / processor,
        **({"share_of_workers": traced / present / (clock / workers)} if dask else {}),
        "seconds": seconds,
        "jobs": sum(asset["seconds"] for asset in report.assets),
        "bakes": bakes,
        **{status: report.count(status) for status in ("baked", "skipped", "failed")},
    }


def _used() -> float:
    """Processor seconds of this process and of its children that have ended."""
    found = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in found)


def _on_dask(jobs: list[Job], workers: int, *, steady: bool) -> tuple[BatchReport, float]:
    """A batch on workers, which come and go unless they are `steady`; and for how many seconds they were there."""
    import dask
    from distributed import Client, LocalCluster, SchedulerPlugin

    class Presence(SchedulerPlugin):
        """Seconds of workers: those that are there have begun, those that have gone have ended."""

        seconds = 0.0

        def add_worker(self, scheduler: Any, worker: str) -> None:
            self.seconds -= time.perf_counter()

        def remove_worker(self, scheduler: Any, worker: str, **_: Any) -> None:
            self.seconds += time.perf_counter()

    logging.getLogger("distributed").setLevel(logging.ERROR)
    done, presence = 0, Presence()
    with (
        dask.config.set({"distributed.worker.profile.enabled": False, "distributed.admin.tick.interval": "1s"}),
        LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None, memory_limit=0) as cluster,
        Client(cluster) as client,
    ):
        cluster.scheduler.add_plugin(presence)
        cluster.scale(workers if steady else 1)

        def changed(_: object) -> None:
            nonlocal done
            done += 1
            if steady:
                return
            if done == max(len(jobs) // 10, 1):
                cluster.scale(workers)
            if done == len(jobs) // 3:
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

        report = bake_many(jobs, client.get_executor(), progress=changed)
        left = len(client.scheduler_info(n_workers=-1)["workers"])
        return report, presence.seconds + left * time.perf_counter()


def _some_points(surface: PreparedMesh, unwrapped: Unwrapped, size: int, most: int) -> Points:
    """Points of texels from all over the map, in the order in which the bake takes them."""
    texels = Atlas(unwrapped.uv[surface.faces], size, size).strip(0, size)
    step = max(1, len(texels.face) // most)
    # Runs of texels, as a bake has them: neighbors find the same parts of Embree's tree in the cache.
    kept = (np.arange(len(texels.face)) // 256) % step == 0
    return surface.points(texels.face[kept], texels.barycentric[kept])


def _prepared(measure: Measure, points: Points) -> list[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]]:
    """Origins and directions (n, 3) of the rays of points, in portions, in the order in which a bake traces them."""
    rays = measure.settings.rays
    step, parts = max(1, PORTION // rays), []
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
@click.option("--batch", "assets", type=int, metavar="N", help="Bake a batch of so many assets instead.")
@click.option(
    "--dask",
    type=click.Choice(["changing", "steady"]),
    is_flag=False,
    flag_value="changing",
    help="Of --batch: on Dask, with workers that come and go (default), or that are there all the time.",
)
def main(
    mesh: Path | None, size: int, rays: int, threads: int | None, rounds: int, assets: int | None, dask: str | None
) -> None:
    """Rays a second of a bake of MESH (default: the bear of the toolkit), and of Embree alone."""
    model = load_mesh(mesh or mesh_path("bear"))
    if assets is None:
        found: dict[str, Any] = throughput(model, size, rays, threads, rounds)
    else:
        found = batch(model, assets, size, rays, threads or processors(), dask)
    click.echo(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
