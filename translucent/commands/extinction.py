"""``translucent extinction``: from colors at distances or on a model, photographs, or a filament's TD to extinction."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from translucent.commands.console import echo, takes_colors
from translucent.commands.model import CameraOptions, read_scene
from translucent.commands.options import (
    clamp_option,
    clamped,
    common_options,
    outside_option,
    overwrite_option,
    read_medium,
    read_roughness,
    refuse_overwriting,
    triple_text,
)
from translucent.errors import InputError, TranslucentError

if TYPE_CHECKING:
    from translucent.frames.frame import Frame
    from translucent.media.fitting import Fit, StepFit
    from translucent.media.medium import Medium


#: Suffixes of tables; all else but .toml are pictures.
TABLES = (".csv", ".json")

#: Metres from which plates are told to be thick: millimetres without their unit.
_THICK = 0.3


class Fitted(NamedTuple):
    """A medium fitted to files: it, the distance at which its color is told, what is told, and the same in words."""

    medium: Medium
    distance: float
    told: dict[str, Any]
    report: str


def fit_options(command: Any) -> Any:
    """Options for what a medium is fitted to."""
    command = click.option(
        "--patch",
        "patches",
        multiple=True,
        metavar="X,Y,W,H=D",
        help="Of --fit PHOTO: a patch and its thickness; equal steps side by side, X,Y,W,H=1mm,2mm,4mm; or a wedge, "
        "X,Y,W,H=1mm..8mm. Repeated for more.",
    )(command)
    command = click.option(
        "--white", metavar="X,Y,W,H", help="Of --fit PHOTO: where the light is seen with nothing before it, in pixels."
    )(command)
    return click.option(
        "--fit",
        "fits",
        type=click.Path(path_type=Path),
        multiple=True,
        metavar="FILE",
        help="Fit to rows of distance,color[,weight] in a .csv; to photographs of steps before a light, with --white "
        "and --patch, repeated for other exposures; or to a .toml of such photographs.",
    )(command)


def is_table(fits: tuple[Path, ...]) -> bool:
    """True if --fit names a table, as against photographs."""
    return any(one.suffix.lower() in TABLES for one in fits)


def fitted(
    fits: tuple[Path, ...], white: str | None, patches: tuple[str, ...], ior: float | None, unit: str, unit_out: str
) -> Fitted:
    """Medium fitted to what the options name."""
    import numpy as np

    from translucent.media.conversion import summary

    described = is_table(fits) or fits[0].suffix.lower() == ".toml"
    if described and len(fits) > 1:
        raise InputError(
            f"--fit {fits[1]}", f"--fit {fits[0]} is given, too", "give one table or .toml, or photographs"
        )
    if described and (white is not None or patches):
        given = "--white" if white is not None else "--patch"
        raise InputError(given, "only a photograph takes it", "leave it out, or write it into the .toml")
    if not is_table(fits):
        return _of_photographs(fits, white, patches, ior, unit, unit_out)
    from translucent.media.fitting import fit_wedge

    fit = fit_wedge(fits[0], unit)
    distance = float(np.median(fit.distances))
    told = summary(fit.medium.transmittance(distance), distance, fit.medium.extinction, unit_out)
    told["warnings"][:0] = [f"{name} brightens with distance; its extinction is 0" for name in fit.clipped]
    error = None if fit.standard_error is None else fit.standard_error.tolist()
    told |= {"samples": len(fit.distances), "standard_error": error, "residuals": fit.residuals.tolist()}
    return Fitted(fit.medium, distance, told, _table_report(fit))


def _of_photographs(
    fits: tuple[Path, ...], white: str | None, patches: tuple[str, ...], ior: float | None, unit: str, unit_out: str
) -> Fitted:
    from translucent.frames.photographs import (
        Photograph,
        fit_photographs,
        parse_patches,
        parse_rectangle,
        read_photographs,
    )
    from translucent.media.conversion import summary
    from translucent.units import length_text

    if fits[0].suffix.lower() == ".toml":
        shots = read_photographs(fits[0], unit)
    else:
        if white is None or not patches:
            missing = "--white" if white is None else "--patch"
            do = "say where in it the bare light is, --white X,Y,W,H, and the steps, --patch X,Y,W,H=1mm,2mm,4mm"
            raise InputError(f"--fit {fits[0]}", f"{missing} is missing", do)
        listed = [patch for text in patches for patch in parse_patches(text, unit)]
        shots = [Photograph(one, parse_rectangle(white), listed) for one in fits]
    fit = fit_photographs(shots, ior)
    told = summary(fit.medium.transmittance(fit.distance), fit.distance, fit.medium.extinction, unit_out)
    told["warnings"][:0] = fit.warnings
    if fit.distance >= _THICK:
        doubt = "lengths that name no unit are in metres, unless --unit mm is given"
        told["warnings"].insert(0, f"plates about {length_text(fit.distance)} thick: {doubt}")
    told |= {
        "samples": fit.samples.tolist(),
        "standard_error": fit.standard_error.tolist(),
        "interval": fit.interval.tolist(),
        "surface_loss": fit.surface_loss.tolist(),
        "chi2_per_degree": [None if value != value else value for value in fit.chi2_per_degree.tolist()],
    }
    return Fitted(fit.medium, fit.distance, told, _photographs_report(fit, len(shots)))


def _table_report(fit: Fit) -> str:
    error = "unknown with one sample" if fit.standard_error is None else f"{triple_text(fit.standard_error)} 1/m"
    lines = [f"standard error  {error}", f"residuals of {len(fit.distances)} samples, log(color / fit):"]
    for distance, residual in zip(fit.distances, fit.residuals, strict=True):
        lines.append(f"at {distance:<12.4g} m {triple_text(residual)}")
    return "\n".join(lines)


def _photographs_report(fit: StepFit, photographs: int) -> str:
    samples = ", ".join(str(count) for count in fit.samples)
    return "\n".join([
        f"error bars      {triple_text(fit.interval)} 1/m to either side hold the extinction with 95 %",
        f"lost at faces   {triple_text(100 * fit.surface_loss)} %",
        f"scatter         {triple_text(fit.chi2_per_degree)} chi2 per degree of freedom, 1 where it is noise alone",
        f"from            {samples} patches in {photographs} photograph{'s' if photographs > 1 else ''}",
    ])  # fmt: skip


#: Pixels of the picture that is averaged; of the shape of the one that ``translucent render`` makes, and so framed.
SIZE = (640, 360)

#: Share of a channel's average beyond which the thin parts alone make its color.
MOST_THIN_SHARE = 0.5


def thickness_on(model: str, unit: str, eye: str | None, allow_outside: bool = False) -> Frame:
    """The model as ``translucent render`` shows it, all of it filled with one medium."""
    import translucent as tl

    # Any medium will do: only the thickness is looked at.
    scene = read_scene(
        model, unit, tl.Medium(absorption=1.0), CameraOptions(eye=eye), SIZE, allow_outside=allow_outside
    )
    with tl.Renderer() as renderer:
        return renderer.render(scene, SIZE)


def told_on(model: str, frame: Frame, medium: Medium) -> dict[str, Any]:
    """Appearance of a medium on a model as values that JSON can hold."""
    from translucent.frames.appearance import appearance_of

    return {"model": model, **appearance_of(frame, medium).summary()}


def doubts_on(told: dict[str, Any]) -> list[str]:
    """Warnings about an average color: channels that next to nothing of the model shows."""
    return [
        f"the average {name} is made by the edges: {share:.0%} of it comes from the thinnest 5 % of the pixels"
        for name, share in zip(("red", "green", "blue"), told["thin_share"], strict=True)
        if share > MOST_THIN_SHARE
    ]


def report_on(told: dict[str, Any]) -> list[str]:
    """Lines of text for what `told_on` says."""
    lines = [
        f"on {told['model']}: {told['pixels']} pixels, {told['mean_thickness']:.4g} m thick on average",
        f"average color   {triple_text(told['average_color'])} linear, {told['average_hex']} sRGB",
    ]
    for part in told["parts"]:
        color = f"{triple_text(part['color'])} linear, {part['hex']}"
        lines.append(f"at {part['thickness']:<9.4g} m  {color}; {part['thinner']:.0%} of it is thinner")
    return lines


TARGETS = (
    "gltf", "openpbr", "standard_surface", "blender", "threejs", "godot", "unreal", "unity", "usd", "css", "json",
)  # fmt: skip

#: Targets that draw no surface.
_WITHOUT_SURFACE = ("css", "json")


class _Wanted(NamedTuple):
    """Facts to be told of a medium, and their form."""

    target: str | None
    ior: float | None
    roughness: float
    td_transmittance: float | None
    as_json: bool


_DEFAULT = click.core.ParameterSource.DEFAULT


@click.command(epilog="Example: translucent extinction '#7b1e3a' 1cm")
@click.argument("color", required=False)
@click.argument("distance", required=False)
@click.option("--unit", default="m", show_default=True, help="Unit of distances that name none, and of MODEL.")
@click.option("--unit-out", default="m", show_default=True, metavar="U", help="Give the extinction per this unit, too.")
@clamp_option
@click.option("--as", "target", type=click.Choice(TARGETS), help="Print the material for an engine, to paste.")
@click.option(
    "--ior",
    type=float,
    metavar="N",
    help="Of --as and of photographs: index of refraction. Default: the medium's, or 1.",
)
@click.option(
    "--roughness",
    type=click.FloatRange(0.0, 1.0),
    metavar="R",
    help="Of --as: of its surface, 0 (polished) to 1. Default: that of --preset or --from, or 0.",
)
@click.option("--batch", type=click.Path(path_type=Path), metavar="FILE", help="Convert rows of name,color,distance.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Of --batch: a .json or .csv file.")
@fit_options
@click.option("--preset", "preset_name", metavar="NAME", help="A named medium instead of a color at a distance.")
@click.option("--from", "source", metavar="FILE", help="The medium of a .mtlx or .usda file, or of what --as printed.")
@click.option("--td", metavar="D", help="Transmission distance of a filament for 3D printers instead: 4mm, or 4.")
@click.option(
    "--td-transmittance",
    type=float,
    metavar="T",
    help="Share of light left after --td, and after the TD that is told. Default: 0.1, T = 10^(-d/TD).",
)
@click.option("--on", "model", metavar="MODEL", help="A file, or a mesh of the toolkit: its color, see above.")
@click.option("--eye", metavar="X,Y,Z", help="Of --on: where it is seen from, in metres. Default: as render shows it.")
@overwrite_option
@outside_option
@common_options
@click.pass_context
def extinction(
    context: click.Context,
    color: str | None,
    distance: str | None,
    unit: str,
    unit_out: str,
    clamp: bool | None,
    target: str | None,
    ior: float | None,
    roughness: float | None,
    batch: Path | None,
    output: Path | None,
    fits: tuple[Path, ...],
    white: str | None,
    patches: tuple[str, ...],
    preset_name: str | None,
    source: str | None,
    td: str | None,
    td_transmittance: float | None,
    model: str | None,
    eye: str | None,
    allow_outside: bool,
    as_json: bool,
) -> None:
    """Extinction of a medium that turns white light into COLOR after DISTANCE: sigma_t = -log(color) / distance.

    COLOR is '#7b1e3a', 7b1e3a, teal, 'srgb(.5,.1,.2)', 'linear(.2,.6,.3)' or a pixel of an image, photo.png@120,45.

    With --on MODEL and no DISTANCE, the medium in which that model shows COLOR on average, over the pixels that it
    covers before white light; with a DISTANCE, --preset or --from, the average color that this medium shows on it.

    With --td D, the gray medium of a filament with this transmission distance: translucent extinction --td 4mm. Makers
    agree that next to no light passes there, not on the share: it is --td-transmittance, and told with every result.

    With --fit PHOTO, the medium of plates photographed before a light, with error bars; --ior says what their faces
    reflect: translucent extinction --fit steps.jpg --white 10,10,60,60 --patch 90,10,400,60=1mm,2mm,4mm,8mm
    """
    from translucent.media.colors import QUOTE_HINT
    from translucent.units import metres_per_unit

    metres_per_unit(unit_out)
    # Whoever prints gives millimetres.
    if td is not None and td[-1:].isdigit() and click.get_current_context().get_parameter_source("unit") is _DEFAULT:
        td = f"{td}mm"
    media: dict[str, object] = {
        "--batch": batch,
        "--fit": fits or None,
        "COLOR": color,
        "--preset": preset_name,
        "--from": source,
        "--td": td,
    }
    _check_usage(
        media, {"--batch": batch, "--fit": fits or None, "--on": model}, {"--json": as_json or None, "--as": target}
    )
    of_photographs = bool(fits) and not is_table(fits)
    for option, value in (("--ior", None if of_photographs else ior), ("--roughness", roughness)):
        if value is not None and target is None:
            raise InputError(f"{option} {value:g}", "only a material for an engine has it", "add --as, or leave it out")
    finish = _given_roughness(source) if roughness is None and target is not None else None
    finish = read_roughness(roughness, preset_name) if finish is None else finish
    wanted = _Wanted(target, ior, finish or 0.0, td_transmittance, as_json)
    if output is not None and batch is None:
        raise InputError(f"-o {output}", "only --batch writes a file", "leave it out")
    if eye is not None and model is None:
        raise InputError(f"--eye {eye}", "only --on looks at a model", "leave it out")
    if batch is not None:
        if td_transmittance is not None:
            raise InputError(f"--td-transmittance {td_transmittance:g}", "--batch tells no TD", "leave it out")
        if target is not None:
            raise InputError(f"--as {target}", "it takes one color, not --batch", "leave one of them out")
        return _batch(batch, output, unit, unit_out, clamp is not False)
    if not fits and (white is not None or patches):
        raise InputError("--white" if white is not None else "--patch", "only --fit PHOTO takes it", "add --fit PHOTO")
    if fits:
        if clamp:
            raise InputError("--clamp", "a sample made up would bend --fit", "leave rows with a channel of 0 out")
        found = fitted(fits, white, patches, ior, unit, unit_out)
        _tell(found.told, found.medium, found.distance, wanted)
        return None if as_json or target is not None else echo(found.report)
    medium = _given_medium(source, preset_name, unit) if td is None else _filament(td, unit, td_transmittance)
    if medium is None and (color is None or (distance is None and model is None)):
        missing, hint = ("'COLOR'", QUOTE_HINT) if color is None else ("'DISTANCE'", _distance_hint(color))
        raise click.MissingParameter(hint[:1].upper() + hint[1:], context, param_hint=missing, param_type="argument")
    frame = None if model is None else thickness_on(model, unit, eye, allow_outside)
    told, medium = _convert(medium, color, distance if td is None else td, frame, unit, unit_out, clamp is not False)
    stated = told["distance"]
    if model is not None and frame is not None:
        told["on"] = told_on(model, frame, medium)
        told["warnings"] += doubts_on(told["on"])
        # Without a distance of the user's own, an engine gets the color at the model's thickness.
        stated = stated if distance is not None else told["on"]["mean_thickness"]
    if ior is None and source is None and preset_name is None and target not in (None, *_WITHOUT_SURFACE):
        echo("note: its index of refraction is 1, which mirrors and bends nothing; for glass, --ior 1.5", err=True)
    return _tell(told, medium, stated, wanted)


def _check_usage(*groups: dict[str, object]) -> None:
    for group in groups:
        given = [name for name, value in group.items() if value is not None]
        if len(given) > 1:
            raise InputError(f"{given[1]} with {given[0]}", "each asks for something else", "give one of them")


def _distance_hint(color: str) -> str:
    """Advice on what to write instead of a name or a color alone."""
    from translucent.media.presets import presets

    if color in presets():
        return f"for the preset of this name write --preset {color}"
    return f"a color has a meaning only at a distance: translucent extinction '{color}' 1cm"


def _given_medium(source: str | None, preset_name: str | None, unit: str) -> Medium | None:
    from translucent.materials import load_medium

    return read_medium(None, None, preset_name) if source is None else load_medium(source, unit)


def _given_roughness(source: str | None) -> float | None:
    from translucent.materials import load_medium, load_roughness

    if source is None:
        return None
    load_medium(source)  # which tells what is wrong with the file
    return load_roughness(source)


def _filament(td: str, unit: str, transmittance: float | None) -> Medium:
    from translucent.media.filament import TD_TRANSMITTANCE, medium_of_td
    from translucent.units import parse_length

    return medium_of_td(parse_length(td, unit), TD_TRANSMITTANCE if transmittance is None else transmittance)


def _convert(
    medium: Medium | None,
    color: str | None,
    distance: str | None,
    frame: Frame | None,
    unit: str,
    unit_out: str,
    clamp: bool,
) -> tuple[dict[str, Any], Medium]:
    """Facts about a medium: a given one, one for a color at a distance, or one for a color on a model."""
    import numpy as np

    from translucent.frames.appearance import medium_for_average_color, thickness_samples
    from translucent.media.colors import parse_color
    from translucent.media.conversion import summary
    from translucent.media.medium import Medium, color_at
    from translucent.units import parse_length

    wanted, changes = clamped(color) if clamp and color is not None else (color or "", [])
    if distance is not None:
        metres = parse_length(distance, unit)
        if medium is None:
            medium, triple = Medium.from_color(wanted, metres), parse_color(wanted)
        else:
            triple, metres = color_at(medium, metres)
    else:
        thickness = np.empty(0) if frame is None else thickness_samples(frame)
        medium = medium or medium_for_average_color(thickness, wanted)
        # At the mean thickness of the model; without a model, or where that is black, where 1/e is left.
        near = None if medium.extinction.any() else 1.0
        triple, metres = color_at(medium, near if frame is None else float(thickness.mean()))
    told = summary(triple, metres, medium.extinction, unit_out)
    told["warnings"][:0] = changes
    return told, medium


def _tell(told: dict[str, Any], medium: Medium, stated: float, wanted: _Wanted) -> None:
    from translucent.media.filament import TD_TRANSMITTANCE, td_of

    share = TD_TRANSMITTANCE if wanted.td_transmittance is None else wanted.td_transmittance
    td = td_of(medium.extinction, share)
    told["transmission_distance"] = {"distance": td if math.isfinite(td) else None, "transmittance": share}
    if wanted.target is not None:
        from translucent.materials import text_block

        for line in told["warnings"]:
            echo(f"warning: {line}", err=True)
        if wanted.ior is not None:
            medium = dataclasses.replace(medium, ior=wanted.ior)
        color = medium.transmittance(stated)
        echo(text_block(wanted.target, medium, color, stated, roughness=wanted.roughness))
        return
    echo(json.dumps(told) if wanted.as_json else _report(told))


def _report(told: dict[str, Any]) -> str:
    from translucent.formulas.color import to_hex
    from translucent.media.swatches import terminal_strip

    distance, colors = told["distance"], told["transmittance"]
    lines = report_on(told["on"]) if "on" in told else []
    lines += [
        f"color           {triple_text(told['color'])} linear, {to_hex(told['color'])} sRGB, after {distance:g} m",
        f"extinction      {triple_text(told['extinction'])} 1/m",
    ]
    if told["unit"] != "m":
        lines.append(f"                {triple_text(told['extinction_per_unit'])} 1/{told['unit']}")
    lines += [
        f"mean free path  {triple_text(_infinite(told['mean_free_path']))} m",
        f"half-value      {triple_text(_infinite(told['half_value_thickness']))} m",
        f"                light has the color at {distance:g} m, 1/e (37 %) at a mean free path, half at a half-value",
        _td_line(told["transmission_distance"]),
    ]
    if takes_colors(sys.stdout):
        if "on" in told:
            parts = [told["on"]["average_color"], *(part["color"] for part in told["on"]["parts"])]
            lines.append(f"on the model    {terminal_strip(parts)}")
        lines.append(f"swatches        {terminal_strip(list(colors.values()))}")
    for factor, row in colors.items():
        lines.append(f"after {float(factor) * distance:<9.4g} m {triple_text(row)} linear, {to_hex(row)}")
    return "\n".join([*lines, *(f"warning         {line}" for line in told["warnings"])])


def _td_line(td: dict[str, float | None]) -> str:
    reached = "never" if td["distance"] is None else f"{1e3 * td['distance']:.5g} mm"
    left = 100.0 * (td["transmittance"] or 0.0)
    return f"filament TD     {reached}: where {left:g} % of the luminance of white light is left"


def _infinite(values: list[float | None]) -> list[float]:
    return [float("inf") if value is None else value for value in values]


def _batch(table: Path, output: Path | None, unit: str, unit_out: str, clamp: bool) -> None:
    from translucent.media.batch import check_batch_output, convert_table
    from translucent.media.conversion import CLAMP

    if output is not None:
        check_batch_output(output)
        refuse_overwriting(output, table)
    done = convert_table(table, unit, unit_out, clamp)
    if output is None:
        echo(done.to_json(), nl=False)
    else:
        done.write(output)
    if done.clamped:
        told = f"{done.clamped} of {len(done.records)} colors clamped to {CLAMP:g} where they were below"
        echo(f"warning: {told}; their warnings say so", err=True)
    for line in done.errors:
        echo(f"error: {line}", err=True)
    if done.errors:
        total = len(done.errors) + len(done.records)
        raise TranslucentError(
            f"{len(done.errors)} of {total} rows failed", f"the others are in {output or 'the output'}"
        )
