"""``translucent material``: the volume materials of a glTF file, shown, replaced and checked."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.console import echo
from translucent.commands.options import (
    FileOptions,
    MediumOptions,
    outside_option,
    overwrite_option,
    refuse_overwriting,
    triple_text,
)
from translucent.commands.verbs import group, option, takes
from translucent.errors import InputError, RenderError

if TYPE_CHECKING:
    from translucent.bake.audit.rules import MaterialCheck
    from translucent.gltf.materials import GltfMaterial


@click.group(epilog="Example: translucent material show model.glb")
def material() -> None:
    """Show, replace or check the materials of a glTF file."""


@dataclass(frozen=True, kw_only=True)
class ShowOptions:
    """Options of ``translucent material show``."""

    file: FileOptions = group(FileOptions, without=("unit", "height", "longest", "allow_outside"))


@material.command(epilog="Example: translucent material show model.glb")
@click.argument("model")
@takes(ShowOptions)
def show(model: str, given: ShowOptions, as_json: bool) -> None:
    """List the materials of a .glb or .gltf MODEL with their volumes."""
    from translucent.gltf.materials import read_materials

    found = read_materials(model, draft_extensions=given.file.draft_extensions)
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
        if medium.scatters:
            echo(f"  scattering  {triple_text(medium.scattering)} 1/m, anisotropy {medium.anisotropy:g}")
    if entry.dispersion:
        echo(f"  dispersion  {entry.dispersion:10.5g}")
    if entry.iridescence:
        film = f"{1e9 * entry.iridescence_thickness:.5g} nm of ior {entry.iridescence_ior:g}"
        echo(f"  iridescence {entry.iridescence:10.5g}, {film}")
    if entry.clearcoat:
        echo(f"  clearcoat   {entry.clearcoat:10.5g}, roughness {entry.clearcoat_roughness:g}")
    if any(entry.emissive):
        echo(f"  emissive    {triple_text(entry.emissive)} linear, emitted by the surface")
    for warning in entry.warnings:
        echo(f"  warning: {warning}")


def _texture_text(entry: GltfMaterial) -> str:
    transform = entry.thickness_transform
    changed = ", transformed" if (transform.offset, transform.rotation, transform.scale) != ((0, 0), 0, (1, 1)) else ""
    return f" times texture {entry.thickness_texture} at TEXCOORD_{transform.tex_coord}{changed}"


@dataclass(frozen=True, kw_only=True)
class ApplyOptions:
    """Options of ``translucent material apply``."""

    output: Path = option(names=("-o", "--output"), required=True, help="Output file: .glb or .gltf.")
    medium: MediumOptions = group(MediumOptions)
    object: str | None = option(
        metavar="NAME",
        help=(
            "Change only the objects of this name. Default: all translucent objects; if the file has none, all objects."
        ),
    )
    thickness: str | None = option(
        metavar="T",
        help=(
            "Thickness of the volume, in the units of the mesh, as in glTF. Default: the shortest side of the object."
        ),
    )
    draft_extensions: str | None = option(
        is_flag=False,
        flag_value="scatter",
        type=click.Choice(["scatter", "volume-scatter"]),
        help=(
            "Also write scattering, as one of two draft extensions: KHR_materials_scatter or "
            "KHR_materials_volume_scatter."
        ),
    )
    overwrite: bool = overwrite_option()
    allow_outside: bool = outside_option()


@material.command(
    epilog="Example: translucent material apply model.glb --color '#7b1e3a' --distance 1cm --object Wine -o out.glb"
)
@click.argument("model")
@takes(ApplyOptions)
def apply(model: str, given: ApplyOptions, as_json: bool) -> None:
    """Write a medium into the materials of MODEL. --color keeps the index of refraction of the file, and --preset
    replaces it."""
    from translucent.gltf.write import write_medium
    from translucent.units import parse_length

    draft: Any = given.draft_extensions  # one that the type lists
    medium = given.medium.read(shows_scattering=draft is not None)
    if medium is None:
        raise InputError("material apply", "no medium is given", "add --color and --distance, or --preset")
    refuse_overwriting(given.output, model)
    changed = write_medium(
        model,
        given.output,
        medium,
        distance=None if given.medium.distance is None else parse_length(given.medium.distance),
        object_name=given.object,
        thickness=None if given.thickness is None else parse_length(given.thickness),
        keep_ior=given.medium.preset is None,
        draft_extensions=draft,
        allow_outside=given.allow_outside,
    )
    if as_json:
        echo(json.dumps({"output": str(given.output), "materials": changed}))
        return
    echo(f"{given.output}: material{'' if len(changed) == 1 else 's'} {', '.join(map(str, changed))} changed")


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Options of ``translucent material check``."""

    fix: bool = option(
        False,
        help="Bake the thickness of materials whose thickness is wrong, write OUTPUT, and check OUTPUT.",
    )
    output: Path | None = option(names=("-o", "--output"), help="Output of --fix: a .glb file.")
    size: int = option(512, metavar="N", help="With --fix: number of texels along each side of a map.")
    rays: int = option(64, metavar="N", help="With --fix: number of rays from each texel.")
    overwrite: bool = overwrite_option()
    allow_outside: bool = outside_option()


