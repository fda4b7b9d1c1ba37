"""Batches of bakes: each asset is a job of its own, in any executor; finished jobs are skipped, failures isolated.

The default executor is a pool of processes on this machine in which no process takes the others along when it dies.
Maps over UDIM tiles are one job: one file a tile, all of one scale.
"""

from __future__ import annotations

import ctypes
import dataclasses
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, as_completed, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np

from translucent.arguments import brief, checked
from translucent.bake.atlas import tiles_of
from translucent.bake.gltf_builder import GlbBuilder
from translucent.bake.gltf_targets import find_targets, first_transforms
from translucent.bake.jobs import (
    Job,
    Progress,
    Results,
    bake_file,
    bake_one,
    check_job,
    content_hash,
    has_parts,
    is_done,
)
from translucent.bake.record import Record, add_record, files_of, parts_of, read_record
from translucent.bake.thickness_map import ThicknessMap, add_map, shared
from translucent.errors import InputError, TranslucentError
from translucent.files.paths import OutputFiles
from translucent.geometry.mesh import Mesh
from translucent.gltf.file import read_gltf
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.threads import processors
from translucent.units import metres_per_unit
from translucent.version import VERSION

Status = Literal["baked", "suspect", "skipped", "failed"]
Item = TypeVar("Item")
Result = TypeVar("Result")

#: Part of a file's name that a tile's number takes the place of.
UDIM = "<UDIM>"

#: Largest fraction of rays without an exit in a map that is not suspect.
MAX_ESCAPED = 0.05

#: Seconds that a worker process has for cleaning up when the work is canceled.
PATIENCE = 5.0

#: Parameters of glibc's mallopt (malloc.h), and the largest values that glibc itself would come to.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
MOST_REUSED = 32 << 20

#: Option of Linux's prctl: the signal that a process gets when its parent ends (linux/prctl.h).
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class BatchReport:
    """Report on the jobs of a batch.

    Attributes
    ----------
    assets : tuple of dict
        Per job, in the order in which they were given: ``model``, ``output``, ``status`` (baked, suspect, skipped or
        failed), ``seconds``, ``error`` (None, or one line), of baked and suspect ones ``range``, ``rays`` and
        ``warnings``, and of suspect ones ``doubts``. What is suspect is written, and stays so when it is done already.
    seconds : float
        From the first to the last.
    """

    assets: tuple[Record, ...]
    seconds: float

    def count(self, status: Status) -> int:
        """Number of jobs with this status."""
        return sum(asset["status"] == status for asset in self.assets)

    def summary(self) -> Record:
        """Report as values that JSON can hold."""
        counts = {status: self.count(status) for status in get_args(Status)}
        return {**counts, "seconds": self.seconds, "assets": list(self.assets)}

    def __str__(self) -> str:
        name = max((len(Path(asset["model"]).name) for asset in self.assets), default=0)
        return "\n".join([*(asset_line(asset, name) for asset in self.assets), self.total])

    @property
    def total(self) -> str:
        """Counts of each status, in one line."""
        counts = ", ".join(f"{self.count(status)} {status}" for status in get_args(Status))
        return f"{counts} in {self.seconds:.1f} s"


def asset_line(asset: Record, width: int = 0) -> str:
    """Status line of one asset, with its name `width` characters wide."""
    text = f"{Path(asset['model']).name:<{width}}  {asset['status']:<7}  {asset['seconds']:>7.1f} s"
    if asset["status"] == "failed":
        return f"{text}  {asset['error']}"
    if found := asset.get("range"):
        text += f"  {found['min']:.4g} .. {found['max']:.4g} {asset['unit']}"
        text += f", {asset['parts']} parts" if asset["parts"] > 1 else ""
    flipped = [line for line in asset.get("repairs", []) if line.startswith("flipped")]
    return text + "".join(f"; {line}" for line in [*asset.get("doubts", []), *flipped, *asset.get("warnings", [])])


