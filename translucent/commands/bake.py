"""``translucent bake``: thickness of meshes, or light that leaves them after scattering, into maps or vertices."""

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
from click.core import ParameterSource

from translucent.commands.console import echo, is_terminal
from translucent.commands.model import mesh_file
from translucent.commands.options import (
    F,
    common_options,
    medium_options,
    outside_option,
    overwrite_option,
    read_any_medium,
    read_medium,
    read_roughness,
    refuse_overwriting,
    scattering_medium_options,
    unit_option,
)
from translucent.errors import InputError, RenderError, TranslucentError, printable
from translucent.extras import require_package

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from types import ModuleType

    from translucent.bake.jobs import Job, Progress, Results
    from translucent.bake.record import Record
    from translucent.bake.scatter_job import ScatterCheck, ScatterJob


#: Name of the mode.
SCATTER = "scatter"

#: Texels along each side of a map, if nothing else is asked for: what diffuses is smooth.
SIZE = 256

_MEDIUM = ("color", "distance", "preset_name", "clamp", "scattering_color", "mean_free_path")

#: Parameters of the verb that have a meaning for scattered light, and those that have one for it alone.
_TAKEN = {
    "models", "output", "check", "as_json", "mode", "size", "padding", "unwrap", "vertices", "unit", "allow_outside",
    "resolution", *_MEDIUM,
}  # fmt: skip
_ITS_OWN = ("resolution", "scattering_color", "mean_free_path")


def refuse_scatter_options() -> None:
    """Raise `InputError` if an option is given that only scattered light has, for thickness."""
    for name in _given():
        if name in _ITS_OWN:
            raise InputError(
                _scatter_option(name), "thickness has no use for it", f"add --mode {SCATTER}, or leave it out"
            )


def bake_scatter(
    models: tuple[str, ...], output: Path | None, given: dict[str, Any], check: bool, as_json: bool
) -> None:
    """Bake scattered light of one model, as the options say."""
    from translucent.bake.scatter_job import run_scatter_job

    for name in _given():
        if name not in _TAKEN:
            raise InputError(_scatter_option(name), f"--mode {SCATTER} has no use for it", "leave it out")
    if output is None or len(models) != 1:
        raise InputError(f"--mode {SCATTER}", f"{len(models)} models" if output else "no -o", "give one MODEL and -o")
    job = _read_scatter_job(models[0], output, given)
    record, results = run_scatter_job(job)
    checks = _scatter_check(output, results) if check else {}
    told = {"output": str(output), "record": record, **checks}
    if as_json:
        echo(json.dumps(told))
        return
    for line in (*_scatter_lines(job, record), *checks.get("lines", [])):
        echo(line)


def _read_scatter_job(model: str, output: Path, given: dict[str, Any]) -> ScatterJob:
    from translucent.bake.scatter_job import ScatterJob

    medium = read_any_medium(*(given[name] for name in _MEDIUM))
    if medium is None:
        raise InputError(
            f"--mode {SCATTER}", "no medium", "add --preset wax, or --scattering-color '#f2e0b8' --mean-free-path 2mm"
        )
    if given["vertices"] and output.suffix.lower() != ".glb":
        raise InputError("--vertices", f"suffix {output.suffix!r}", "write a .glb, which has them anyway")
    file = mesh_file(model, given["unit"])
    refuse_overwriting(output, file)
    return ScatterJob(
        model=Path(file),
        output=output,
        medium=medium,
        roughness=read_roughness(None, given["preset_name"]) or 0.0,
        size=given["size"] if "size" in _given() else SIZE,
        padding=given["padding"],
        resolution=given["resolution"],
        unit=given["unit"],
        unwrap=given["unwrap"],
        outside=given["allow_outside"],
    )


def _scatter_lines(job: ScatterJob, record: dict[str, Any]) -> list[str]:
    parts = record.get("primitives") or [record]
    size = "x".join(map(str, record["size"])) + ", " if "size" in record else ""
    found = [f"{job.output}: {size}scatter, nine coefficients for each channel"]
    for part in parts:
        mean = ", ".join(f"{value:.3g}" for value in part["mean_in_uniform_light"])
        found.append(f"{part['mesh']['name']}: {part['cells']} cells; gives back {mean} of uniform light on average")
        found += part["warnings"]
    if "uv_file" in record:
        found.append(f"{job.output.with_name(record['uv_file']['file'])}: the model with the UVs made for this map")
    return found + [f"left out, {line}" for line in record.get("left_out", [])]


def _scatter_check(output: Path, results: Any) -> dict[str, Any]:
    from translucent.bake.scatter_job import check_scatter_output, lines, summary, write_scatter_picture

    checks: dict[str, ScatterCheck] = check_scatter_output(output, results)
    path = Path(f"{output}.check.png")
    write_scatter_picture(checks, path)
    told = [line for name, one in checks.items() for line in (f"check of {name!r}:", *lines(one))]
    return {
        "check": {name: summary(one) for name, one in checks.items()},
        "check_picture": str(path),
        "lines": [*told, f"{path}: baked, diffused in pictures, difference"],
    }


def _given() -> list[str]:
    """Parameters of the verb that were given, and do not merely have a default."""
    context = click.get_current_context()
    return [name for name in context.params if context.get_parameter_source(name) == ParameterSource.COMMANDLINE]


def _scatter_option(name: str) -> str:
    named = {"suffix": "format", "preset_name": "preset", "allow_outside": "allow-outside"}
    return f"--{named.get(name, name).replace('_', '-')}"


