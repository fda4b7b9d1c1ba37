"""``translucent bake``: thickness or scattered light of meshes, into maps; ``translucent lithophane``: reliefs."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from translucent.commands.console import echo, is_terminal, time_text
from translucent.commands.model import (
    SceneRequest,
    assumes_metres,
    file_unit,
    is_scene_file,
    mesh_file,
    read_scene,
    require_translucent,
)
from translucent.commands.options import (
    AnyMediumOptions,
    FileOptions,
    MediumOptions,
    overwrite_option,
    refuse_overwriting,
)
from translucent.commands.verbs import NamesOf, VerbCommand, group, option, takes
from translucent.errors import InputError, RenderError, TranslucentError, printable
from translucent.extras import require_package
from translucent.units import size_note

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from types import ModuleType

    from translucent.bake.jobs import Job, Progress
    from translucent.bake.record import Record
    from translucent.bake.scatter_job import ScatterJob


#: Mode of scattered light, and texels along each side of its maps by default: what diffuses is smooth.
SCATTER, SIZE = "scatter", 256

MODES = ("normal", "cone", "transmittance", "inscribed", "local", SCATTER)
FORMATS = ("exr", "png", "npy", "npz", "glb", "ply")

#: Metres of thickness from which on a unit is likely wrong.
RARELY_THICK = 0.5

#: Steps of a progress bar.
STEPS = 1000

#: Seconds that a Dask scheduler has for an answer.
CONNECT_SECONDS = 10

_FLAGS = ("vertices", "unwrap", "normalize", "invert", "resume")
_LENGTHS = ("max_distance", "tolerance", "high_distance")
_SETTINGS = (
    "mode", "size", "rays", "spread", "weighting", "gaps", "ignore_back_faces", "supersample", "padding", "seed",
)  # fmt: skip

#: Options that have a meaning for thickness alone, but for those of many models, and for scattered light alone.
_SCATTER_ALONE = ("resolution", "scattering_color", "mean_free_path")
_REFUSED_BY_USD = (
    "output", "out_dir", "size", "supersample", "padding", "tile", "high", "cage", "high_distance", "unwrap",
    "normalize", "invert", "resume", "check", "format", "jobs", "dask", "max_escaped",
)  # fmt: skip
_TAKEN_BY_SCATTER = {
    "models", "output", "check", "as_json", "mode", "size", "padding", "unwrap", "vertices", "unit", "height",
    "longest", "allow_outside", "color", "distance", "preset", "clamp", *_SCATTER_ALONE,
}  # fmt: skip


def _length(help: str) -> Any:
    return option(metavar="D|%", help=f"{help} As 2cm, or as a share of the diagonal: 10%.")


@dataclass(frozen=True, kw_only=True)
class BakeOptions:
    """Options of ``translucent bake``."""

    output: Path | None = option(
        names=("-o", "--output"),
        help="Output file: .exr, .png, .npy, .npz, .glb or .ply. A name with <UDIM> bakes all tiles.",
    )
    mode: str = option(
        "cone",
        type=click.Choice(MODES),
        help="cone: mean thickness over a cone of rays. normal: along the normal. scatter: scattered light.",
    )
    size: int = option(
        1024, metavar="N", help=f"Number of texels along each side of the map; default with --mode scatter: {SIZE}."
    )
    resolution: int = option(
        32,
        metavar="N",
        help="With --mode scatter: resolution of the diffusion grid, 8 to 128; a body gets about N^3 / 4 cells.",
    )
    rays: int = option(64, metavar="N", help="Rays per surface point.")
    spread: float = option(180.0, metavar="DEG", help="Full angle of the cone of rays around the inward normal.")
    weighting: str = option(
        "cosine", type=click.Choice(["cosine", "uniform"]), help="Weighting of the ray directions in the cone."
    )
    gaps: str = option(
        "first-exit",
        type=click.Choice(["first-exit", "total"]),
        help=(
            "If a ray leaves the mesh and enters it again: measure up to the first exit, or the sum of "
            "all parts inside."
        ),
    )
    max_distance: str | None = _length("No ray goes farther. Default: no limit.")
    ignore_back_faces: bool = option(False, help="Let rays end only at faces through which they leave the body.")
    supersample: int = option(1, metavar="N", help="Average thickness over N x N points in each texel.")
    padding: int = option(16, metavar="N", help="Number of texels that continue the map around each UV chart.")
    seed: int = option(0, metavar="N", help="Seed of the random ray directions.")
    tolerance: str | None = _length("Cast more rays at points whose standard error is larger.")
    tile: int | None = option(metavar="N", help="Bake only this UDIM tile, such as 1001. Default: the map repeats.")
    high: str | None = option(metavar="MESH", help="Detailed mesh whose thickness is baked onto the coarser MODEL.")
    cage: str | None = option(
        metavar="MESH",
        help=(
            "With --high: a copy of MODEL with vertices moved outwards. Rays start on this cage and "
            "search for the detailed mesh."
        ),
    )
    high_distance: str | None = _length("With --high: largest distance between its surface and that of MODEL.")
    file: FileOptions = group(FileOptions, without=("draft_extensions",))
    medium: AnyMediumOptions = group(AnyMediumOptions)
    unwrap: bool = option(False, help="Make new UVs, even if MODEL already has UVs.")
    vertices: bool = option(False, help="Bake thickness per vertex, into a .ply, .glb or .npy file.")
    normalize: bool = option(False, help="Store fractions of the largest value instead of metres.")
    invert: bool = option(
        False, help="Store 1 - t / max for each thickness t, the translucency that some engines expect."
    )
    max_escaped: str | None = option(
        metavar="%",
        help=(
            "With --out-dir: a map is reported as suspect if more than this percentage of "
            "its rays never leave the mesh. [5%]"
        ),
    )
    resume: bool = option(
        False, help="Store finished parts of the bake next to the output, and continue from these parts."
    )
    check: bool = option(
        False,
        help=(
            "Compare a picture that uses the map with a picture of the true thickness, and "
            "write both to OUTPUT.check.png."
        ),
    )
    program: str | None = option(
        names=("--for",),
        type=NamesOf("translucent.bake.settings", "PROGRAMS"),
        help=(
            "Name and encode the map for this program, and print the settings that this program needs; "
            "-o may be a folder."
        ),
    )
    out_dir: Path | None = option(help="Bake each MODEL into this folder.")
    usd: Path | None = option(
        metavar="FILE",
        help="Instead of -o: write a .usda or .usdc file with meshes, OpenPBR materials, and thickness per vertex.",
    )
    format: str = option("exr", type=click.Choice(FORMATS), help="Format of the files in --out-dir.")
    jobs: int | None = option(
        metavar="N", help="With --out-dir: number of worker processes. Default: one per processor."
    )
    dask: str | None = option(
        metavar="ADDRESS",
        help="With --out-dir: bake on the workers of the Dask scheduler at this address, such as tcp://farm:8786.",
    )
    overwrite: bool = overwrite_option()


@click.command(
    cls=VerbCommand,
    usual="output program mode size rays unit height preset high vertices check out_dir",
    epilog="Example: translucent bake bear -o thickness.exr --size 128 --rays 16",
)
@click.argument("models", nargs=-1, required=True, metavar="MODEL...")
@takes(BakeOptions)
def bake(models: tuple[str, ...], given: BakeOptions, as_json: bool) -> None:
    """Bake the thickness of MODEL into a texture map over its UVs.

    MODEL is a file or a built-in mesh. The values of the map are metres: 0.2 means 20 cm. A .glb output is a copy
    of MODEL with thicknessFactor and thicknessTexture. The record of each output is written next to it, as FILE.json.
    --out-dir bakes many models, skips finished models, and continues if one model fails.

    --mode scatter bakes the light that leaves the body after scattering: --mode scatter --preset wax -o candle.exr
    """
    output, out_dir, named = given.output, given.out_dir, _named()
    if given.mode == SCATTER:
        if other := [name for name in named if name not in _TAKEN_BY_SCATTER]:
            raise InputError(_option(other[0]), f"--mode {SCATTER} does not use this option", "omit the option")
        if output is None or len(models) != 1:
            found = f"{len(models)} models" if output else "no -o"
            raise InputError(f"--mode {SCATTER}", found, "bake one MODEL into one output: -o FILE")
        return _bake_scatter(_read_scatter_job(models[0], output, given), given, as_json)
    if other := [name for name in named if name in _SCATTER_ALONE]:
        raise InputError(
            _option(other[0]),
            "this option does not apply to thickness",
            f"add --mode {SCATTER}, or omit the option",
        )
    if given.usd is not None:
        if other := [name for name in named if name in _REFUSED_BY_USD]:
            raise InputError(
                f"--usd {given.usd}",
                f"{_option(other[0])} cannot be combined with --usd",
                f"omit --usd, or omit {_option(other[0])}",
            )
        if len(models) != 1:
            raise InputError(
                f"--usd {given.usd}", f"--usd bakes one model, but {len(models)} models are given", "give one MODEL"
            )
        return _bake_usd(models[0], given.usd, given, as_json)
    if (output is None) == (out_dir is None):
        found = "neither is given" if output is None else "both are given"
        raise InputError("-o FILE or --out-dir FOLDER", found, "one of these two options is required, or --usd FILE")
    if out_dir is not None:
        if given.check:
            raise InputError("--check", "--check works with one model", "give one MODEL, and one output with -o")
        return _bake_many(models, out_dir, given, as_json)
    if len(models) > 1 or output is None:
        raise InputError(
            f"-o {output}",
            f"-o names one output, but {len(models)} models are given",
            "use --out-dir, or give one model",
        )
    for name in ("jobs", "dask", "max_escaped"):
        if (value := getattr(given, name)) is not None:
            raise InputError(
                f"{_option(name)} {value}",
                "this option works only with several models",
                "add --out-dir, or omit the option",
            )
    return _bake_one(_read_job(models[0], output, given, file_unit(models[0], given.file)), given, as_json)


def _named() -> list[str]:
    """Parameters that the user wrote on the command line."""
    context = click.get_current_context()
    return [name for name in context.params if context.get_parameter_source(name) == ParameterSource.COMMANDLINE]


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _read_job(model: str, output: Path, given: BakeOptions, unit: str) -> Job:
    """Job of a model with a `file_unit`, from the options.

    Raises
    ------
    InputError
        If a value is wrong.
    """
    if given.high is None:
        for name in ("cage", "high_distance"):
            if (value := getattr(given, name)) is not None:
                raise InputError(
                    f"{_option(name)} {value}",
                    "this option works only with --high",
                    "add --high MESH, or omit the option",
                )
    settings = {name: getattr(given, name) for name in _SETTINGS}
    settings |= {
        name: _read_length(name, text, unit) for name in _LENGTHS if (text := getattr(given, name)) is not None
    }
    if given.tile is not None:
        settings["tile"] = given.tile
    medium = MediumOptions.read(given.medium)
    job: Job = {
        "model": mesh_file(model, given.file.unit),
        "output": str(output),
        "unit": unit,
        "settings": settings,
        "medium": None if medium is None else medium.extinction.tolist(),
    }
    job |= {
        name: mesh_file(mesh, given.file.unit)
        for name in ("high", "cage")
        if (mesh := getattr(given, name)) is not None
    }
    refuse_overwriting(output, job["model"], job.get("high"), job.get("cage"))
    if given.file.allow_outside:
        job["outside"] = True
    if given.max_escaped is not None:
        job["max_escaped"] = _read_fraction("max_escaped", given.max_escaped)
    return job | {name: True for name in _FLAGS if getattr(given, name)}


def _read_fraction(name: str, text: str) -> float:
    try:
        fraction = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        fraction = -1.0
    if not 0 <= fraction <= 1:
        raise InputError(f"{_option(name)} {text!r}", "the value is not a percentage", "write for example 5%")
    return fraction


def _read_length(name: str, text: str, unit: str) -> float | str:
    """Length in metres, or a percentage as text."""
    from translucent.units import parse_length

    if text.strip().endswith("%"):
        return text.strip()
    try:
        return parse_length(text, unit)
    except InputError as error:
        raise InputError(f"{_option(name)} {text!r}", str(error)) from None


def _read_scatter_job(model: str, output: Path, given: BakeOptions) -> ScatterJob:
    from translucent.bake.scatter_job import ScatterJob

    if (medium := given.medium.read()) is None:
        raise InputError(
            f"--mode {SCATTER}",
            "scattered light needs a medium",
            "add --preset wax, or --scattering-color '#f2e0b8' --mean-free-path 2mm",
        )
    if given.vertices and output.suffix.lower() != ".glb":
        raise InputError(
            "--vertices", f"suffix {output.suffix!r}", "write a .glb, which also stores thickness at its vertices"
        )
    file = mesh_file(model, given.file.unit)
    refuse_overwriting(output, file)
    return ScatterJob(
        model=Path(file),
        output=output,
        medium=medium,
        roughness=given.medium.surface_roughness() or 0.0,
        size=given.size if "size" in _named() else SIZE,
        padding=given.padding,
        resolution=given.resolution,
        unit=file_unit(model, given.file),
        unwrap=given.unwrap,
        outside=given.file.allow_outside,
    )


def _bake_one(job: Job, given: BakeOptions, as_json: bool) -> None:
    from translucent.bake.batch import bake_tiles, is_tiled, reported_values
    from translucent.bake.jobs import bake_file
    from translucent.bake.settings import job_for, recipe_for

    if given.check and given.vertices:
        raise InputError(
            "--check", "--check works only with thickness maps, not with thickness per vertex", "omit --vertices"
        )
    if given.check and given.mode == "local":
        raise InputError("--check", "mode 'local' does not bake a length", "choose another mode")
    tiled = is_tiled(job["output"])
    if given.check and tiled:
        raise InputError("--check", f"the output {job['output']} has several tiles", "check a single tile: --tile 1001")
    if given.program is not None:
        job = job_for(given.program, job)
    with _progress(Path(job["model"]).name) as progress:
        record, results = (bake_tiles if tiled else bake_file)(job, progress)
    reported = {"output": job["output"], **reported_values(record, results, Path(job["output"]).parent)}
    checks = {}
    if given.check:
        from translucent.bake.check import check_output, write_picture

        found = check_output(job, record, results)
        checks = _check_report(found, job["output"], write_picture, "with the map, true, difference")
    lines = [*_lines(record, reported), *checks.get("lines", [])]
    largest = reported["range"]["max"]
    if given.program is not None:
        reported["import"] = recipe_for(given.program, largest)
        lines.append(reported["import"])
    if reported["unit"] == "m" and largest > RARELY_THICK:
        text = f"the model is {largest:.3g} m thick, too thick for most light: check --unit, or set --height 12cm"
        reported["advice"] = text
        lines.append(f"advice: {text}")
    if assumes_metres(job["model"], given.file):
        reported["size"] = size_note(next(iter(results.values())).mesh, "m")
        lines.append(f"size: {reported['size']}")
    _print({**reported, "record": record, **checks}, lines, as_json)


def _bake_usd(model: str, output: Path, given: BakeOptions, as_json: bool) -> None:
    """Bake the vertices of all bodies of a model, and write them with their materials as a USD stage."""
    from translucent.bake.jobs import bake_one
    from translucent.bake.thickness_map import VertexThickness
    from translucent.bake.usd_stage import check_usd_output, write_usd
    from translucent.media.medium import Medium
    from translucent.scene.showcase import SOLID_IOR

    check_usd_output(output)
    job: Job = _read_job(model, output, given, file_unit(model, given.file)) | {"vertices": True}
    medium = given.medium.read()
    if medium is None and not is_scene_file(model):
        medium = Medium()  # a clear material, as in a .glb
    if medium is not None and medium.ior == 1.0:
        medium = dataclasses.replace(medium, ior=SOLID_IOR)
    roughness = given.medium.surface_roughness()
    keeps_ior = given.medium.color is not None
    scene = read_scene(model, SceneRequest(medium, keeps_ior, file=given.file, roughness=roughness))
    require_translucent(model, scene)
    bodies = {id(body.mesh): body for body in scene.bodies if body.sheet_thickness is None}
    results = []
    for body in bodies.values():
        with _progress(body.mesh.name) as progress:
            baked = bake_one(job, body.mesh, body.medium, progress)
        assert isinstance(baked, VertexThickness)
        results.append(baked)
    write_usd(scene, output, results)
    meshes = [
        {"mesh": one.mesh.name, "min": float(one.values.min()), "max": float(one.values.max()), "mode": given.mode}
        for one in results
    ]
    lines = [f"{output}: {one['mesh']!r}, {one['mode']}, {one['min']:.4g} to {one['max']:.4g} m" for one in meshes]
    _print({"output": str(output), "meshes": meshes}, lines, as_json)


def _print(reported: dict[str, Any], lines: list[str], as_json: bool) -> None:
    for line in [json.dumps(reported)] if as_json else lines:
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

        def report(fraction: float, rays: int) -> None:
            nonlocal rate
            rate = f"{rays / 1e6 / max(time.perf_counter() - began, 1e-9):.2f} Mrays/s"
            bar.update(int(fraction * STEPS) - bar.pos)

        yield report


def _lines(record: Record, reported: Record) -> Iterator[str]:
    """Lines of text about a bake."""
    from translucent.bake.record import parts_of

    parts = parts_of(record)
    unit = "" if reported["unit"] == "1" else f" {reported['unit']}"
    in_files = len(parts) > 1 and "file" in parts[0]
    if not in_files:
        yield _size_line(reported["output"], record, reported["range"], unit)
    for part in parts:
        report, encoding = part["report"], part["encoding"]
        name = f"{part['mesh']['name']}: " if len(parts) > 1 else ""
        if in_files:
            file = str(Path(reported["output"]).with_name(part["file"]))
            yield _size_line(file, part, part["range"] or reported["range"], unit)
        if part.get("warnings"):
            yield f"{name}{'; '.join(part['warnings'])}"
            continue
        step = f", steps of {encoding['quantum']:.3g}{unit}" if encoding["quantum"] else ""
        factor = f", thicknessFactor {part['thickness_factor']:.6g}" if "thickness_factor" in part else ""
        yield (
            f"{name}{report['rays'] / 1e6:.3g} million rays in {report['seconds']:.1f} s, standard error "
            f"{report['mean_standard_error']:.2g} on average, {report['max_standard_error']:.2g} at most{factor}{step}"
        )
    if reported["uv_file"]:
        yield f"{reported['uv_file']}: the model with new UVs for this map"
    yield from (f"left out, {line}" for line in reported["left_out"])


def _size_line(file: str, record: Record, found: Record, unit: str) -> str:
    size = "x".join(map(str, record["size"])) + ", " if "size" in record else ""
    return f"{file}: {size}{record['mode']}, {found['min']:.4g} to {found['max']:.4g}{unit}"


def _check_report(
    checks: Mapping[str, Any], output: object, write: Callable[..., None], content: str
) -> dict[str, Any]:
    """Errors of what was baked, by mesh; their picture goes beside the output. None is a mesh that nothing shows."""
    path, hidden = Path(f"{output}.check.png"), "the mesh is hidden by other parts of its body"
    write([one for one in checks.values() if one is not None], path)
    lines = [line for name, one in checks.items() for line in (f"check of {name!r}:", *str(one or hidden).split("\n"))]
    return {
        "check": {name: None if one is None else one.summary() for name, one in checks.items()},
        "check_picture": str(path),
        "lines": [*lines, f"{path}: {content}"],
    }


def _bake_scatter(job: ScatterJob, given: BakeOptions, as_json: bool) -> None:
    """Bake scattered light of one model, as the options say."""
    from translucent.bake.scatter_job import check_scatter_output, run_scatter_job, write_scatter_picture

    record, results = run_scatter_job(job)
    checks = {}
    if given.check:
        found, description = check_scatter_output(job.output, results), "baked, diffused in pictures, difference"
        checks = _check_report(found, job.output, write_scatter_picture, description)
    reported = {"output": str(job.output), "record": record, **checks}
    lines = [*_scatter_lines(job, record), *checks.get("lines", [])]
    if assumes_metres(str(job.model), given.file):
        reported["size"] = size_note(next(iter(results.values())).body, "m")
        lines.append(f"size: {reported['size']}")
    _print(reported, lines, as_json)


def _scatter_lines(job: ScatterJob, record: dict[str, Any]) -> list[str]:
    parts = record.get("primitives") or [record]
    size = "x".join(map(str, record["size"])) + ", " if "size" in record else ""
    found = [f"{job.output}: {size}scattered light, nine coefficients per channel"]
    for part in parts:
        mean = ", ".join(f"{value:.3g}" for value in part["mean_in_uniform_light"])
        found.append(f"{part['mesh']['name']}: {part['cells']} cells; on average, {mean} of uniform light leaves it")
        found += part["warnings"]
    if "uv_file" in record:
        found.append(f"{job.output.with_name(record['uv_file']['file'])}: the model with new UVs for this map")
    return found + [f"left out, {line}" for line in record.get("left_out", [])]


def _bake_many(models: tuple[str, ...], out_dir: Path, given: BakeOptions, as_json: bool) -> None:
    from translucent.bake.batch import BatchReport, bake_many, failed_entry
    from translucent.files.paths import made_folder

    if given.jobs is not None and given.dask is not None:
        do = "omit --jobs or --dask"
        raise InputError(f"--jobs {given.jobs}", "--dask already chooses the workers", do)
    if given.dask is not None and given.resume:
        raise InputError(
            "--resume",
            "--resume and --dask exclude each other",
            "an interrupted Dask job starts again from the beginning; omit --resume",
        )
    requested, absent = [], []
    for model in models:
        output = out_dir / f"{Path(model).stem}.{given.format}"
        try:
            mesh_file(model, given.file.unit)
            unit = file_unit(model, given.file)
        except InputError as error:
            absent.append(failed_entry({"model": model, "output": str(output)}, str(error)))
        else:
            requested.append(_read_job(model, output, given, unit))
    notify = _reporter([*requested, *absent], as_json)
    with made_folder(out_dir), _executor(given.dask) as executor:
        report = bake_many(requested, executor, given.jobs, notify)
        for entry in absent:
            notify(entry)
        report = BatchReport((*report.assets, *absent), report.seconds)
        echo(json.dumps(report.summary()) if as_json else report.total)
        if failed := report.count("failed"):
            raise TranslucentError(f"{failed} of {len(models)} models failed", "the others are done", "see above")


def _reporter(assets: list[Record], as_json: bool) -> Callable[[Record], None]:
    """Callback that prints a line for each asset when it is done, with the time left; not between the lines of a JSON
    result.
    """
    from translucent.bake.batch import asset_line

    width = max(len(Path(asset["model"]).name) for asset in assets)
    began, done, worked = time.perf_counter(), 0, 0

    def report(entry: Record) -> None:
        nonlocal done, worked
        done += 1
        worked += entry["status"] != "skipped"
        left = len(assets) - done
        after = ""
        if left and worked:
            after = f"; about {time_text((time.perf_counter() - began) / worked * left)} left"
        echo(f"{done:>{len(str(len(assets)))}}/{len(assets)}  {asset_line(entry, width)}{after}", err=as_json)

    return report


@contextlib.contextmanager
def _executor(address: str | None) -> Iterator[Executor | None]:
    """The workers behind a Dask scheduler, or None for processes here."""
    if address is None:
        yield None
        return
    distributed = require_package("distributed", f"--dask {address}", "omit --dask to bake on this machine")
    import asyncio  # 45 ms of each start of the command line, and only this needs it

    try:
        # A client that cannot connect leaves its loop running, with nothing to close it by.
        asyncio.run(_knock(distributed, address))
        client = distributed.Client(address, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        found = f"no scheduler answered ({error or type(error).__name__})"
        raise RenderError(f"--dask {address}", found, "check the address") from error
    with client:
        yield client.get_executor()


async def _knock(distributed: ModuleType, address: str) -> None:
    """Connect to a Dask scheduler, and leave; raises OSError or ValueError if none answers."""
    security = distributed.Security().get_connection_args("client")
    connection = await distributed.comm.connect(address, timeout=CONNECT_SECONDS, **security)
    await connection.close()


@dataclass(frozen=True, kw_only=True)
class LithophaneOptions:
    """Options of ``translucent lithophane``."""

    output: Path = option(names=("-o", "--output"), required=True, help="Output file: an .stl mesh in millimetres.")
    td: str | None = option(
        metavar="D",
        help=(
            "Transmission distance of the filament: the thickness after which 10 % of the light is left, such as 4mm."
        ),
    )
    medium: MediumOptions = group(MediumOptions)
    thickness: str = option("0.6mm..3mm", metavar="A..B", help="Smallest and largest thickness of the plate.")
    width: str = option("100mm", metavar="W", help="Width of the plate.")
    pitch: str = option("0.25mm", metavar="P", help="Distance between neighboring points of the relief.")
    check: bool = option(
        False, help="Write OUTPUT.check.png, which compares the requested picture with the rendered relief."
    )
    overwrite: bool = overwrite_option()


@click.command(epilog="Example: translucent lithophane photo.jpg --td 4mm -o relief.stl")
@click.argument("picture", type=click.Path(path_type=Path))
@takes(LithophaneOptions)
def lithophane(picture: Path, given: LithophaneOptions, as_json: bool) -> None:
    """Make a plate for 3D printing that shows PICTURE.

    In front of a light, thin parts of the plate appear bright, and thick parts appear dark. The thickest part of
    the plate shows black, the thinnest part shows white, and the luminance in between is proportional to PICTURE.
    The command then renders the plate in front of a uniform white light, and prints the difference from PICTURE.
    The command assumes that light passes straight through the plate, so give the --td of the filament, or the --color
    of light after a --distance in it.
    """
    from translucent.bake.lithophane import check_lithophane_output, lithophane
    from translucent.media.conversion import extinction_of_td
    from translucent.media.medium import Medium
    from translucent.units import parse_length

    output, td = given.output, given.td
    least, dots, largest = given.thickness.partition("..")
    if not dots:
        raise InputError(
            f"--thickness {given.thickness}", "this option needs two lengths", "write for example 0.6mm..3mm"
        )
    medium = given.medium.read(shows_scattering=True)
    if (medium is None) == (td is None):
        found = "no medium is given" if td is None else "--td and a medium are both given"
        raise InputError(
            "lithophane", found, "choose the material with --td, with --color and --distance, or with --preset"
        )
    if td is not None:
        medium = Medium(absorption=extinction_of_td(parse_length(td, "mm")))
    assert medium is not None
    picture_file = Path(f"{check_lithophane_output(output)}.check.png")
    refuse_overwriting(output, picture)
    if given.check:
        refuse_overwriting(picture_file, picture)
    ends = parse_length(least, "mm"), parse_length(largest, "mm")
    made = lithophane(picture, medium, ends, parse_length(given.width, "mm"), parse_length(given.pitch, "mm"))
    made.save(output)
    if given.check:
        made.save_check(picture_file)
    low, high = made.mesh.vertices.min(axis=0), made.mesh.vertices.max(axis=0)
    size = [float(1e3 * length) for length in high - low]
    reported = {
        "output": str(output),
        "size_mm": size,
        "triangles": len(made.mesh.faces),
        "contrast": made.contrast,
        "rms": made.rms,
    }
    if given.check:
        reported["check_picture"] = str(picture_file)
    if as_json:
        echo(json.dumps(reported))
        return
    echo(f"{output}: {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} mm, {len(made.mesh.faces)} triangles")
    echo(f"contrast {made.contrast:.3g} : 1; black appears as {100 / made.contrast:.3g} % of white")
    echo(f"in front of a uniform white light: rms difference from the picture {100 * made.rms:.2g} % of white")
    if given.check:
        echo(f"{picture_file}: requested picture, rendered plate")