@checked
def bake_many(
    jobs: Iterable[Job],
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Callable[[Record], None] | None = None,
) -> BatchReport:
    """Bake many assets; a bad one does not stop the others.

    Where an output is there already, whole, and made from the same meshes and settings by the same version, it is
    skipped. Files appear complete or not at all, so a job may be done twice, or be killed, at any time.

    Parameters
    ----------
    jobs : iterable of dict
        See `translucent.bake.jobs`. Paths may be relative; an executor on other machines must see the same files.
    executor : Executor, optional
        Any of `concurrent.futures`, such as ``distributed.Client(...).get_executor()``. Default: processes here. They
        are spawned, so a script calls this below ``if __name__ == "__main__":``.
    workers : int, optional
        Of the default: how many processes; default: one per processor.
    progress : callable, optional
        Gets the entry of each asset when it is finished.

    Returns
    -------
    BatchReport

    Raises
    ------
    InputError
        If a job is malformed, two have one output, or `workers` is below 1. What is wrong with a single asset is
        in the report.
    """
    places, jobs = ("model", "output", "high", "cage"), list(jobs)
    if wrong := [job for job in jobs if not isinstance(job, dict)]:
        raise InputError(f"job {brief(wrong[0])}", f"of type {type(wrong[0]).__name__}", "give a dict")
    given = [{**job, **{key: str(Path(job[key]).absolute()) for key in places if job.get(key)}} for job in jobs]
    outputs: dict[str, Job] = {}
    for job in given:
        # Some file systems ignore case.
        other = outputs.setdefault(str(job.get("output")).casefold(), job)
        if other is not job:
            both = f"{other.get('model')!r} and {job.get('model')!r}"
            raise InputError(
                f"output {job.get('output')!r}",
                f"this file would also be the output of {both}",
                "give each output a different name",
            )
    if workers is not None and workers < 1:
        raise InputError(f"{workers} worker processes", "the number must be at least 1", "give 1 or more")
    for job in given:
        check_job(job)
    started = time.perf_counter()
    found: dict[str, Record] = {}
    records = _in_executor(executor, given) if executor is not None else _here(given, workers or processors())
    for record in records:
        found[record["output"]] = record
        if progress is not None:
            progress(record)
    return BatchReport(tuple(found[job["output"]] for job in given), time.perf_counter() - started)


