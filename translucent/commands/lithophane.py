"""``translucent lithophane``: the relief through which a light shows a picture, to be printed."""

from __future__ import annotations

import json
from pathlib import Path

import click

from translucent.commands.console import echo
from translucent.commands.options import (
    common_options,
    medium_options,
    overwrite_option,
    read_medium,
    refuse_overwriting,
)
from translucent.errors import InputError


@click.command(epilog="Example: translucent lithophane photo.jpg --td 4mm -o relief.stl")
@click.argument("picture", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="A .stl file, in millimetres.")
@click.option(
    "--td", metavar="D", help="Transmission distance of the filament, after which 10 % of light is left: 4mm."
)
@medium_options
@click.option("--thickness", default="0.6mm..3mm", show_default=True, metavar="A..B", help="Least and largest.")
@click.option("--width", default="100mm", show_default=True, metavar="W", help="Of the plate.")
@click.option("--pitch", default="0.25mm", show_default=True, metavar="P", help="Distance of the relief's points.")
@click.option("--check", is_flag=True, help="Write OUTPUT.check.png: what is asked for, and what the relief shows.")
@overwrite_option
@common_options
def lithophane(
    picture: Path,
    output: Path,
    td: str | None,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    thickness: str,
    width: str,
    pitch: str,
    check: bool,
    as_json: bool,
) -> None:
    """Make the relief of a plate that shows PICTURE before a light: thin where it is bright, thick where it is dark.

    The luminance that passes goes linearly from that of the thickest place, for black, to that of the thinnest, for
    white. The relief is then rendered before an even white light, and the difference is told. Light is taken to go
    straight through, so give the filament's --td, or a --color that you saw before a light at a --distance.
    """
    from translucent.bake.lithophane import check_lithophane_output, lithophane
    from translucent.media.filament import medium_of_td
    from translucent.units import parse_length

    least, dots, largest = thickness.partition("..")
    if not dots:
        raise InputError(f"--thickness {thickness}", "one length", "write for example 0.6mm..3mm")
    medium = read_medium(color, distance, preset_name, clamp, shows_scattering=True)
    if (medium is None) == (td is None):
        found = "no medium" if td is None else "--color or --preset is given, too"
        raise InputError("lithophane", found, "give --td, --color with --distance, or --preset")
    if td is not None:
        medium = medium_of_td(parse_length(td, "mm"))
    assert medium is not None
    picture_file = Path(f"{check_lithophane_output(output)}.check.png")
    refuse_overwriting(output, picture)
    if check:
        refuse_overwriting(picture_file, picture)
    ends = parse_length(least, "mm"), parse_length(largest, "mm")
    made = lithophane(picture, medium, ends, parse_length(width, "mm"), parse_length(pitch, "mm"))
    made.save(output)
    if check:
        made.save_check(picture_file)
    low, high = made.mesh.vertices.min(axis=0), made.mesh.vertices.max(axis=0)
    size = [float(1e3 * length) for length in high - low]
    told = {
        "output": str(output),
        "size_mm": size,
        "triangles": len(made.mesh.faces),
        "contrast": made.contrast,
        "rms": made.rms,
    }
    if check:
        told["check_picture"] = str(picture_file)
    if as_json:
        echo(json.dumps(told))
        return
    echo(f"{output}: {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} mm, {len(made.mesh.faces)} triangles")
    echo(f"contrast {made.contrast:.3g} : 1; black is shown as {100 / made.contrast:.3g} % of white")
    echo(f"rendered before an even white light: {100 * made.rms:.2g} % of white (rms) from what is asked for")
    if check:
        echo(f"{picture_file}: asked for, shown")
