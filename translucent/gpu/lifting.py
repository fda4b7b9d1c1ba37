"""A shader as one text for another engine: switches decided, constants and includes written out, nothing unused.

The parts of a text are its top-level declarations, told apart by braces and semicolons. What is reached from ``main``,
or in a library from the functions of the file itself, stays, and with it whatever shares a name with it: a name that is
used for two things keeps both, so nothing that is needed can get lost.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from translucent.assets import shader_names
from translucent.errors import InputError, close_names, did_you_mean
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.dialects import Dialect, check_dialect, head_of
from translucent.gpu.layout import BLOCKS
from translucent.gpu.shaders import Gathered, gather
from translucent.gpu.std140 import UniformBlock
from translucent.gpu.vulkan_glsl import in_vulkan

_NAME = re.compile(r"[A-Za-z_]\w*")
_COMMENT = re.compile(r"//.*")
_FUNCTION = re.compile(r"[\w\s\[\]]*?\b(\w+)\s*\([^;{]*\)\s*\{")
#: GLSL keywords and types, which no declaration can have as its name.
_MACRO = re.compile(r"\s*#define (\w+)")
_WORDS = re.compile(
    r"[iub]?vec[234]|mat[234](x[234])?|float|u?int|bool|void|[iu]?sampler\w+|const|uniform|buffer|struct|layout|std140|"
    r"std430|row_major|binding|location|define|if|else|for|while|return|in|out|inout|flat|\d\w*"
)
_LINE = re.compile(r"#line \d+ (\d+)$")
_BLOCK = re.compile(r"^layout\(std140, row_major\) uniform (\w+) \{", re.MULTILINE)
_DIRECTIVE = re.compile(r"\s*#\s*(if|elif|else|endif|error)\b(.*)$")


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
        Those of which something is in it.
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


@dataclass
class _Part:
    """Part of a shader: a top-level declaration with the comment above it, or a comment that stands alone."""

    file: int
    text: str
    code: str

    @property
    def function(self) -> str | None:
        """Name of the function that the part defines."""
        match = _FUNCTION.match(self.code.strip())
        return None if match is None else match[1]

    @property
    def names(self) -> set[str]:
        """All names in the part."""
        return {name for name in _NAME.findall(self.code) if not _WORDS.fullmatch(name)}

    @property
    def declares(self) -> set[str]:
        """Names that other parts may need from it: that of a function or macro, or any name in the part."""
        if macro := _MACRO.match(self.code):
            return {macro[1]}
        return self.names if self.function is None else {self.function}


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
        raise InputError(f"shader {name!r}", "several files are called so", f"use one of {', '.join(found)}")
    close = close_names(name, known) or close_names(name, dict.fromkeys(stems.values()))
    do = did_you_mean(close) if close else "'translucent shader' lists all"
    raise InputError(f"shader {name!r}", "no such shader", do)


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
        GLSL 4.50 for Vulkan (`translucent.gpu.vulkan_glsl`), which translators to other languages read.

    Raises
    ------
    InputError
        If a switch is unknown or missing, the shader refuses the values, or it needs what the target lacks.
    """
    check_dialect(target)
    gathered = gather(name)
    if unknown := sorted(defines.keys() - gathered.switches):
        known = ", ".join(sorted(gathered.switches)) or "it has none"
        raise InputError(f"shader {name!r}", f"no switch {', '.join(unknown)} is in it", f"switches: {known}")
    parts = list(_parts(_decided(name, gathered, defines)))
    kept = _reached(parts)
    used = set().union(*(part.names for part in kept))
    texts = [part.text.strip("\n") for part in kept]
    code = "\n".join(part.code for part in kept)
    head = head_of(name, code, target)
    body = "\n\n".join(in_vulkan(name, texts, code) if target == "vulkan" else texts)
    decided = {key: int(value) for key, value in defines.items()}
    defined = [f"#define {key} {value}" for key, value in decided.items() if key in used]
    defined += [f"#define {key} {CONSTANTS[key]}" for key in _constants(used)]
    files = tuple(dict.fromkeys(gathered.files[part.file] for part in kept))
    blocks = tuple(BLOCKS[key] for key in _BLOCK.findall(code))
    text = "\n".join([*head.lines, *defined, "", body, ""])
    return Lifted(name, target, head.version, decided, files, blocks, text)


