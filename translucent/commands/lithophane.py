"""``translucent lithophane``: the relief through which a light shows a picture, to be printed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import click

from translucent.commands.console import echo
from translucent.commands.options import MediumOptions, group, option, overwrite_option, refuse_overwriting, takes
from translucent.errors import InputError


@dataclass(frozen=True, kw_only=True)
class LithophaneOptions:
    """Options of ``translucent lithophane``."""

    output: Path = option(names=("-o", "--output"), required=True, help="A .stl file, in millimetres.")
    td: str | None = option(
        metavar="D", help="Transmission distance of the filament, after which 10 % of light is left: 4mm."
    )
    medium: MediumOptions = group(MediumOptions)
    thickness: str = option("0.6mm..3mm", metavar="A..B", help="Least and largest.")
    width: str = option("100mm", metavar="W", help="Of the plate.")
    pitch: str = option("0.25mm", metavar="P", help="Distance of the relief's points.")
    check: bool = option(False, help="Write OUTPUT.check.png: what is asked for, and what the relief shows.")
    overwrite: bool = overwrite_option()


@click.command(epilog="Example: translucent lithophane photo.jpg --td 4mm -o relief.stl")
@click.argument("picture", type=click.Path(path_type=Path))
@takes(LithophaneOptions)
def lithophane(picture: Path, given: LithophaneOptions, as_json: bool) -> None:
    """Make the relief of a plate that shows PICTURE before a light: thin where it is bright, thick where it is dark.

    The luminance that passes goes linearly from that of the thickest place, for black, to that of the thinnest, for
    white. The relief is then rendered before an even white light, and the difference is told. Light is taken to go
    straight through, so give the filament's --td, or a --color that you saw before a light at a --distance.
    """
    from translucent.bake.lithophane import check_lithophane_output, lithophane
    from translucent.media.filament import medium_of_td
    from translucent.units import parse_length

    output, td = given.output, given.td
    least, dots, largest = given.thickness.partition("..")
    if not dots:
        raise InputError(f"--thickness {given.thickness}", "one length", "write for example 0.6mm..3mm")
    medium = given.medium.read(shows_scattering=True)
    if (medium is None) == (td is None):
        found = "no medium" if td is None else "--color or --preset is given, too"
        raise InputError("lithophane", found, "give --td, --color with --distance, or --preset")
    if td is not None:
        medium = medium_of_td(parse_length(td, "mm"))
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
    told = {
        "output": str(output),
        "size_mm": size,
        "triangles": len(made.mesh.faces),
        "contrast": made.contrast,
        "rms": made.rms,
    }
    if given.check:
        told["check_picture"] = str(picture_file)
    if as_json:
        echo(json.dumps(told))
        return
    echo(f"{output}: {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} mm, {len(made.mesh.faces)} triangles")
    echo(f"contrast {made.contrast:.3g} : 1; black is shown as {100 / made.contrast:.3g} % of white")
    echo(f"rendered before an even white light: {100 * made.rms:.2g} % of white (rms) from what is asked for")
    if given.check:
        echo(f"{picture_file}: asked for, shown")