@material.command(epilog="Example: translucent material check model.glb --fix -o fixed.glb")
@click.argument("model")
@takes(CheckOptions)
def check(model: str, given: CheckOptions, as_json: bool) -> None:
    """Check the thickness and attenuation in MODEL, a glTF file.

    The command compares the materials with the thickness of the meshes.

    The command prints errors, warnings and notes, each with a solution. For each body, the true color of the light that
    passes is printed next to the colors that known viewers show. The exit code is 1 if MODEL has an error (with --fix:
    if OUTPUT has an error), otherwise 0.

    --fix bakes thickness maps, sets metallicFactor of transmitting materials to 0 and removes doubleSided of volumes.
    --fix does not correct errors of meshes, units and attenuations.
    """
    from translucent.bake.audit.check import check_materials, fix_materials

    output, outside = given.output, given.allow_outside
    if given.fix != (output is not None):
        requested, missing = ("--fix", "-o OUTPUT is missing") if given.fix else (f"-o {output}", "--fix is missing")
        raise InputError(requested, missing, "these options belong together: give both, or neither")
    found = left = check_materials(model, allow_outside=outside)
    if output is not None:
        refuse_overwriting(output, model)
        left = fix_materials(model, output, size=given.size, rays=given.rays, allow_outside=outside)
    if as_json:
        fixed = {} if output is None else {"fixed": left.summary()}
        echo(json.dumps({**found.summary(), **fixed}))
    else:
        _echo(model, found)
        if output is not None:
            _echo(str(output), left)
    if left.errors:
        count = len(left.errors)
        requested = f"material check {model if output is None else output}"
        reported = f"{count} finding{'' if count == 1 else 's'} of severity error"
        raise RenderError(requested, reported, left.errors[0].do)


def _echo(model: str, found: MaterialCheck) -> None:
    counts = found.summary()["counts"]
    reported = ", ".join(f"{n} {name}{'' if n == 1 else 's'}" for name, n in counts.items())
    echo(f"{model}: {len(found.bodies)} translucent bod{'y' if len(found.bodies) == 1 else 'ies'}; {reported}")
    for one in found.findings:
        echo(f"{one.severity:8}{one.code}: {one.where}")
        echo(f"        {one.text}")
        echo(f"        do: {one.do}")
    for body in found.bodies:
        if body["colors"] and body["stated"]:
            _echo_body(body)


def _echo_body(body: dict[str, Any]) -> None:
    """Thickness of a body and what passes it, in a few lines."""
    from translucent.formulas.color import to_hex

    echo(f"{body['mesh_name']!r}, material {body['material']}, node {body['nodes'][0]!r}:")
    lengths = [
        f"{name} {values['median']:.4g} m (p95 {values['p95']:.4g})"
        for name, values in (
            ("stated", body["stated"]),
            ("along normals", body["along_normals"]),
            ("along views", body["along_views"]),
        )
        if values is not None
    ]
    echo(f"        thickness {', '.join(lengths)}")
    colors = [f"{name} {to_hex(color)}" for name, color in body["colors"].items()]
    echo(f"        transmitted color, mean over all views: {', '.join(colors)}")
