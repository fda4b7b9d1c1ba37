"""The head of a lifted shader: its version of GLSL, and what that version has to be told."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

from translucent.errors import InputError

#: GLSL of desktops, that of WebGL2, which is GLSL ES 3.00, and that of Vulkan.
Dialect = Literal["glsl", "webgl2", "vulkan"]

#: Identifiers that need a newer GLSL version.
_STORAGE = re.compile(r"\bstd430\b|\batomic\w+\s*\(")
_SAMPLER = re.compile(r"\b[iu]?sampler\w+")

#: Versions of GLSL: for all shaders, for those that write to buffers, for WebGL2, and for Vulkan.
PLAIN, WITH_STORAGE, ES, VULKAN = 330, 430, 300, 450


@dataclass(frozen=True)
class Head:
    """First lines of a shader.

    Attributes
    ----------
    version : int
        Of GLSL that the code needs.
    lines : tuple of str
    """

    version: int
    lines: tuple[str, ...]


def check_dialect(dialect: str) -> None:
    """Refuse what is no dialect.

    Raises
    ------
    InputError
        Naming those that there are.
    """
    if dialect not in get_args(Dialect):
        raise InputError(f"target {dialect!r}", "unknown", f"use one of {', '.join(get_args(Dialect))}")


def head_of(name: str, code: str, dialect: Dialect) -> Head:
    """First lines for the code of a shader.

    Parameters
    ----------
    name : str
        File under ``shaders/``.
    code : str
        Without comments.
    dialect : {"glsl", "webgl2", "vulkan"}

    Raises
    ------
    InputError
        If the code needs what the dialect lacks.
    """
    stores = _STORAGE.search(code) is not None
    precise = re.search(r"\bprecise\b", code) is not None
    told = f"// translucent: shaders/{name}"
    if dialect == "glsl":
        version = WITH_STORAGE if stores else PLAIN
        asked = ["#extension GL_ARB_gpu_shader5 : enable // for precise; leave both out elsewhere"] if precise else []
        return Head(version, (f"#version {version} core", told, *asked))
    if stores:
        raise InputError(
            f"shader {name!r} for {'WebGL2' if dialect == 'webgl2' else 'other languages'}",
            f"it writes to buffers, which {'WebGL2 has none of' if dialect == 'webgl2' else 'are not translated'}",
            "use the shaders of a method that does not: signed_depth for sums, peel and peel_fold for ordered segments",
        )
    if dialect == "vulkan":
        asked = ["#extension GL_EXT_samplerless_texture_functions : require"] if "texelFetch" in code else []
        return Head(VULKAN, (f"#version {VULKAN} core", told, *asked))
    # Fragment shaders have no precision by default, and most samplers a low one in both stages.
    samplers = sorted(set(_SAMPLER.findall(code)))
    highp = [f"precision highp {kind};" for kind in ("float", "int", *samplers)]
    asked = ["#define precise // not in GLSL ES: a driver may fuse products and sums"] if precise else []
    return Head(ES, (f"#version {ES} es", told, *highp, *asked))
