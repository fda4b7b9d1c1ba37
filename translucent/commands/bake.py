"""``translucent bake``: thickness of meshes into maps, glTF files or vertices."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.bake_options import FORMATS, bake_options, read_job
from translucent.commands.common import common_options, overwrite_option
from translucent.commands.console import echo
from translucent.errors import InputError, RenderError, TranslucentError, printable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from translucent.bake.jobs import Job, Progress, Results
    from translucent.bake.record import Record

#: Steps of a progress bar.
STEPS = 1000


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
    """
    if (output is None) == (out_dir is None):
        found = "neither is given" if output is None else "both are given"
        raise InputError("-o FILE or --out-dir FOLDER", found, "give one of the two")
    if out_dir is not None:
        if check:
            raise InputError("--check", "it looks at one model", "give one MODEL and -o")
        _bake_many([(m, out_dir / f"{Path(m).stem}.{suffix}") for m in models], given, jobs, dask, as_json)
        return
    if len(models) > 1 or output is None:
        raise InputError(f"-o {output}", f"{len(models)} models", "give --out-dir instead, or one model")
    for option, value in (("--jobs", jobs), ("--dask", dask)):
        if value is not None:
            raise InputError(f"{option} {value}", "it is for many models", "add --out-dir, or leave it out")
    _bake_one(read_job(models[0], output, given), check, as_json)


def _bake_one(job: Job, check: bool, as_json: bool) -> None:
    from translucent.bake.batch import told_of
    from translucent.bake.jobs import bake_file

    if check and job.get("vertices"):
        raise InputError("--check", "it looks at maps", "leave --vertices out")
    if check and job["settings"]["mode"] == "local":
        raise InputError("--check", "mode 'local' is no length", "choose another mode")
    with _progress(Path(job["model"]).name) as progress:
        record, results = bake_file(job, progress)
    told = {"output": job["output"], **told_of(record, results)}
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
    if not sys.stderr.isatty():
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
    """What a bake was, for people."""
    size = "x".join(map(str, record["size"])) + ", " if "size" in record else ""
    found, unit = told["range"], "" if told["unit"] == "1" else f" {told['unit']}"
    yield f"{told['output']}: {size}{record['mode']}, {found['min']:.4g} to {found['max']:.4g}{unit}"
    parts = record.get("maps") or record.get("primitives") or [record]
    for part in parts:
        report, encoding = part["report"], part["encoding"]
        name = f"{part['mesh']['name']}: " if len(parts) > 1 else ""
        if part.get("warnings"):
            yield f"{name}{'; '.join(part['warnings'])}"
            continue
        step = f", steps of {encoding['quantum']:.3g}{unit}" if encoding["quantum"] else ""
        factor = f", thicknessFactor {part['thickness_factor']:.6g}" if "thickness_factor" in part else ""
        yield (
            f"{name}{report['rays'] / 1e6:.3g} million rays in {report['seconds']:.1f} s, standard error "
            f"{report['mean_standard_error']:.2g} on average, {report['max_standard_error']:.2g} at most{factor}{step}"
        )


def _check(job: Job, record: Record, results: Results) -> dict[str, Any]:
    """Compare what was written with the truth; the picture goes beside it."""
    from translucent.bake.check_files import check_output
    from translucent.bake.check_picture import write_picture

    checks = check_output(job, record, results)
    path = Path(f"{job['output']}.check.png")
    write_picture(list(checks.values()), path)
    lines = [line for name, one in checks.items() for line in (f"check of {name!r}:", *str(one).split("\n"))]
    return {
        "check": {name: one.summary() for name, one in checks.items()},
        "check_picture": str(path),
        "lines": [*lines, f"{path}: with the map, true, difference"],
    }


def _bake_many(
    files: list[tuple[str, Path]], given: dict[str, Any], jobs: int | None, dask: str | None, as_json: bool
) -> None:
    from translucent.bake.batch import bake_many

    if jobs is not None and dask is not None:
        raise InputError(f"--jobs {jobs}", "--dask is given, too", "its workers are as many as they are; leave one out")
    if dask is not None and given["resume"]:
        raise InputError("--resume", "--dask is given, too", "a job is done again from its start; leave --resume out")
    wanted = [read_job(model, output, given) for model, output in files]
    with _executor(dask) as executor, _counting(len(wanted)) as progress:
        report = bake_many(wanted, executor, jobs, progress)
    echo(json.dumps(report.summary()) if as_json else str(report))
    if failed := report.count("failed"):
        raise TranslucentError(f"{failed} of {len(wanted)} models failed", "the others are done", "see above")


@contextlib.contextmanager
def _counting(total: int) -> Iterator[Callable[[Record], None] | None]:
    """A bar of assets on a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    last = ""
    with click.progressbar(range(total), label="bake", file=sys.stderr, item_show_func=lambda _: last) as bar:

        def tell(entry: Record) -> None:
            nonlocal last
            last = printable(f"{Path(entry['model']).name} {entry['status']}")
            bar.update(1)

        yield tell


@contextlib.contextmanager
def _executor(address: str | None) -> Iterator[Executor | None]:
    """The workers behind a Dask scheduler, or None for processes here."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        what, do = f"--dask {address}", "pip install 'translucent-shading[cluster]'"
        raise RenderError(what, "the package distributed is not installed", do) from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        found = f"no scheduler answers ({error or type(error).__name__})"
        raise RenderError(f"--dask {address}", found, "check the address") from error
    with client:
        yield client.get_executor()
