"""``translucent material``: the volume materials of a glTF file, shown and replaced."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from translucent.commands.common import (
    common_options,
    medium_options,
    outside_option,
    overwrite_option,
    read_medium,
    refuse_overwriting,
    triple_text,
)
from translucent.commands.console import echo
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.gltf.materials import GltfMaterial


@click.group(epilog="Example: translucent material show model.glb")
def material() -> None:
    """Show or replace the materials of a glTF file that light passes."""


@material.command(epilog="Example: translucent material show model.glb")
@click.argument("model")
@common_options
def show(model: str, as_json: bool) -> None:
    """List the materials of MODEL, a .glb or .gltf file, with the volume that each of them states."""
    from translucent.gltf.materials import read_materials

    found = read_materials(model)
    if as_json:
        echo(json.dumps({"model": model, "materials": [entry.summary() for entry in found]}))
        return
    echo(f"{model}: {len(found)} material{'' if len(found) == 1 else 's'}")
    for entry in found:
        _describe(entry)


def _describe(entry: GltfMaterial) -> None:
    medium = entry.medium()
    echo(f"{entry.index} {entry.name!r}: {entry.kind}, transmission {entry.transmission:g}, ior {entry.ior:g}")
    if entry.has_volume:
        texture = _texture_text(entry) if entry.has_thickness_texture else ""
        echo(f"  thickness   {entry.thickness:10.5g}{texture} (mesh space)")
        echo(f"  color       {triple_text(entry.attenuation_color)} linear, at {entry.attenuation_distance:g} m")
    if medium is not None:
        echo(f"  extinction  {triple_text(medium.extinction)} 1/m")
    if entry.dispersion:
        echo(f"  dispersion  {entry.dispersion:10.5g}")
    if any(entry.emissive):
        echo(f"  emissive    {triple_text(entry.emissive)} linear, of the surface")
    for warning in entry.warnings:
        echo(f"  warning: {warning}")


def _texture_text(entry: GltfMaterial) -> str:
    transform = entry.thickness_transform
    changed = ", transformed" if (transform.offset, transform.rotation, transform.scale) != ((0, 0), 0, (1, 1)) else ""
    return f" times texture {entry.thickness_texture} at TEXCOORD_{transform.tex_coord}{changed}"


@material.command(
    epilog="Example: translucent material apply model.glb --color '#7b1e3a' --distance 1cm --object Wine -o out.glb"
)
@click.argument("model")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="A .glb or .gltf file.")
@medium_options
@click.option(
    "--object",
    "object_name",
    metavar="NAME",
    help="Only the objects of this name. Default: all that light enters, or all.",
)
@click.option("--thickness", metavar="T", help="In the mesh's own units, as glTF has it. Default: the smallest side.")
@overwrite_option
@outside_option
@common_options
def apply(
    model: str,
    output: Path,
    color: str | None,
    distance: str | None,
    preset_name: str | None,
    clamp: bool | None,
    object_name: str | None,
    thickness: str | None,
    allow_outside: bool,
    as_json: bool,
) -> None:
    """Write a medium into MODEL's materials; a color leaves them their index of refraction, a preset brings its own."""
    from translucent.gltf.write import write_medium
    from translucent.units import parse_length

    medium = read_medium(color, distance, preset_name, clamp)
    if medium is None:
        raise InputError("material apply", "no medium is given", "add --color and --distance, or --preset")
    refuse_overwriting(output, model)
    changed = write_medium(
        model,
        output,
        medium,
        distance=None if distance is None else parse_length(distance),
        object_name=object_name,
        thickness=None if thickness is None else parse_length(thickness),
        keep_ior=preset_name is None,
        allow_outside=allow_outside,
    )
    if as_json:
        echo(json.dumps({"output": str(output), "materials": changed}))
        return
    echo(f"{output}: material{'' if len(changed) == 1 else 's'} {', '.join(map(str, changed))} changed")
