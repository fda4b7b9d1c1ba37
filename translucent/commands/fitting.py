"""``translucent extinction --fit``: to a table of colors at distances, or to photographs of known thickness."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from translucent.commands.common import triple_text
from translucent.errors import InputError

if TYPE_CHECKING:
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
