"""A shader as one text for another engine: switches decided, constants and includes written out, nothing unused.

For Vulkan, and the translators that read its GLSL, loose uniforms are in a block, textures apart from samplers, and
everything has its place in one descriptor set: uniform blocks at their binding points, then loose uniforms, textures
and samplers, which each stage has for itself. Matrices are stored column by column, as engines do. Inputs and outputs
of stages have locations by their names, so that stages that were written out apart fit together.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, combinations
from typing import Literal, get_args

from translucent.assets import shader_names
from translucent.errors import InputError, close_names, did_you_mean
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import BLOCKS, UniformBlock
from translucent.gpu.shaders import DIRECTIVE, Gathered, decided_lines, gather, parts_of, reached, used_constants

#: GLSL of desktops, that of WebGL2, which is GLSL ES 3.00, and that of Vulkan.
Dialect = Literal["glsl", "webgl2", "vulkan"]

#: Switches that a value of another one needs, at most.
MOST_RAISED = 2

#: Identifiers that need a newer GLSL version.
_STORAGE = re.compile(r"\bstd430\b|\batomic\w+\s*\(")
_SAMPLER = re.compile(r"\b[iu]?sampler\w+")

#: Versions of GLSL: for all shaders, for shaders that write to buffers, for WebGL2, and for Vulkan.
PLAIN, WITH_STORAGE, ES, VULKAN = 330, 430, 300, 450


def _head(name: str, code: str, dialect: Dialect) -> tuple[int, list[str]]:
    """Version of GLSL that the code of a shader needs, without comments, and its first lines.

    Raises
    ------
    InputError
        If the code needs what the dialect lacks.
    """
    stores = _STORAGE.search(code) is not None
    precise = re.search(r"\bprecise\b", code) is not None
    origin = f"// translucent: shaders/{name}"
    if dialect == "glsl":
        version = WITH_STORAGE if stores else PLAIN
        extension = "#extension GL_ARB_gpu_shader5 : enable // for precise; leave both out elsewhere"
        return version, [f"#version {version} core", origin, *[extension] * precise]
    if stores:
        raise InputError(
            f"shader {name!r} for {'WebGL2' if dialect == 'webgl2' else 'other languages'}",
            (
                "the shader writes to buffers, which "
                f"{('WebGL2 has none of' if dialect == 'webgl2' else 'are not translated')}"
            ),
            "use a method without such shaders: signed_depth for sums, peel and peel_fold for sorted intervals",
        )
    if dialect == "vulkan":
        extension = "#extension GL_EXT_samplerless_texture_functions : require"
        return VULKAN, [f"#version {VULKAN} core", origin, *[extension] * ("texelFetch" in code)]
    # Fragment shaders have no precision by default, and most samplers a low one in both stages.
    samplers = sorted(set(_SAMPLER.findall(code)))
    highp = [f"precision highp {kind};" for kind in ("float", "int", *samplers)]
    define = "#define precise // not in GLSL ES: a driver may fuse products and sums"
    return ES, [f"#version {ES} es", origin, *highp, *[define] * precise]


#: Outputs of the vertex shaders of bodies, of the pass over pixels, of windows and of photons, each by location.
_OF_BODIES = (
    "axial",
    "world_normal",
    "from_eye",
    "from_center",
    "surface_uv",
    "vertex_color",
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
_OF_PHOTONS = ("irradiance", "parts", "own_texel")
_STAGES = (_OF_BODIES, _OF_PICTURES, _OF_WINDOWS, _OF_PHOTONS)
VARYINGS = {name: place for names in _STAGES for place, name in enumerate(names)}

#: Bindings of the loose uniforms of a stage, and of the first of its textures. Blocks are below.
LOOSE = {"frag": 14, "vert": 15}
FIRST_TEXTURE = {"frag": 16, "vert": 64}

_TEXTURE = re.compile(r"^uniform ([iu]?)sampler(\w+) (\w+);", re.MULTILINE)
_UNIFORM = re.compile(r"^uniform (\w+ \w+(?:\[[\w *]+\])?;.*)$", re.MULTILINE)
_VARYING = re.compile(r"^(flat )?(in|out) (\w+) (\w+);", re.MULTILINE)
_FETCH = r"\b(?:texelFetch|textureSize)\(\s*"


def in_vulkan(name: str, texts: Iterable[str], code: str) -> Iterator[str]:
    """Parts of a shader with their declarations as Vulkan wants them.

    Parameters
    ----------
    name : str
        File under ``shaders/``; its suffix names the stage, and what is no stage is taken for fragments.
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
        flat, qualifier, kind, name = match.groups()
        if self.stage == "vert" and qualifier == "in":
            place = self.attributes
            self.attributes += 1
        else:
            place = VARYINGS[name]
        return f"layout(location = {place}) {flat or ''}{qualifier} {kind} {name};"

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


