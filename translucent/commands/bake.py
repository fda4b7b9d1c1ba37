"""``translucent bake``: thickness of meshes into maps, glTF files or vertices."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.bake_options import FORMATS, bake_options, read_job
from translucent.commands.bake_scatter import SCATTER, bake_scatter, refuse_scatter_options
from translucent.commands.common import common_options, overwrite_option
from translucent.commands.console import echo, is_terminal
from translucent.commands.model import mesh_file
from translucent.errors import InputError, RenderError, TranslucentError, printable
from translucent.extras import require_package

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from types import ModuleType

    from translucent.bake.jobs import Job, Progress, Results
    from translucent.bake.record import Record

#: Steps of a progress bar.
STEPS = 1000

#: Seconds that a Dask scheduler has for an answer.
CONNECT_SECONDS = 10


@click.command(epilog="Example: translucent bake bear -o thickness.exr --size 128 --rays 16")
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A .exr, .png, .npy, .npz, .glb or .ply file.")
@bake_options
@click.option("--check", is_flag=True, help="Compare the look with the true one; write OUTPUT.check.png.")
@click.option("--out-dir", type=click.Path(path_type=Path), help="Bake each MODEL into this folder.")
@click.option(
    "--format", "suffix", type=click.Choice(FORMATS), default="exr", show_default=True, help="Of files in --out-dir."
)
@click.option("--jobs", type=int, metavar="N", help="Of --out-dir: processes. Default: one per processor.")
@click.option("--dask", metavar="ADDRESS", help="Of --out-dir: a Dask scheduler, such as tcp://farm:8786.")
@overwrite_option
@common_options
def bake(
    models: tuple[str, ...],
    output: Path | None,
    out_dir: Path | None,
    suffix: str,
    check: bool,
    jobs: int | None,
    dask: str | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Bake the thickness of MODEL, a file or one of the toolkit's own meshes, into a map over its UVs.

    Values are metres; 0.2 in the map is 20 cm. A .glb gets thicknessFactor and thicknessTexture, and what else a .glb
    or .gltf MODEL has stays. Beside each file goes a record, FILE.json. With --out-dir, many models: those that are
    done are skipped, and those that fail stop no other.

    --mode scatter bakes the light that the body gives back after scattering, into an .exr map or the vertices of a
    .glb: translucent bake candle -o candle.exr --mode scatter --preset wax
    """
    if given["mode"] == SCATTER:
        bake_scatter(models, output, given, check, as_json)
        return
    refuse_scatter_options()
    if (output is None) == (out_dir is None):
        found = "neither is given" if output is None else "both are given"
        raise InputError("-o FILE or --out-dir FOLDER", found, "give one of the two")
    if out_dir is not None:
        if check:
            raise InputError("--check", "it looks at one model", "give one MODEL and -o")
        _bake_many(models, out_dir, suffix, given, jobs, dask, as_json)
        return
    if len(models) > 1 or output is None:
        raise InputError(f"-o {output}", f"{len(models)} models", "give --out-dir instead, or one model")
    for option, value in (("--jobs", jobs), ("--dask", dask), ("--max-escaped", given["max_escaped"])):
        if value is not None:
            raise InputError(f"{option} {value}", "it is for many models", "add --out-dir, or leave it out")
    _bake_one(read_job(models[0], output, given), check, as_json)


def _bake_one(job: Job, check: bool, as_json: bool) -> None:
    from translucent.bake.bake_file import bake_file
    from translucent.bake.batch import told_of

    if check and job.get("vertices"):
        raise InputError("--check", "it looks at maps", "leave --vertices out")
    if check and job["settings"]["mode"] == "local":
        raise InputError("--check", "mode 'local' is no length", "choose another mode")
    with _progress(Path(job["model"]).name) as progress:
        record, results = bake_file(job, progress)
    told = {"output": job["output"], **told_of(record, results, Path(job["output"]).parent)}
    checks = _check(job, record, results) if check else {}
    if as_json:
        echo(json.dumps({**told, "record": record, **checks}))
        return
    for line in _lines(record, told):
        echo(line)
    for line in checks.get("lines", []):
        echo(line)


@contextlib.contextmanager
def _progress(label: str) -> Iterator[Progress | None]:
    """A bar with the rate and the time left on a terminal, and nothing elsewhere."""
    if not is_terminal(sys.stderr):
        yield None
        return
    began = time.perf_counter()
    rate = ""
    with click.progressbar(
        range(STEPS), label=printable(label), file=sys.stderr, show_eta=True, item_show_func=lambda _: rate
    ) as bar:

        def tell(share: float, rays: int) -> None:
            nonlocal rate
            rate = f"{rays / 1e6 / max(time.perf_counter() - began, 1e-9):.2f} Mrays/s"
            bar.update(int(share * STEPS) - bar.pos)

        yield tell