def _decided(name: str, gathered: Gathered, defines: Mapping[str, int]) -> Iterator[tuple[int, str]]:
    """Lines that remain after preprocessing the switches, each with the number of its file."""
    file, missing = 0, set[str]()
    live, done = [True], [True]  # for each nested condition: whether we are in, and whether a branch has been taken
    for line in gathered.lines:
        if match := _LINE.match(line):
            file = int(match[1])
            continue
        match = _DIRECTIVE.match(line)
        word, rest = (match[1], _COMMENT.sub("", match[2]).strip()) if match else ("", "")
        if word in ("if", "elif"):
            if word == "elif":
                live.pop()
            taken = done.pop() if word == "elif" else False
            asked = live[-1] and not taken
            absent = {key for key in _NAME.findall(rest) if key not in defines} if asked else set()
            missing |= absent
            holds = asked and not absent and _value(rest, defines)
            live.append(live[-1] and holds)
            done.append(taken or holds)
        elif word == "else":
            live[-1] = live[-2] and not done[-1]
        elif word == "endif":
            live.pop()
            done.pop()
        elif live[-1] and word == "error" and not missing:
            raise InputError(f"shader {name!r}", rest, "give other values")
        elif live[-1] and not word:
            yield file, line
    if missing:
        options = " ".join(f"--define {key}={_least(key, gathered)}" for key in sorted(missing))
        count = f"{len(missing)} {'switch' if len(missing) == 1 else 'switches'}"
        raise InputError(f"shader {name!r}", f"it asks for {count} more", f"add {options}, or other values")


def _least(key: str, gathered: Gathered) -> int:
    """Smallest value that a shader accepts for a switch."""
    return int(any(re.match(rf"\s*#if {key} < 1$", line) for line in gathered.lines))


def _value(condition: str, defines: Mapping[str, int]) -> bool:
    """Value of a preprocessor condition of integers and switches."""
    text = re.sub(r"!(?!=)", " not ", condition.replace("&&", " and ").replace("||", " or "))
    return bool(_evaluated(ast.parse(text.strip(), mode="eval").body, defines))


def _evaluated(node: ast.expr, defines: Mapping[str, int]) -> int:
    match node:
        case ast.Constant(value=int(value)):
            return value
        case ast.Name(id=key):
            return int(defines[key])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not _evaluated(operand, defines)
        case ast.BoolOp(op=op, values=values):
            found = [_evaluated(value, defines) for value in values]
            return all(found) if isinstance(op, ast.And) else any(found)
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            a, b = _evaluated(left, defines), _evaluated(right, defines)
            return {ast.Eq: a == b, ast.NotEq: a != b, ast.Lt: a < b, ast.Gt: a > b}[type(op)]
    raise ValueError(f"no condition of whole numbers: {ast.unparse(node)}")


def _parts(lines: Iterable[tuple[int, str]]) -> Iterator[_Part]:
    """Top-level declarations in order, without constants, which are written anew."""
    above: list[str] = []
    part: list[str] = []
    depth = 0
    last = 0
    for file, line in lines:
        code = _COMMENT.sub("", line)
        if not part and not code.strip():
            # A comment apart from what follows speaks of the file.
            if (not line.strip() or file != last) and above:
                yield _Part(last, "\n".join(above), "")
                above = []
            above += [line] if line.strip() else []
            last = file
            continue
        if not part and (define := re.match(r"\s*#define (\w+)", line)) and define[1] in CONSTANTS:
            continue
        last = file
        part.append(line)
        depth += code.count("{") - code.count("}") + code.count("(") - code.count(")")
        if depth == 0 and (code.lstrip().startswith("#") or code.rstrip().endswith((";", "}"))):
            text = "\n".join(part)
            yield _Part(file, "\n".join([*above, text]), "\n".join(_COMMENT.sub("", one) for one in part))
            above, part = [], []
    if above:
        yield _Part(last, "\n".join(above), "")


def _reached(parts: list[_Part]) -> list[_Part]:
    """Parts that the shader needs, and the comments on files of which any part remains."""
    functions = {part.function for part in parts}
    declaring: dict[str, list[_Part]] = {}
    for part in parts:
        for name in part.declares:
            declaring.setdefault(name, []).append(part)
    roots = [
        part for part in parts if (part.function == "main" if "main" in functions else part.file == 0) or _faces(part)
    ]
    kept = {id(part) for part in roots}
    waiting = roots
    while waiting:
        for name in waiting.pop().names:
            for part in declaring.get(name, ()):
                if id(part) not in kept:
                    kept.add(id(part))
                    waiting.append(part)
    files = {part.file for part in parts if id(part) in kept and part.code}
    return [part for part in parts if (id(part) in kept if part.code else part.file in files)]


def _faces(part: _Part) -> bool:
    """True if a part is an input or output of a stage, which has to match the neighboring stage."""
    return re.match(r"\s*(layout\s*\([^)]*\)\s*)?(flat\s+)?(in|out|invariant)\b", part.code) is not None


def _constants(used: set[str]) -> list[str]:
    """Constants that are used, directly or by other constants, in the order in which they are written."""
    wanted = {key for key in CONSTANTS if key in used}
    while more := {key for one in wanted for key in _NAME.findall(CONSTANTS[one]) if key in CONSTANTS} - wanted:
        wanted |= more
    return [key for key in CONSTANTS if key in wanted]
