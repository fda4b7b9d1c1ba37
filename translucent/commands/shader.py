"""``translucent shader``: the shaders of the toolkit, to be used elsewhere."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from translucent.commands.common import common_options
from translucent.commands.console import echo
from translucent.errors import InputError

if TYPE_CHECKING:
    from translucent.commands.translating import Language
    from translucent.gpu.dialects import Dialect
    from translucent.gpu.std140 import UniformBlock


@click.command(epilog="Example: translucent shader signed_depth --define OPAQUE=0 --define SPECTRAL=0 --target webgl2")
@click.argument("name", required=False)
@click.option("--define", "defines", multiple=True, metavar="X=1", help="Value of a switch, once for each that it has.")
@click.option(
    "--target",
    type=click.Choice(["glsl", "webgl2", "vulkan", "hlsl", "msl", "wgsl"]),
    default="glsl",
    show_default=True,
    help="Language to write it in.",
)
@common_options
def shader(name: str | None, defines: tuple[str, ...], target: Dialect | Language, as_json: bool) -> None:
    """Print the shader NAME as one text, with its constants and includes in place and without what it does not use.

    NAME is a file under shaders/, or its name alone where no other has it. Without NAME, all are listed, with the
    switches that they ask for.

    glsl is that of OpenGL 3.3, webgl2 that of WebGL2 and OpenGL ES 3.0, vulkan that of Vulkan. hlsl, msl (Metal) and
    wgsl (WebGPU) are made from the last by translators, which have to be installed: glslang and SPIRV-Cross, or naga.
    """
    from translucent.commands.translating import translate
    from translucent.gpu.lifting import find_shader, lift

    given = dict(map(_define, defines))
    if name is None:
        if given or target != "glsl":
            option = f"--define {defines[0]}" if defines else f"--target {target}"
            raise InputError(option, "no shader is named", "add its NAME")
        return _list(as_json)
    found = find_shader(name)
    if target == "hlsl" or target == "msl" or target == "wgsl":
        translated = translate(found, given, target)
        lifted, text, version = translated.lifted, translated.text, None
    else:
        lifted = lift(found, given, target)
        text, version = lifted.text, lifted.version
    if not as_json:
        return echo(text, nl=False)
    told = {
        "name": lifted.name,
        "target": target,
        "version": version,
        "defines": lifted.defines,
        "files": lifted.files,
        "blocks": [_placed(block) for block in lifted.blocks],
        "text": text,
    }
    return echo(json.dumps(told))


def _placed(block: UniformBlock) -> dict[str, object]:
    """Binding of a uniform block, and the places of its members in it."""
    fields = block.dtype.fields
    assert fields is not None
    offsets = {name: place for name, (_, place, *_) in fields.items()}
    return {"name": block.name, "binding": block.binding, "bytes": block.dtype.itemsize, "offsets": offsets}


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