_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform (\w+) \{", re.MULTILINE)


@dataclass(frozen=True)
class Lifted:
    """Shader text for use in another engine.

    Attributes
    ----------
    name : str
        File under ``shaders/``.
    dialect : {"glsl", "webgl2", "vulkan"}
    version : int
        Of GLSL that it needs.
    defines : dict of str to int
        By which its switches are decided.
    files : tuple of str
        Files that it has parts of.
    blocks : tuple of UniformBlock
        Uniform blocks in it.
    text : str
    """

    name: str
    dialect: Dialect
    version: int
    defines: Mapping[str, int]
    files: tuple[str, ...]
    blocks: tuple[UniformBlock, ...]
    text: str


def find_shader(name: str) -> str:
    """The shader file of this name, or of this stem if it is the only one: ``optics`` is ``lib/optics.glsl``.

    Raises
    ------
    InputError
        If there is none, or there are several.
    """
    known = shader_names()
    if name in known:
        return name
    files = {path: path.rpartition("/")[2] for path in known}
    stems = {path: file.partition(".")[0] for path, file in files.items()}
    found = [path for path in known if name in (files[path], stems[path])]
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(f"shader {name!r}", "several shader files have this name", f"use one of {', '.join(found)}")
    close = close_names(name, known) or close_names(name, dict.fromkeys(stems.values()))
    do = did_you_mean(close) if close else "'translucent shader' lists all shaders"
    raise InputError(f"shader {name!r}", "no shader has this name", do)


def switches(name: str) -> list[str]:
    """Switches of a shader file and of its includes, sorted."""
    return sorted(gather(name).switches)


def lift(name: str, defines: Mapping[str, int], target: Dialect = "glsl") -> Lifted:
    """Text of a shader, with its includes and constants written out.

    Parameters
    ----------
    name : str
        As `find_shader` gives it.
    defines : dict of str to int
        Values of its switches; those in parts that others leave out may be missing.
    target : {"glsl", "webgl2", "vulkan"}
        GLSL 3.30 core, or 4.30 where it writes to buffers; GLSL ES 3.00, which WebGL2 and OpenGL ES 3.0 take; or
        GLSL 4.50 for Vulkan (`translucent.gpu.lifting`), which translators to other languages read.

    Raises
    ------
    InputError
        If a switch is unknown or missing, the shader refuses the values, or it needs what the target lacks.
    """
    if target not in get_args(Dialect):
        raise InputError(f"target {target!r}", "no target has this name", f"use one of {', '.join(get_args(Dialect))}")
    gathered = gather(name)
    if unknown := sorted(defines.keys() - gathered.switches):
        known = ", ".join(sorted(gathered.switches))
        raise InputError(
            f"shader {name!r}",
            f"the shader has no switch {', '.join(unknown)}",
            f"use one of its switches: {known}" if known else "omit --define, because this shader has no switches",
        )
    missing: set[str] = set()
    parts = list(parts_of(decided_lines(name, gathered, defines, missing)))
    if missing:
        least = _raised(name, gathered, dict.fromkeys(gathered.switches, 0) | dict(defines), frozenset(defines))
        least = least or dict.fromkeys(missing, 1)
        options = " ".join(f"--define {key}={least[key]}" for key in sorted(missing))
        count = f"{len(missing)} {'switch' if len(missing) == 1 else 'switches'}"
        raise InputError(
            f"shader {name!r}", f"the shader needs {count} more switches", f"add {options}, or choose other values"
        )
    kept = reached(parts)
    used = set().union(*(part.names for part in kept))
    texts = [part.text.strip("\n") for part in kept]
    code = "\n".join(part.code for part in kept)
    version, head = _head(name, code, target)
    body = "\n\n".join(in_vulkan(name, texts, code) if target == "vulkan" else texts)
    decided = {key: int(value) for key, value in defines.items()}
    defined = [f"#define {key} {value}" for key, value in decided.items() if key in used]
    defined += [f"#define {key} {CONSTANTS[key]}" for key in used_constants(used)]
    files = tuple(dict.fromkeys(gathered.files[part.file] for part in kept))
    blocks = tuple(BLOCKS[key] for key in _BLOCK.findall(code))
    text = "\n".join([*head, *defined, "", body, ""])
    return Lifted(name, target, version, decided, files, blocks, text)


def valid_sets(name: str) -> list[dict[str, int]]:
    """Sets of switches that a shader accepts, each with a value for all of them.

    The first has as many of them off as the shader allows. Each other one has another value of one switch, and raises
    only what that value needs.
    """
    gathered = gather(name)
    conditions = [match[2] for line in gathered.lines if (match := DIRECTIVE.match(line))]
    choices = {
        key: sorted({0, 1, *(int(n) for text in conditions for n in re.findall(rf"\b{key} == (\d+)", text))})
        for key in sorted(gathered.switches)
    }
    least = _raised(name, gathered, dict.fromkeys(choices, 0), frozenset())
    found = [least] if least is not None else []
    for key, value in ((key, value) for key, values in choices.items() for value in values):
        if least is not None and value != least[key]:
            found += filter(None, [_raised(name, gathered, least | {key: value}, frozenset([key]))])
    return found


def _raised(name: str, gathered: Gathered, values: Mapping[str, int], kept: frozenset[str]) -> dict[str, int] | None:
    """Values that a shader accepts, with as few others at 1 as it takes; None if a few do not suffice."""
    others = [key for key, value in values.items() if value == 0 and key not in kept]
    tried = (combinations(others, count) for count in range(MOST_RAISED + 1))
    sets = ({**values, **dict.fromkeys(raised, 1)} for raised in chain.from_iterable(tried))
    return next((one for one in sets if _accepted(name, gathered, one)), None)


def _accepted(name: str, gathered: Gathered, values: Mapping[str, int]) -> bool:
    """True if no line of a shader that is left with these values refuses them."""
    try:
        deque(decided_lines(name, gathered, values, set()), maxlen=0)
    except InputError:
        return False
    return True