def _here(jobs: list[Job], workers: int) -> Iterator[Record]:
    workers = min(workers, max(len(jobs), 1))
    per_worker = max(processors() // workers, 1)
    died = "the worker process ended (out of memory, or a crash); try a smaller --size"
    tasks = [{"threads": per_worker, **job} for job in jobs]
    return in_processes(run_job, tasks, workers, lambda job: failed_entry(job, died))


def _in_executor(executor: Executor, jobs: list[Job]) -> Iterator[Record]:
    # An executor has its own idea of how many run at a time on a machine.
    futures = {executor.submit(run_job, {"threads": 1, **job}, VERSION): job for job in jobs}
    try:
        for future in as_completed(futures):
            job = futures.pop(future)  # Dask makes results of a lost worker again as long as anybody holds them
            try:
                yield future.result()
            except Exception as error:  # noqa: BLE001 - lost workers, other versions: each executor raises its own kinds
                yield failed_entry(job, f"the worker failed ({type(error).__name__}: {error})")
    finally:
        for future in futures:
            future.cancel()


def run_job(job: Job, version: str | None = None) -> Record:
    """Run one job of a batch; errors are in the entry that it returns.

    `version` is the caller's: another machine may have another one, whose maps differ.
    """
    started = time.perf_counter()
    reuse_freed_memory_if_fixed()
    if version not in (None, VERSION):
        return failed_entry(job, f"the worker has version {VERSION}, and not {version}; install {version} there")
    status: Status = "skipped"
    more: Record = {}
    try:
        content = content_hash(job)
        if is_done(job, content):
            record = read_record(Path(job["output"])) or {}
        else:
            record, results = bake_file(job, content=content)
            status, more = "baked", reported_values(record, results, Path(job["output"]).parent)
    except TranslucentError as error:
        return failed_entry(job, str(error), time.perf_counter() - started)
    except Exception as error:  # noqa: BLE001 - a defect of ours, or a full memory: the others go on
        text = f"unexpected {type(error).__name__}; {error or 'no details'}"
        return failed_entry(job, text, time.perf_counter() - started)
    if doubts := _doubts(job, record):
        status, more = "suspect", {"doubts": doubts, **more}
    return _entry(job, status, time.perf_counter() - started, **more)


def failed_entry(job: Job, error: str, seconds: float = 0.0) -> Record:
    """Entry of a job that failed."""
    return _entry(job, "failed", seconds, error)


def _entry(job: Job, status: Status, seconds: float, error: str | None = None, **more: Any) -> Record:
    entry = {"model": job["model"], "output": job["output"], "status": status, "seconds": seconds, "error": error}
    return {**entry, **more}


def _doubts(job: Job, record: Record) -> list[str]:
    """Reasons why the maps of a record are suspect."""
    most, found = job.get("max_escaped", MAX_ESCAPED), []
    for part in parts_of(record):
        name = f"{part['mesh']['name']}: " if "maps" in record else ""
        if (escaped := part["report"]["escaped"]) > most:
            found.append(f"{name}{escaped:.0%} of the rays found no exit, more than {most:.1%}")
        if part["range"] is None or part["range"]["max"] == 0:
            found.append(f"{name}the thickness is 0 everywhere")
    return found


def reported_values(record: Record, results: Any, folder: Path) -> Record:
    """Summary of a bake: files, range, unit, rays and warnings of all its parts together."""
    parts, files = parts_of(record), files_of(record)
    ranges = [part["range"] for part in parts if part["range"] is not None]
    warnings = [line for part in parts for line in (*part["report"]["warnings"], *part.get("warnings", []))]
    repairs = [line for result in results.values() for line in result.mesh.repairs]
    whole = {
        "min": min((one["min"] for one in ranges), default=0.0),
        "max": max((one["max"] for one in ranges), default=0.0),
    }
    return {
        "unit": record["unit"],
        "range": whole,
        "rays": sum(part["report"]["rays"] for part in parts),
        "parts": len(parts),
        "files": [str(folder / one["file"]) for one in files],
        "uv_file": str(folder / record["uv_file"]["file"]) if "uv_file" in record else None,
        "left_out": record.get("left_out", []),
        "warnings": list(dict.fromkeys(warnings)),
        "repairs": list(dict.fromkeys(repairs)),
        "hash": record.get("hash"),
    }


def in_processes(
    task: Callable[[Item], Result], items: list[Item], workers: int, lost: Callable[[Item], Result]
) -> Iterator[Result]:
    """Results of a task for each item, in the order in which they finish.

    Processes are spawned, not forked: OpenGL and threads do not survive a fork. When one dies (out of memory, or a
    crash in a library), what was running is done again, one item at a time; `lost` makes the result of an item whose
    process dies even then. Where the iteration is ended early, or its process is killed, the processes end, too.

    Parameters
    ----------
    task : callable
        Found by its name in the processes, so it must be a function of a module.
    items : list
        What pickle can send.
    workers : int
        At most so many processes.
    lost : callable
    """
    waiting = deque(items)
    suspects: deque[Item] = deque()
    while waiting or suspects:
        # A suspect gets a process of its own, so that it can take nothing else along.
        alone = bool(suspects)
        running: dict[Future[Result], Item] = {}
        with _Pool(1 if alone else workers) as pool:
            source = deque([suspects.popleft()]) if alone else waiting
            broken: list[Item] = []
            while (source or running) and not broken:
                while source and len(running) < workers and not broken:
                    item = source.popleft()
                    try:
                        running[pool.submit(_do, task, item)] = item
                    except BrokenProcessPool:  # a process died of something else while it waited
                        broken += [item, *running.values()]
                        running.clear()
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    item = running.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        broken.append(item)
                    else:
                        yield future.result()
            broken += running.values()
        if alone:
            yield from map(lost, broken)
        else:
            suspects.extend(broken)


class _Pool(ProcessPoolExecutor):
    """Worker processes that end at once when the work is canceled."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if kind is not None:
            # Not public before Python 3.14, which has terminate_workers().
            processes = list((self._processes or {}).values())
            manager: Any = self._executor_manager_thread  # typeshed takes it for something else
            for process in processes:
                process.terminate()
            self.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.join(PATIENCE)
                process.kill()  # one that was asked while it started may not have heard
                process.join()
            if manager is not None:  # it waits for the processes, too, and may be about to write down that one ended
                manager.join(1.0)
        self.shutdown(wait=True, cancel_futures=True)


def _do(task: Callable[[Item], Result], item: Item) -> Result:
    """Run a task in a worker process. Where it has tidied up since the process is to end, that ends; a pool would go
    on.
    """
    global _working
    try:
        _working = True
        return task(item)
    except SystemExit:
        os._exit(143)
    finally:
        _working = False


def _begin() -> None:
    """Set up a worker process: the parent handles Ctrl-C, and ends the worker so that its files are removed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    _end_with_parent()
    warnings.simplefilter("ignore")  # results hold their warnings
    reuse_freed_memory()


def _end_with_parent() -> None:
    """End this worker process at once when its parent is gone: reading its pipe would wait forever.

    A file that is half written stays beside the whole one, as after any kill; the next process that writes it removes
    that.
    """
    threading.Thread(target=_follow_parent, daemon=True).start()
    if sys.platform == "linux":
        # The thread waits for C code that does not share the interpreter, such as xatlas; the system does not.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _follow_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(143)


#: True while a task runs, which has to tidy up before this worker process ends.
_working = False


def _end(*_: Any) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough; a second one would disturb the tidying
    if not _working:
        os._exit(143)  # a pool that sends a result catches all that is raised, and goes on
    sys.exit(143)


@cache  # once for a process
def reuse_freed_memory() -> None:
    """Let arrays reuse the memory of freed ones; for processes that do nothing but bake.

    glibc gives memory back to the system when arrays are freed, and the system clears each page anew for the next ones.
    It learns from their sizes to do so less, but for some sizes of maps that still takes a twentieth of a bake. Larger
    arrays than 32 MB go back as before. Other C libraries stay as they are.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, MOST_REUSED)
        mallopt(M_TRIM_THRESHOLD, 2 * MOST_REUSED)


def reuse_freed_memory_if_fixed() -> None:
    """`reuse_freed_memory` where ``MALLOC_TRIM_THRESHOLD_`` is set, as it is in workers of Dask.

    With that, glibc learns nothing: each array of more than 128 KB is mapped anew, which takes an eighth of a bake.
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ:
        reuse_freed_memory()


def is_tiled(output: str | Path) -> bool:
    """True if the file name contains <UDIM>, so each tile gets a file."""
    return UDIM in Path(output).name


def bake_tiles(job: Job, progress: Progress | None = None) -> tuple[Record, Results]:
    """Bake all UDIM tiles of a model into one file per tile.

    Parameters
    ----------
    job : dict
        See `translucent.bake.jobs`; its output has `UDIM` in its name.
    progress : callable, optional

    Returns
    -------
    record : dict
        Of all; it lies beside them, with `UDIM` in its name. Files that store fractions share one scale.
    results : dict of ThicknessMap
        By tile, as (tile, 0).

    Raises
    ------
    InputError
        If the job is wrong, or the texture coordinates are in no tile.
    """
    check_job({**job, "output": _tile_path(job, 1001)})
    if job.get("settings", {}).get("tile") is not None:
        raise InputError(
            f"output {job['output']!r}",
            "--tile bakes one tile, but <UDIM> in the name bakes all tiles",
            "omit --tile, or remove <UDIM> from the name",
        )
    parts = _tiled_parts(job)
    tiles = sorted({tile for mesh, _, _ in parts for tile in tiles_of(mesh)} - {0})
    if not tiles:
        found = "no texture coordinates lie in a UDIM tile"
        raise InputError(
            f"output {job['output']!r}",
            found,
            "remove <UDIM> from the name, or unwrap the model into tiles",
        )
    results: Results = {}
    rays = 0
    for number, tile in enumerate(tiles):
        own = {**job, "settings": {**job.get("settings", {}), "tile": tile}}
        maps = []
        for mesh, medium, around in parts:
            if tile in tiles_of(mesh):
                maps.append(bake_one(own, mesh, medium, None, f".{tile}", around))
                rays += maps[-1].report.rays
        results[tile, 0] = _merged([one for one in maps if isinstance(one, ThicknessMap)])
        if progress is not None:
            progress((number + 1) / len(tiles), rays)
    about = {"hash": content_hash(job), "model": job["model"], "model_unit": job.get("unit", "m")}
    storing = {key: bool(job.get(key)) for key in ("normalize", "invert", "values_only")}
    largest = max(float(np.max(one.values, initial=0.0)) for one in results.values())
    records = []
    with OutputFiles() as files:
        for tile in tiles:
            one = {**about, "tile": tile}
            path = Path(_tile_path(job, tile))
            records.append(add_map(files, results[tile, 0], path, **storing, about=one, largest=largest))
        return add_record(files, Path(job["output"]), {**about, **shared(records), "maps": records}), results


def _tile_path(job: Job, tile: int) -> str:
    output = Path(job["output"])
    return str(output.with_name(output.name.replace(UDIM, str(tile))))


def _tiled_parts(job: Job) -> list[tuple[Mesh, Medium | None, Mesh | None]]:
    """Translucent meshes of a model with their media, and the bodies that they belong to."""
    unit, outside = job.get("unit", "m"), bool(job.get("outside"))
    if not has_parts(job):
        mesh = load_mesh(job["model"], unit=unit, allow_outside=outside)
        if mesh.uv is None:
            raise InputError(
                f"output {job['output']!r}",
                f"mesh {mesh.name!r} has no texture coordinates, so it has no UDIM tiles",
                "remove <UDIM> from the name",
            )
        return [(mesh, None, None)]
    builder = GlbBuilder(read_gltf(job["model"], outside))
    targets = find_targets(builder, metres_per_unit(unit), plain_uv=True)
    matrices = first_transforms(builder.file())
    moved = [target.moved(matrices.get(target.key[0], np.eye(4)), metres_per_unit(unit)) for target in targets]
    return [(target.mesh, target.medium, target.around) for target in moved]


def _merged(maps: Sequence[ThicknessMap]) -> ThicknessMap:
    """Map of several meshes in one tile; each texel takes its value from the first mesh that covers it."""
    whole = maps[0]
    for one in maps[1:]:
        new = one.coverage & ~whole.coverage
        padded = (one.values > 0) & (whole.values == 0)
        whole = dataclasses.replace(
            whole,
            values=np.where(new | padded, one.values, whole.values),
            standard_error=np.where(new, one.standard_error, whole.standard_error),
            coverage=whole.coverage | one.coverage,
        )
    return whole
