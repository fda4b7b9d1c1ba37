"""``translucent extinction``: from colors at distances or on a model, photographs, or a filament's TD to extinction."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from translucent.commands.console import echo, takes_colors
from translucent.commands.model import SceneRequest, read_scene
from translucent.commands.options import (
    CameraOptions,
    FileOptions,
    MediumOptions,
    clamp_option,
    clamped,
    outside_option,
    overwrite_option,
    refuse_overwriting,
    triple_text,
)
from translucent.commands.verbs import NamesOf, VerbCommand, option, takes
from translucent.errors import InputError, TranslucentError

if TYPE_CHECKING:
    from translucent.frames.frame import Frame
    from translucent.media.medium import Medium

#: Suffixes of tables to fit to; all else but .toml are pictures.
TABLES = (".csv", ".json")

#: Metres from which on a warning calls plates thick: millimetres without their unit.
_THICK = 0.3

#: Targets that draw no surface.
_WITHOUT_SURFACE = ("css", "json")

#: Pixels of the picture that is averaged; of the shape of the one that ``translucent render`` makes, and so framed.
SIZE = (640, 360)

#: Fraction of a channel's average beyond which the thin parts alone make its color.
MOST_THIN_SHARE = 0.5


@dataclass(frozen=True, kw_only=True)
class ExtinctionOptions:
    """Options of ``translucent extinction``."""

    unit: str = option("m", help="Unit of distances that are given without a unit, and of the coordinates of MODEL.")
    unit_out: str = option("m", metavar="U", help="Also print the extinction per this unit of length.")
    clamp: bool | None = clamp_option()
    target: str | None = option(
        names=("--as",),
        type=NamesOf("translucent.materials", "TARGETS"),
        help="Print the material for this engine.",
    )
    ior: float | None = option(
        metavar="N", help="With --as and --fit PHOTO: index of refraction. Default: the index of the medium, or 1."
    )
    roughness: float | None = option(
        type=click.FloatRange(0.0, 1.0),
        metavar="R",
        help=(
            "With --as: roughness of the surface, from 0 (polished) to 1. Default: the roughness of "
            "--preset or --from, or 0."
        ),
    )
    batch: Path | None = option(metavar="FILE", help="Convert a table with rows name,color,distance.")
    output: Path | None = option(names=("-o", "--output"), help="Output of --batch: a .json or .csv file.")
    fit: tuple[Path, ...] = option(
        (),
        metavar="FILE",
        help="Fit a medium to a .csv file with rows distance,color[,weight], to photographs of plates with "
        "--white and --patch, or to a .toml file of such photographs.",
    )
    white: str | None = option(
        metavar="X,Y,W,H",
        help="With --fit PHOTO: a rectangle of the photograph that shows only the light, in pixels.",
    )
    patch: tuple[str, ...] = option(
        (),
        metavar="X,Y,W,H=D",
        help=(
            "With --fit PHOTO: a rectangle of the photograph, and the thickness of the plate in this "
            "rectangle; for equally wide steps, X,Y,W,H=1mm,2mm,4mm; for a wedge, X,Y,W,H=1mm..8mm. May "
            "be repeated."
        ),
    )
    preset: str | None = option(metavar="NAME", help="Use a named medium.")
    source: str | None = option(
        names=("--from",),
        metavar="FILE",
        help="Read the medium from a .mtlx or .usda file, or from the saved output of --as.",
    )
    td: str | None = option(
        metavar="D",
        help="Transmission distance of a 3D printing filament: 4mm.",
    )
    td_transmittance: float | None = option(
        metavar="T",
        help="Fraction of light that is left after the transmission distance. Default: 0.1, T = 10^(-d/TD).",
    )
    model: str | None = option(
        names=("--on",),
        metavar="MODEL",
        help="Print the colors of the medium on this model, which is a file or a built-in mesh; see above.",
    )
    eye: str | None = option(
        metavar="X,Y,Z", help="With --on: position of the eye, in metres. Default: the same camera as in render."
    )
    overwrite: bool = overwrite_option()
    allow_outside: bool = outside_option()


@click.command(
    cls=VerbCommand,
    usual="unit target fit preset source td as_json",
    epilog="Example: translucent extinction '#7b1e3a' 1cm",
)
@click.argument("color", required=False)
@click.argument("distance", required=False)
@takes(ExtinctionOptions)
@click.pass_context
def extinction(
    context: click.Context, color: str | None, distance: str | None, given: ExtinctionOptions, as_json: bool
) -> None:
    """Compute the extinction of a medium from its color. The medium turns white light into COLOR after DISTANCE:
    sigma_t = -log(color) / distance.

    COLOR is '#7b1e3a', 7b1e3a, teal, 'srgb(.5,.1,.2)', 'linear(.2,.6,.3)' or a pixel of an image, photo.png@120,45.

    With --on MODEL and no DISTANCE, the result is the medium with which MODEL has COLOR on average, over its pixels in
    front of white light. With --on MODEL and a DISTANCE, --preset or --from, the result is the average color of MODEL
    filled with this medium.

    With --td D, the result is the gray medium of a filament with this transmission distance: translucent extinction
    --td 4mm. Almost no light passes a thickness of D. --td-transmittance sets the exact fraction.

    With --fit PHOTO, the result is the medium of plates in front of a light, with error bars. The reflection at the
    faces of the plates is computed from --ior: translucent extinction --fit steps.jpg --white 10,10,60,60 --patch
    90,10,400,60=1mm,2mm,4mm,8mm
    """
    from translucent.frames.appearance import appearance_of
    from translucent.media.colors import QUOTE_HINT
    from translucent.units import metres_per_unit

    metres_per_unit(given.unit_out)
    # Whoever prints gives millimetres.
    named = context.get_parameter_source("unit") is not click.core.ParameterSource.DEFAULT
    if given.td is not None and given.td[-1:].isdigit() and not named:
        given = dataclasses.replace(given, td=f"{given.td}mm")
    _check_usage(given, color, as_json)
    if given.batch is not None:
        return _convert_table(given.batch, given)
    if given.fit:
        fit, stated, reported, report = _fitted(given)
        _echo(reported, fit, stated, given, as_json)
        return None if as_json or given.target is not None else echo(report)
    medium = _given_medium(given)
    if medium is None and (color is None or (distance is None and given.model is None)):
        missing, hint = ("'COLOR'", QUOTE_HINT) if color is None else ("'DISTANCE'", _distance_hint(color))
        raise click.MissingParameter(hint[:1].upper() + hint[1:], context, param_hint=missing, param_type="argument")
    frame = _frame(given.model, given) if given.model is not None else None
    reported, medium = _converted(medium, color, distance if given.td is None else given.td, frame, given)
    stated = reported["distance"]
    if frame is not None:
        reported["on"] = {"model": given.model, **appearance_of(frame, medium).summary()}
        reported["warnings"] += [
            f"{fraction:.0%} of the average {name} comes from the thinnest 5 % of the pixels, at the edges"
            for name, fraction in zip(("red", "green", "blue"), reported["on"]["thin_share"], strict=True)
            if fraction > MOST_THIN_SHARE
        ]
        # Without a distance of the user's own, an engine gets the color at the model's thickness.
        stated = stated if distance is not None else reported["on"]["mean_thickness"]
    named = given.source is not None or given.preset is not None
    if given.ior is None and not named and given.target not in (None, *_WITHOUT_SURFACE):
        echo("note: its ior is 1, so its surface neither reflects nor refracts; for glass, add --ior 1.5", err=True)
    return _echo(reported, medium, stated, given, as_json)


def _check_usage(given: ExtinctionOptions, color: str | None, as_json: bool) -> None:
    """Raise `InputError` if options contradict each other, or lack an option that they need."""
    batch, fits = {"--batch": given.batch}, {"--fit": given.fit or None}
    media = {"COLOR": color, "--preset": given.preset, "--from": given.source, "--td": given.td}
    for rivals in (
        {**batch, **fits, **media},
        {**batch, **fits, "--on": given.model},
        {"--json": as_json or None, "--as": given.target},
    ):
        both = [name for name, value in rivals.items() if value is not None]
        if len(both) > 1:
            raise InputError(
                f"{both[1]} and {both[0]} exclude each other",
                "each of the two options computes a different result",
                "use only one of the two",
            )
    of_photographs = bool(given.fit) and not _is_table(given.fit)
    for name, value in (("--ior", None if of_photographs else given.ior), ("--roughness", given.roughness)):
        if value is not None and given.target is None:
            raise InputError(
                f"{name} {value:g}",
                "this option applies only to a material for an engine",
                "add --as, or omit the option",
            )
    if given.output is not None and given.batch is None:
        raise InputError(f"-o {given.output}", "only --batch writes an output file", "omit -o")
    if given.eye is not None and given.model is None:
        raise InputError(f"--eye {given.eye}", "only --on uses a view of a model", "omit --eye")
    if given.batch is not None and given.td_transmittance is not None:
        raise InputError(
            f"--td-transmittance {given.td_transmittance:g}",
            "--batch does not print a transmission distance",
            "omit --td-transmittance",
        )
    if given.batch is not None and given.target is not None:
        raise InputError(
            f"--as {given.target}", "--as converts a single color, but --batch converts many", "omit --as or --batch"
        )
    if not given.fit and (given.white is not None or given.patch):
        raise InputError(
            "--white" if given.white is not None else "--patch",
            "these options apply only to --fit PHOTO",
            "add --fit PHOTO",
        )
    if given.fit and given.clamp:
        raise InputError(
            "--clamp",
            "--clamp would replace measured zeros by invented values, which would falsify the fit",
            "remove the table rows that have a channel of 0",
        )


def _distance_hint(color: str) -> str:
    """Advice on what to write instead of a name or a color alone."""
    from translucent.media.presets import presets

    if color in presets():
        return f"{color} is a preset: write --preset {color}"
    return f"a color has a meaning only at a distance: translucent extinction '{color}' 1cm"


def _given_medium(given: ExtinctionOptions) -> Medium | None:
    """Medium of a filament, of a file, or of a preset, if one is named."""
    from translucent.materials import load_medium
    from translucent.media.conversion import TD_TRANSMITTANCE, extinction_of_td
    from translucent.media.medium import Medium
    from translucent.units import parse_length

    if given.td is not None:
        left = TD_TRANSMITTANCE if given.td_transmittance is None else given.td_transmittance
        return Medium(absorption=extinction_of_td(parse_length(given.td, given.unit), left))
    return MediumOptions(preset=given.preset).read() if given.source is None else load_medium(given.source, given.unit)


def _frame(model: str, given: ExtinctionOptions) -> Frame:
    """The model as ``translucent render`` shows it, all of it filled with one medium."""
    import translucent as tl

    file = FileOptions(unit=given.unit, allow_outside=given.allow_outside)
    # Any medium will do: only the thickness is looked at.
    filling, camera = tl.Medium(absorption=1.0), CameraOptions(eye=given.eye)
    scene = read_scene(model, SceneRequest(medium=filling, camera=camera, file=file, size=SIZE))
    with tl.Renderer() as renderer:
        return renderer.render(scene, SIZE)


def _converted(
    medium: Medium | None, color: str | None, distance: str | None, frame: Frame | None, given: ExtinctionOptions
) -> tuple[dict[str, Any], Medium]:
    """Facts about a medium: a given one, one for a color at a distance, or one for a color on a model."""
    import numpy as np

    from translucent.frames.appearance import medium_for_average_color, thickness_samples
    from translucent.media.colors import parse_color
    from translucent.media.conversion import summary
    from translucent.media.medium import Medium, color_at
    from translucent.units import parse_length

    requested, changes = clamped(color) if given.clamp is not False and color is not None else (color or "", [])
    if distance is not None:
        metres = parse_length(distance, given.unit)
        if medium is None:
            medium, triple = Medium.from_color(requested, metres), parse_color(requested)
        else:
            triple, metres = color_at(medium, metres)
    else:
        thickness = np.empty(0) if frame is None else thickness_samples(frame)
        medium = medium or medium_for_average_color(thickness, requested)
        # At the mean thickness of the model; without a model, or where that is black, where 1/e is left.
        near = None if medium.extinction.any() else 1.0
        triple, metres = color_at(medium, near if frame is None else float(thickness.mean()))
    reported = summary(triple, metres, medium.extinction, given.unit_out)
    reported["warnings"][:0] = changes
    return reported, medium


def _fitted(given: ExtinctionOptions) -> tuple[Medium, float, dict[str, Any], str]:
    """Fitted medium, the distance of its color, facts about it, and a report of the fit."""
    fits, photographed = given.fit, given.white is not None or bool(given.patch)
    described = _is_table(fits) or fits[0].suffix.lower() == ".toml"
    if described and len(fits) > 1:
        raise InputError(
            f"--fit {fits[1]}",
            f"--fit {fits[0]} is given, too, and only photographs can be combined",
            "give one table, one .toml file, or several photographs",
        )
    if described and photographed:
        requested = "--white" if given.white is not None else "--patch"
        raise InputError(
            requested,
            "this option applies only to a photograph",
            "omit the option, or write its value into the .toml file",
        )
    return _fitted_to_table(given) if _is_table(fits) else _fitted_to_photographs(given)


def _is_table(fits: tuple[Path, ...]) -> bool:
    """True if --fit names a table, as against photographs."""
    return any(one.suffix.lower() in TABLES for one in fits)


def _fitted_to_table(given: ExtinctionOptions) -> tuple[Medium, float, dict[str, Any], str]:
    import numpy as np

    from translucent.media.conversion import summary
    from translucent.media.fitting import fit_wedge

    fit = fit_wedge(given.fit[0], given.unit)
    distance = float(np.median(fit.distances))
    reported = summary(fit.medium.transmittance(distance), distance, fit.medium.extinction, given.unit_out)
    reported["warnings"][:0] = [f"{name} brightens with distance, so its extinction is 0" for name in fit.clipped]
    error = None if fit.standard_error is None else fit.standard_error.tolist()
    reported |= {"samples": len(fit.distances), "standard_error": error, "residuals": fit.residuals.tolist()}
    known = "unknown (a single sample)" if fit.standard_error is None else f"{triple_text(fit.standard_error)} 1/m"
    lines = [f"standard error  {known}", f"residuals of {len(fit.distances)} samples, log(color / fit):"]
    for metres, residual in zip(fit.distances, fit.residuals, strict=True):
        lines.append(f"at {metres:<12.4g} m {triple_text(residual)}")
    return fit.medium, distance, reported, "\n".join(lines)


def _fitted_to_photographs(given: ExtinctionOptions) -> tuple[Medium, float, dict[str, Any], str]:
    from translucent.frames.photographs import (
        Photograph,
        fit_photographs,
        parse_patches,
        parse_rectangle,
        read_photographs,
    )
    from translucent.media.conversion import summary
    from translucent.units import length_text

    if given.fit[0].suffix.lower() == ".toml":
        shots = read_photographs(given.fit[0], given.unit)
    else:
        if given.white is None or not given.patch:
            missing = "--white" if given.white is None else "--patch"
            do = "give the rectangles of the bare light, --white X,Y,W,H, and of the steps, --patch X,Y,W,H=1mm,2mm,4mm"
            raise InputError(f"--fit {given.fit[0]}", f"this fit also needs {missing}", do)
        listed = [patch for text in given.patch for patch in parse_patches(text, given.unit)]
        shots = [Photograph(one, parse_rectangle(given.white), listed) for one in given.fit]
    fit = fit_photographs(shots, given.ior)
    reported = summary(fit.medium.transmittance(fit.distance), fit.distance, fit.medium.extinction, given.unit_out)
    reported["warnings"][:0] = fit.warnings
    if fit.distance >= _THICK:
        doubt = "lengths without a unit are metres; for millimetres, add --unit mm"
        reported["warnings"].insert(0, f"the samples are about {length_text(fit.distance)} thick: {doubt}")
    reported |= {
        "samples": fit.samples.tolist(),
        "standard_error": fit.standard_error.tolist(),
        "interval": fit.interval.tolist(),
        "surface_loss": fit.surface_loss.tolist(),
        "chi2_per_degree": [None if value != value else value for value in fit.chi2_per_degree.tolist()],
    }
    samples = ", ".join(str(count) for count in fit.samples)
    report = [
        f"error bars      {triple_text(fit.interval)} 1/m (95 % confidence interval of the extinction)",
        f"reflected       {triple_text(100 * fit.surface_loss)} % is lost by reflection at the faces",
        f"scatter         {triple_text(fit.chi2_per_degree)} chi2 per degree of freedom (1 for noise alone)",
        f"from            {samples} patches in {len(shots)} photograph{'s' if len(shots) > 1 else ''}",
    ]
    return fit.medium, fit.distance, reported, "\n".join(report)


def _echo(reported: dict[str, Any], medium: Medium, stated: float, given: ExtinctionOptions, as_json: bool) -> None:
    """Print the facts about a medium, or its material for an engine, with its color stated at a distance."""
    from translucent.media.conversion import TD_TRANSMITTANCE, td_of

    left = TD_TRANSMITTANCE if given.td_transmittance is None else given.td_transmittance
    td = td_of(medium.extinction, left)
    reported["transmission_distance"] = {"distance": td if math.isfinite(td) else None, "transmittance": left}
    if given.target is None:
        return echo(json.dumps(reported) if as_json else _report(reported))
    from translucent.materials import load_medium, load_roughness, text_block

    for line in reported["warnings"]:
        echo(f"warning: {line}", err=True)
    roughness = MediumOptions(preset=given.preset).surface_roughness(given.roughness)
    if given.roughness is None and given.source is not None:
        load_medium(given.source)  # which reports what is wrong with the file
        roughness = load_roughness(given.source)
    if given.ior is not None:
        medium = dataclasses.replace(medium, ior=given.ior)
    return echo(text_block(given.target, medium, medium.transmittance(stated), stated, roughness=roughness or 0.0))


def _report(reported: dict[str, Any]) -> str:
    from translucent.formulas.color import to_hex
    from translucent.media.colors import terminal_strip

    distance, colors, td = reported["distance"], reported["transmittance"], reported["transmission_distance"]
    reached = "never" if td["distance"] is None else f"{1e3 * td['distance']:.5g} mm"
    color = reported["color"]
    lines = _appearance_lines(reported["on"]) if "on" in reported else []
    lines += [
        f"color           {triple_text(color)} linear, {to_hex(color)} sRGB, after {distance:g} m",
        f"extinction      {triple_text(reported['extinction'])} 1/m",
    ]
    if reported["unit"] != "m":
        lines.append(f"                {triple_text(reported['extinction_per_unit'])} 1/{reported['unit']}")
    lines += [
        f"mean free path  {triple_text(_infinite(reported['mean_free_path']))} m",
        f"half-value      {triple_text(_infinite(reported['half_value_thickness']))} m",
        f"                light has this color after {distance:g} m; a mean free path leaves 37 %, a half-value half",
        f"filament TD     {reached}: where {100.0 * td['transmittance']:g} % of the luminance of white light passes",
    ]
    if takes_colors(sys.stdout):
        if "on" in reported:
            parts = [reported["on"]["average_color"], *(part["color"] for part in reported["on"]["parts"])]
            lines.append(f"on the model    {terminal_strip(parts)}")
        lines.append(f"swatches        {terminal_strip(list(colors.values()))}")
    for factor, row in colors.items():
        lines.append(f"after {float(factor) * distance:<9.4g} m {triple_text(row)} linear, {to_hex(row)}")
    return "\n".join([*lines, *(f"warning         {line}" for line in reported["warnings"])])


def _appearance_lines(reported: dict[str, Any]) -> list[str]:
    """Lines of text about the appearance of a medium on a model."""
    lines = [
        f"on {reported['model']}: {reported['pixels']} pixels, {reported['mean_thickness']:.4g} m thick on average",
        f"average color   {triple_text(reported['average_color'])} linear, {reported['average_hex']} sRGB",
    ]
    for part in reported["parts"]:
        color = f"{triple_text(part['color'])} linear, {part['hex']}"
        lines.append(f"at {part['thickness']:<9.4g} m  {color}; {part['thinner']:.0%} of the model is thinner")
    return lines


def _infinite(values: list[float | None]) -> list[float]:
    return [float("inf") if value is None else value for value in values]


def _convert_table(table: Path, given: ExtinctionOptions) -> None:
    from translucent.media.conversion import CLAMP
    from translucent.media.presets import check_batch_output, convert_table

    output = given.output
    if output is not None:
        check_batch_output(output)
        refuse_overwriting(output, table)
    done = convert_table(table, given.unit, given.unit_out, given.clamp is not False)
    if output is None:
        echo(done.to_json(), nl=False)
    else:
        done.write(output)
    if done.clamped:
        reported = f"{done.clamped} of {len(done.records)} colors had channels below {CLAMP:g}, now {CLAMP:g}"
        echo(f"warning: {reported}; see the warnings of these rows", err=True)
    for line in done.errors:
        echo(f"error: {line}", err=True)
    if done.errors:
        total = len(done.errors) + len(done.records)
        raise TranslucentError(
            f"{len(done.errors)} of {total} rows failed", f"the others are in {output or 'the output'}"
        )
