"""UsdShade: a material with an OpenPBR surface, as .usda text, written and read.

UsdPreviewSurface has neither transmission nor volume, so the material is a MaterialX network of one node,
``ND_open_pbr_surface_surfaceshader``; ``ND_standard_surface_surfaceshader`` is read, too. The inputs are those of
`translucent.materials.materialx`, with its formulas, source and losses; lengths are in the layer's ``metersPerUnit``,
written as 1, and 0.01 where a layer states none.
Source: OpenUSD, the .usda file format, UsdShade, UsdGeom (stage metrics).

Read is one layer of text, without what it refers to: no composition, no variants, no binary .usdc.

The reader is not OpenUSD's own (`Sdf.Layer.ImportFromString` of usd-core 26.11), which does not bear hostile text:
20000 nested prims, 240 kB and valid, end the process (SIGSEGV); 20 kB of opening parentheses make an error message of
205 MB in 1.3 GB of memory, and both grow as the square; whole numbers that are too long are printed to stderr from
C++. A check of the depth beforehand would need the tokens of this file. It also makes a float32 of each input,
1.6000000238 of an ior of 1.6, where this reader returns the number that is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError
from translucent.materials.materialx import (
    OPENPBR,
    STANDARD_SURFACE,
    SurfaceShader,
    medium_of,
    parse_value,
    transmission_inputs,
)
from translucent.materials.target import ExportTarget
from translucent.media.medium import Medium

_SHADERS = {f"ND_{shader.node}_surfaceshader": shader for shader in (OPENPBR, STANDARD_SURFACE)}
_SPACES = {"lin_rec709_scene": "lin_rec709", "raw": "none", "srgb_rec709_scene": "srgb_texture"}
_CENTIMETER = 0.01

# Strings of four kinds, then comments, then paths and assets, whose signs mean nothing, then signs and words. What is
# never closed ends with the text: each character is looked at once, whatever the text.
_TOKENS = re.compile(
    r"""('{3}(?:\\.|[^\\])*?(?:'{3}|\\?\Z)|"{3}(?:\\.|[^\\])*?(?:"{3}|\\?\Z)"""
    r"""|'(?:\\.|[^'\\])*+(?:'|\\?\Z)|"(?:\\.|[^"\\])*+(?:"|\\?\Z))"""
    r"""|\#[^\n]*|<[^>]*+(?:>|\Z)|@[^@]*+(?:@|\Z)|([(){}\[\]=,;]|[^\s(){}\[\]=,;"'\#<@]+)""",
    re.DOTALL,
)
#: Largest depth of nested braces.
_MAX_DEPTH = 100


def usda_text(medium: Medium, distance: float | None = None, roughness: float = 0.0) -> str:
    """Write a .usda layer with one material; the color is stated at `distance` in metres, see `color_at`."""
    lines = []
    for key, value in transmission_inputs(OPENPBR, medium, distance, roughness=roughness).items():
        if isinstance(value, float):
            lines.append(f"        float inputs:{key} = {value!r}")
        else:
            text = ", ".join(repr(channel) for channel in np.asarray(value).tolist())
            lines.append(f"        color3f inputs:{key} = ({text})")
    inputs = "\n".join(lines)
    return f"""#usda 1.0
(
    defaultPrim = "translucent"
    metersPerUnit = 1
    upAxis = "Y"
)

def Material "translucent"
{{
    token outputs:mtlx:surface.connect = </translucent/surface.outputs:out>

    def Shader "surface"
    {{
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
{inputs}
        token outputs:out
    }}
}}
"""


@dataclass
class _Block:
    """Block of text between two braces, as the reader keeps it."""

    identifier: str = ""
    #: Texts of the parts of a value, and its color space.
    inputs: dict[str, tuple[list[str], str]] = field(default_factory=dict)
    #: Inputs that are not constants.
    varying: set[str] = field(default_factory=set)


