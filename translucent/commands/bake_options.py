"""The options of ``translucent bake``, and the jobs that they make."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.bake_scatter import SCATTER, SIZE
from translucent.commands.common import (
    F,
    medium_options,
    outside_option,
    read_medium,
    refuse_overwriting,
    scattering_medium_options,
    unit_option,
)
from translucent.commands.model import mesh_file
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.bake.jobs import Job

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
