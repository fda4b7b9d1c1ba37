"""What the verbs share: options, and reading what they were given."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.frame import Frame
    from translucent.lights import Environment
    from translucent.medium import Medium
    from translucent.thickness import Method

#: Below this mean share of light a picture shows little but black.
NEARLY_BLACK = 0.02

F = TypeVar("F", bound=Callable[..., Any])


def common_options(command: F) -> F:
    """Options of every verb."""
    command = click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")(command)
    return click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")(command)


def medium_options(command: F) -> F:
    """Options that choose a medium."""
    command = click.option("--preset", "preset_name", metavar="NAME", help="A named medium, such as merlot.")(command)
    command = click.option("--distance", metavar="D", help="Distance at which light has the color: 2cm, 0.8in.")(
        command
    )
    return click.option("--color", metavar="C", help="Transmitted color: '#7b1e3a', salmon, 'linear(.18,.62,.35)'.")(
        command
    )


def unit_option(command: F) -> F:
    """Option for the unit of a file."""
    return click.option(
        "--unit", default="m", show_default=True, metavar="U", help="Unit of the file's coordinates: mm, cm, in, ..."
    )(command)


def read_medium(color: str | None, distance: str | None, preset_name: str | None) -> Medium | None:
    """The medium that the options choose, if they do."""
    from translucent.medium import Medium
    from translucent.presets import preset
    from translucent.units import parse_length

    if preset_name is not None:
        if color is not None or distance is not None:
            raise InputError(f"--preset {preset_name}", "--color or --distance is given, too", "give one or the other")
        chosen = preset(preset_name)
        if chosen.warning:
            click.echo(f"warning: {chosen.warning}", err=True)
        return chosen.medium
    if (color is None) != (distance is None):
        given, missing = ("--color", "--distance") if distance is None else ("--distance", "--color")
        raise InputError(given, f"{missing} is missing", "give both: a color has a meaning only at a distance")
    return None if color is None or distance is None else Medium.from_color(color, parse_length(distance))


def read_method(name: str | None, thickness: str | None) -> Method | None:
    """The thickness method of this name, if there is one."""
    from translucent.thickness import ThinLayer, method_from_name
    from translucent.units import parse_length

    method = method_from_name(name) if name else None
    if thickness is None:
        return method
    if not isinstance(method, ThinLayer):
        raise InputError("--thickness", "only --method thin-layer takes it", "add --method thin-layer")
    return ThinLayer(parse_length(thickness))


def read_environment(background: str) -> Environment | None:
    """The background of this name or color; None is the showcase's own."""
    from translucent.lights import Environment

    if background == "studio":
        return None
    if background == "checkerboard":
        return Environment.checkerboard(tiles=12)
    return Environment.constant(background)


def read_size(text: str) -> tuple[int, int]:
    """Width and height of an option."""
    from translucent.camera import check_size

    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--size {text!r}", "not WxH", "write for example --size 1280x720") from None
    return check_size((width, height))


def triple_text(values: Any) -> str:
    """Three numbers, aligned."""
    return " ".join(f"{value:10.5g}" for value in values)


def warn_if_black(frame: Frame) -> None:
    """Say so where hardly any light passes: most often the file's unit is not what it was taken for."""
    seen = frame.coverage & frame.valid
    if seen.any() and (passed := float(frame.transmittance[seen].mean())) < NEARLY_BLACK:
        metres = float(frame.summary()["thickness"]["median"])
        click.echo(
            f"warning: only {passed:.2%} of the light passes, at a median thickness of {metres:.3g} m; "
            "check --unit, or take a longer --distance",
            err=True,
        )