def read_usda(text: str, _: str = "m") -> Medium:
    """Read the medium of the first OpenPBR or Standard Surface shader in a .usda layer.

    Raises
    ------
    InputError
        If the text is no such layer, has no such shader, or its inputs are out of range or not constant.
    """
    if not text.startswith("#usda"):
        raise InputError(
            "USD layer", "the file is not .usda text", "convert the file, for example with usdcat -o out.usda FILE"
        )
    tokens = [match[1] or match[2] for match in _TOKENS.finditer(text) if match[1] or match[2]]
    metres = _CENTIMETER
    if "metersPerUnit" in tokens[:-2]:
        metres = float(parse_value("USD layer", "metersPerUnit", [tokens[tokens.index("metersPerUnit") + 2]], 1.0, ""))
        if not metres > 0:
            raise InputError("USD layer", f"metersPerUnit is {metres:g}", "correct metersPerUnit, for example to 0.01")
    for block in _blocks(tokens):
        if shader := _SHADERS.get(block.identifier):
            return medium_of(shader, dict(_stated(shader, block)), metres)
    raise InputError(
        "USD layer", f"the file has no shader {' or '.join(_SHADERS)}", "export a MaterialX surface of this type"
    )


def _blocks(tokens: list[str]) -> Iterator[_Block]:
    """The blocks of a layer, in the order in which they end."""
    stack, index = [_Block()], 0
    while index < len(tokens):
        token, following = tokens[index], tokens[index + 1 : index + 3]
        index += 1
        if token == "{":
            if len(stack) > _MAX_DEPTH:
                raise InputError(
                    "USD layer", f"the file has more than {_MAX_DEPTH} levels of braces", "export the file again"
                )
            stack.append(_Block())
        elif token == "}" and len(stack) > 1:
            yield stack.pop()
        elif token == "info:id" and following[:1] == ["="]:
            stack[-1].identifier = following[-1].strip("\"'")
        elif token.startswith("inputs:") and following[:1] == ["="]:
            name, _, aspect = token.removeprefix("inputs:").partition(".")
            if aspect:  # a connection, or values over time
                stack[-1].varying.add(name)
                continue
            parts, index = _list(tokens, index + 1)
            metadata, index = _list(tokens, index) if tokens[index : index + 1] == ["("] else ([], index)
            space = metadata[metadata.index("colorSpace") + 2] if "colorSpace" in metadata[:-2] else "lin_rec709"
            stack[-1].inputs[name] = parts, space.strip("\"'")


def _list(tokens: list[str], index: int) -> tuple[list[str], int]:
    """Tokens of a value from a position on, without parentheses and commas, and the position of their end."""
    if tokens[index : index + 1] != ["("]:
        return tokens[index : index + 1], index + 1
    try:
        end = tokens.index(")", index)
    except ValueError:
        end = len(tokens)
    return [token for token in tokens[index + 1 : end] if token != ","], end + 1


def _stated(shader: SurfaceShader, block: _Block) -> Iterator[tuple[str, float | npt.NDArray[np.float64]]]:
    what = f"{shader.title} shader of a USD layer"
    for key, default in shader.defaults().items():
        if key in block.varying:
            raise InputError(
                what, f"{key} is connected to a node or changes with time", "give this input a constant value"
            )
        if key in block.inputs:
            parts, space = block.inputs[key]
            yield key, parse_value(what, key, parts, default, _SPACES.get(space, space))


def _roughness(text: str) -> float:
    found = re.search(rf"inputs:{OPENPBR.roughness}(\.connect)?\s*=\s*([-+.\deE]*)", text)
    if found is None:
        return (OPENPBR if f"ND_{OPENPBR.node}" in text else STANDARD_SURFACE).default_roughness
    return float(found[2] or 0.0)


USD = ExportTarget(
    "USD",
    lambda medium, distance, roughness: usda_text(medium, distance, roughness=roughness),
    ".usda",
    read_usda,
    _roughness,
)
