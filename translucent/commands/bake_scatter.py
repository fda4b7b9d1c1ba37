"""``translucent bake --mode scatter``: light that a body gives back after scattering, into a map or a glTF file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from translucent.commands.common import read_any_medium, read_roughness, refuse_overwriting
from translucent.commands.console import echo
from translucent.commands.model import mesh_file
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.bake.scatter.check import ScatterCheck
    from translucent.bake.scatter.job import ScatterJob

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
            raise InputError(_option(name), "thickness has no use for it", f"add --mode {SCATTER}, or leave it out")


def bake_scatter(
    models: tuple[str, ...], output: Path | None, given: dict[str, Any], check: bool, as_json: bool
) -> None:
    """Bake scattered light of one model, as the options say."""
    from translucent.bake.scatter.job import run_scatter_job

    for name in _given():
        if name not in _TAKEN:
            raise InputError(_option(name), f"--mode {SCATTER} has no use for it", "leave it out")
    if output is None or len(models) != 1:
        raise InputError(f"--mode {SCATTER}", f"{len(models)} models" if output else "no -o", "give one MODEL and -o")
    job = _read_job(models[0], output, given)
    record, results = run_scatter_job(job)
    checks = _check(output, results) if check else {}
    told = {"output": str(output), "record": record, **checks}
    if as_json:
        echo(json.dumps(told))
        return
    for line in (*_lines(job, record), *checks.get("lines", [])):
        echo(line)


def _read_job(model: str, output: Path, given: dict[str, Any]) -> ScatterJob:
    from translucent.bake.scatter.job import ScatterJob

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


def _lines(job: ScatterJob, record: dict[str, Any]) -> list[str]:
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


def _check(output: Path, results: Any) -> dict[str, Any]:
    from translucent.bake.scatter.check import check_scatter_output, lines, summary
    from translucent.bake.scatter.picture import write_scatter_picture

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


def _option(name: str) -> str:
    named = {"suffix": "format", "preset_name": "preset", "allow_outside": "allow-outside"}
    return f"--{named.get(name, name).replace('_', '-')}"
