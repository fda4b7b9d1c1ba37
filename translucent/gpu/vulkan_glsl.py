"""Declarations of a shader as Vulkan wants them, which is what translators to other languages read.

Loose uniforms are in a block, textures apart from samplers, and everything has its place in one descriptor set: uniform
blocks at their binding points, then loose uniforms, textures and samplers, which each stage has for itself. Matrices
are stored column by column, as engines do. Inputs and outputs of stages have locations by their names, so that stages
that were written out apart fit together.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from translucent.gpu.layout import BLOCKS

#: Outputs of the vertex shaders of bodies, of the pass over pixels, and of pictures in windows, each by location.
_OF_BODIES = (
    "axial",
    "world_normal",
    "from_eye",
    "from_center",
    "surface_uv",
    "vertex_color",
    "irradiance",
    "counting",
    "to_axial_depth",
    "medium_of_body",
)
_OF_PICTURES = (
    "frame_size",
    "ray_right",
    "ray_up",
    "ray_forward",
    "extinction",
    "emission",
    "balance",
    "beyond",
    "seen_first",
    "seen_second",
    "seen_other",
    "first_extinction",
    "second_extinction",
    "third_extinction",
    "span",
    "corner_and_ahead",
)
_OF_WINDOWS = ("place",)
VARYINGS = {name: place for names in (_OF_BODIES, _OF_PICTURES, _OF_WINDOWS) for place, name in enumerate(names)}

#: Bindings of the loose uniforms of a stage, and of the first of its textures. Blocks are below.
LOOSE = {"frag": 14, "vert": 15}
FIRST_TEXTURE = {"frag": 16, "vert": 64}

_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform (\w+) \{", re.MULTILINE)
_TEXTURE = re.compile(r"^uniform ([iu]?)sampler(\w+) (\w+);", re.MULTILINE)
_UNIFORM = re.compile(r"^uniform (\w+ \w+(?:\[\w+\])?;.*)$", re.MULTILINE)
_VARYING = re.compile(r"^(flat )?(in|out) (\w+) (\w+);", re.MULTILINE)
_FETCH = r"\b(?:texelFetch|textureSize)\(\s*"


def in_vulkan(name: str, texts: Iterable[str], code: str) -> Iterator[str]:
    """Parts of a shader with their declarations as Vulkan wants them.

    Parameters
    ----------
    name : str
        File under ``shaders/``; its end tells the stage, and what is no stage is taken for fragments.
    texts : iterable of str
        Parts, with comments.
    code : str
        All of it, without comments.
    """
    stage = "vert" if name.endswith(".vert") else "frag"
    texts = list(texts)
    loose = [match[1] for text in texts for match in _UNIFORM.finditer(text) if not _TEXTURE.match(match[0])]
    places = _Places(stage, code)
    for text in texts:
        text = _BLOCK.sub(places.block, text)
        text = _VARYING.sub(places.varying, text)
        text = _TEXTURE.sub(places.texture, text)
        if _UNIFORM.search(text):
            # All of them stand where the first one stood.
            members = "".join(f"    {one}\n" for one in loose)
            block = f"layout(std140, set = 0, binding = {LOOSE[stage]}) uniform Loose {{\n{members}}};"
            text = _UNIFORM.sub(lambda _: block, text, count=1) if loose else text  # noqa: B023
            text = _UNIFORM.sub("", text).strip("\n")
            loose = []
        if text:
            yield text.replace("gl_VertexID", "gl_VertexIndex")


class _Places:
    """Places where the declarations of one shader go."""

    def __init__(self, stage: str, code: str) -> None:
        self.stage = stage
        self.code = code
        self.textures = FIRST_TEXTURE[stage]
        self.attributes = 0

    def block(self, match: re.Match[str]) -> str:
        """First line of a uniform block."""
        return f"layout(std140, set = 0, binding = {BLOCKS[match[1]].binding}) uniform {match[1]} {{"

    def varying(self, match: re.Match[str]) -> str:
        """An input of a vertex shader in order of appearance, or what stages hand on by its name."""
        flat, way, kind, name = match.groups()
        if self.stage == "vert" and way == "in":
            place = self.attributes
            self.attributes += 1
        else:
            place = VARYINGS[name]
        return f"layout(location = {place}) {flat or ''}{way} {kind} {name};"

    def texture(self, match: re.Match[str]) -> str:
        """A texture, and a sampler where more than single texels are read."""
        prefix, shape, name = match.groups()
        first = self.textures
        self.textures += 2
        if len(re.findall(rf"\b{name}\b", self.code)) == 1 + len(re.findall(rf"{_FETCH}{name}\b", self.code)):
            return f"layout(set = 0, binding = {first}) uniform {prefix}texture{shape} {name};"
        return (
            f"layout(set = 0, binding = {first}) uniform {prefix}texture{shape} {name}_image;\n"
            f"layout(set = 0, binding = {first + 1}) uniform sampler {name}_sampler;\n"
            f"#define {name} {prefix}sampler{shape}({name}_image, {name}_sampler)"
        )
