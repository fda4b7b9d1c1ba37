"""``translucent shader``: the GLSL of the toolkit, to be used elsewhere."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from translucent.commands.common import common_options
from translucent.commands.console import echo
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.gpu.dialects import Dialect


@click.command(epilog="Example: translucent shader signed_depth --define OPAQUE=0 --define SPECTRAL=0")
@click.argument("name", required=False)
@click.option("--define", "defines", multiple=True, metavar="X=1", help="Value of a switch, once for each that it has.")
@click.option(
    "--target",
    type=click.Choice(["glsl", "webgl2"]),
    default="glsl",
    show_default=True,
    help="Language to write it in.",
)
@common_options
def shader(name: str | None, defines: tuple[str, ...], target: Dialect, as_json: bool) -> None:
    """Print the shader NAME as one text, with its constants and includes in place and without what it does not use.

    NAME is a file under shaders/, or its name alone where no other has it. Without NAME, all are listed, with the
    switches that they ask for.
    """
    from translucent.gpu.lifting import find_shader, lift

    given = dict(map(_define, defines))
    if name is None:
        if given:
            raise InputError(f"--define {defines[0]}", "no shader is named", "add its NAME")
        return _list(as_json)
    lifted = lift(find_shader(name), given, target)
    if not as_json:
        return echo(lifted.text, nl=False)
    told = {
        "name": lifted.name,
        "target": target,
        "version": lifted.version,
        "defines": lifted.defines,
        "files": lifted.files,
    }
    return echo(json.dumps({**told, "text": lifted.text}))


def _list(as_json: bool) -> None:
    from translucent.assets import shader_names
    from translucent.gpu.lifting import switches

    found = {name: switches(name) for name in shader_names()}
    if as_json:
        rows = [{"name": name, "switches": asked} for name, asked in found.items()]
        return echo(json.dumps({"shaders": rows}))
    wide = max(map(len, found))
    for name, asked in found.items():
        echo(f"{name:<{wide}}  {' '.join(asked)}".rstrip())
    return None


def _define(text: str) -> tuple[str, int]:
    """Parse a switch and its value; one without a value is on."""
    key, equals, value = text.partition("=")
    if not (key.isidentifier() and (value.isdecimal() if equals else True)):
        raise InputError(f"--define {text!r}", "not a name with a whole number", "write for example --define OPAQUE=0")
    return key, int(value) if equals else 1