MODES = ("normal", "cone", "transmittance", "inscribed", "local", SCATTER)
FORMATS = ("exr", "png", "npy", "npz", "glb", "ply")

_FLAGS = ("vertices", "unwrap", "normalize", "invert", "resume")
_LENGTHS = ("max_distance", "tolerance", "high_distance")
_SETTINGS = (
    "mode",
    "size",
    "rays",
    "spread",
    "weighting",
    "gaps",
    "ignore_back_faces",
    "supersample",
    "padding",
    "seed",
)


def _length(name: str, help: str) -> Any:
    return click.option(name, metavar="D|%", help=f"{help} As 2cm, or as a share of the diagonal: 10%.")


_OPTIONS = [
    click.option(
        "--mode",
        type=click.Choice(MODES),
        default="cone",
        show_default=True,
        help="What thickness means; or scatter: no thickness, but the light that a body gives back after scattering.",
    ),
    click.option(
        "--size",
        default=1024,
        show_default=True,
        metavar="N",
        help=f"Texels along each side of the map; of --mode scatter, {SIZE}.",
    ),
    click.option(
        "--resolution",
        default=32,
        show_default=True,
        metavar="N",
        help="Of --mode scatter: the body has about N^3 / 4 cells, 8 to 128.",
    ),
    click.option("--rays", default=64, show_default=True, metavar="N", help="Rays per point of the surface."),
    click.option("--spread", default=180.0, show_default=True, metavar="DEG", help="Full angle of the cone."),
    click.option(
        "--weighting",
        type=click.Choice(["cosine", "uniform"]),
        default="cosine",
        show_default=True,
        help="How directions of the cone count.",
    ),
    click.option(
        "--gaps",
        type=click.Choice(["first-exit", "total"]),
        default="first-exit",
        show_default=True,
        help="Where a ray leaves and enters again: up to the first exit, or all that is inside.",
    ),
    _length("--max-distance", "No ray goes farther. Default: no limit."),
    click.option("--ignore-back-faces", is_flag=True, help="Rays end only at faces that they leave through."),
    click.option("--supersample", default=1, show_default=True, metavar="N", help="N x N points per texel."),
    click.option("--padding", default=16, show_default=True, metavar="N", help="Texels around each chart of the UVs."),
    click.option("--seed", default=0, show_default=True, metavar="N", help="Of the directions."),
    _length("--tolerance", "More rays where the standard error is above it."),
    click.option("--tile", type=int, metavar="N", help="Bake this UDIM tile, such as 1001. Default: UVs repeat."),
    click.option("--high", metavar="MESH", help="Mesh with the details, for a map on a coarser MODEL."),
    click.option("--cage", metavar="MESH", help="Of --high: MODEL, moved outwards, where the search begins."),
    _length("--high-distance", "Of --high: how far its surface may be from that of MODEL."),
    unit_option,
    outside_option,
    medium_options,
    scattering_medium_options,
    click.option("--unwrap", is_flag=True, help="Make new UVs, even if MODEL has some."),
    click.option("--vertices", is_flag=True, help="Thickness per vertex, into a .ply, .glb or .npy file."),
    click.option("--normalize", is_flag=True, help="Store shares of the largest value instead of metres."),
    click.option("--invert", is_flag=True, help="Store 1 - t / max, the translucency that some engines want."),
    click.option("--max-escaped", metavar="%", help="Of --out-dir: more rays without an exit are suspect. [5%]"),
    click.option("--resume", is_flag=True, help="Keep finished parts beside the output, and go on from there."),
]


def bake_options(command: F) -> F:
    """All options that say how to bake."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def read_job(model: str, output: Path, given: dict[str, Any]) -> Job:
    """Job of a model, from the options.

    Raises
    ------
    InputError
        If a value is wrong.
    """
    unit = given["unit"]
    if given["high"] is None:
        for name in ("cage", "high_distance"):
            if given[name] is not None:
                raise InputError(f"{_option(name)} {given[name]}", "no --high", "add --high MESH, or leave it out")
    settings = {name: given[name] for name in _SETTINGS}
    settings |= {name: _read_length(name, given[name], unit) for name in _LENGTHS if given[name] is not None}
    if given["tile"] is not None:
        settings["tile"] = given["tile"]
    medium = read_medium(given["color"], given["distance"], given["preset_name"], given["clamp"])
    job = {
        "model": mesh_file(model, unit),
        "output": str(output),
        "unit": unit,
        "settings": settings,
        "medium": None if medium is None else medium.extinction.tolist(),
    }
    job |= {name: mesh_file(given[name], unit) for name in ("high", "cage") if given[name] is not None}
    refuse_overwriting(output, job["model"], job.get("high"), job.get("cage"))
    if given["allow_outside"]:
        job["outside"] = True
    if given["max_escaped"] is not None:
        job["max_escaped"] = _read_share("max_escaped", given["max_escaped"])
    return job | {name: True for name in _FLAGS if given[name]}


def _read_share(name: str, text: str) -> float:
    try:
        share = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        share = -1.0
    if not 0 <= share <= 1:
        raise InputError(f"{_option(name)} {text!r}", "not a share", "write for example 5%")
    return share


def _read_length(name: str, text: str, unit: str) -> float | str:
    """Length in metres, or a share as given, which depends on the mesh."""
    from translucent.units import parse_length

    if text.strip().endswith("%"):
        return text.strip()
    try:
        return parse_length(text, unit)
    except InputError as error:
        raise InputError(f"{_option(name)} {text!r}", str(error)) from None


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


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
    from translucent.bake.batch import told_of
    from translucent.bake.jobs import bake_file

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
    from translucent.bake.check import check_output, write_picture

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