def _lines(record: Record, told: Record) -> Iterator[str]:
    """Lines of text about a bake."""
    from translucent.bake.record import parts_of

    parts = parts_of(record)
    unit = "" if told["unit"] == "1" else f" {told['unit']}"
    in_files = len(parts) > 1 and "file" in parts[0]
    if not in_files:
        yield _size_line(told["output"], record, told["range"], unit)
    for part in parts:
        report, encoding = part["report"], part["encoding"]
        name = f"{part['mesh']['name']}: " if len(parts) > 1 else ""
        if in_files:
            file = str(Path(told["output"]).with_name(part["file"]))
            yield _size_line(file, part, part["range"] or told["range"], unit)
        if part.get("warnings"):
            yield f"{name}{'; '.join(part['warnings'])}"
            continue
        step = f", steps of {encoding['quantum']:.3g}{unit}" if encoding["quantum"] else ""
        factor = f", thicknessFactor {part['thickness_factor']:.6g}" if "thickness_factor" in part else ""
        yield (
            f"{name}{report['rays'] / 1e6:.3g} million rays in {report['seconds']:.1f} s, standard error "
            f"{report['mean_standard_error']:.2g} on average, {report['max_standard_error']:.2g} at most{factor}{step}"
        )
    if told["uv_file"]:
        yield f"{told['uv_file']}: the model with the UVs that were made for this map"
    yield from (f"left out, {line}" for line in told["left_out"])


def _size_line(file: str, record: Record, found: Record, unit: str) -> str:
    size = "x".join(map(str, record["size"])) + ", " if "size" in record else ""
    return f"{file}: {size}{record['mode']}, {found['min']:.4g} to {found['max']:.4g}{unit}"


def _check(job: Job, record: Record, results: Results) -> dict[str, Any]:
    """Compare what was written with the truth; the picture goes beside it."""
    from translucent.bake.check_files import check_output
    from translucent.bake.check_picture import write_picture

    checks = check_output(job, record, results)
    path = Path(f"{job['output']}.check.png")
    write_picture([one for one in checks.values() if one is not None], path)
    hidden = "it is hidden behind other parts of its body"
    lines = [line for name, one in checks.items() for line in (f"check of {name!r}:", *str(one or hidden).split("\n"))]
    return {
        "check": {name: None if one is None else one.summary() for name, one in checks.items()},
        "check_picture": str(path),
        "lines": [*lines, f"{path}: with the map, true, difference"],
    }


def _bake_many(
    models: tuple[str, ...],
    out_dir: Path,
    suffix: str,
    given: dict[str, Any],
    jobs: int | None,
    dask: str | None,
    as_json: bool,
) -> None:
    from translucent.bake.batch import BatchReport, bake_many
    from translucent.files.folders import made_folder

    if jobs is not None and dask is not None:
        raise InputError(f"--jobs {jobs}", "--dask is given, too", "its workers are as many as they are; leave one out")
    if dask is not None and given["resume"]:
        raise InputError("--resume", "--dask is given, too", "a job is done again from its start; leave --resume out")
    wanted, nothing = _wanted([(model, out_dir / f"{Path(model).stem}.{suffix}") for model in models], given)
    tell = _teller([*wanted, *nothing], as_json)
    with made_folder(out_dir), _executor(dask) as executor:
        report = bake_many(wanted, executor, jobs, tell)
        for entry in nothing:
            tell(entry)
        report = BatchReport((*report.assets, *nothing), report.seconds)
        echo(json.dumps(report.summary()) if as_json else report.total)
        if failed := report.count("failed"):
            raise TranslucentError(f"{failed} of {len(models)} models failed", "the others are done", "see above")


def _wanted(files: list[tuple[str, Path]], given: dict[str, Any]) -> tuple[list[Job], list[Record]]:
    """Jobs of the models, and entries of those that do not exist."""
    from translucent.bake.batch import failed_entry

    wanted, nothing = [], []
    for model, output in files:
        try:
            mesh_file(model, given["unit"])
        except InputError as error:
            nothing.append(failed_entry({"model": model, "output": str(output)}, str(error)))
        else:
            wanted.append(read_job(model, output, given))
    return wanted, nothing


def _teller(assets: list[Record], as_json: bool) -> Callable[[Record], None]:
    """Callback that prints a line for each asset when it is done, with the time left; not between the lines of a JSON
    result.
    """
    from translucent.bake.batch import asset_line

    width = max(len(Path(asset["model"]).name) for asset in assets)
    began, told, worked = time.perf_counter(), 0, 0

    def tell(entry: Record) -> None:
        nonlocal told, worked
        told += 1
        worked += entry["status"] != "skipped"
        left = len(assets) - told
        after = ""
        if left and worked:
            after = f"; about {_duration((time.perf_counter() - began) / worked * left)} left"
        echo(f"{told:>{len(str(len(assets)))}}/{len(assets)}  {asset_line(entry, width)}{after}", err=as_json)

    return tell


def _duration(seconds: float) -> str:
    minutes = seconds / 60
    return f"{seconds:.0f} s" if minutes < 2 else f"{minutes:.0f} min" if minutes < 120 else f"{minutes / 60:.1f} h"


@contextlib.contextmanager
def _executor(address: str | None) -> Iterator[Executor | None]:
    """The workers behind a Dask scheduler, or None for processes here."""
    if address is None:
        yield None
        return
    distributed = require_package("distributed", f"--dask {address}", "leave it out to bake on this machine")
    try:
        # A client that cannot connect leaves its loop running, with nothing to close it by.
        asyncio.run(_knock(distributed, address))
        client = distributed.Client(address, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        found = f"no scheduler answers ({error or type(error).__name__})"
        raise RenderError(f"--dask {address}", found, "check the address") from error
    with client:
        yield client.get_executor()


async def _knock(distributed: ModuleType, address: str) -> None:
    """Connect to a Dask scheduler, and leave; raises OSError or ValueError if none answers."""
    security = distributed.Security().get_connection_args("client")
    connection = await distributed.comm.connect(address, timeout=CONNECT_SECONDS, **security)
    await connection.close()
