"""Programs from files in ``shaders/``: includes, constants from Python, and compiler messages with file and line.

The parts of a text are its top-level declarations, found by braces and semicolons. What is reached from ``main``, or in
a library from the functions of the file itself, stays, and with it whatever has the same name: a name that is used for
two things keeps both, so nothing that is needed can get lost.
"""

from __future__ import annotations

import ast
import re
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from operator import itemgetter
from typing import Any, TypeAlias

import moderngl

from translucent.arguments import brief
from translucent.assets import shader_path
from translucent.errors import InputError, RenderError
from translucent.gpu.constants import CONSTANTS
from translucent.gpu.layout import BLOCKS, TABLES, PackedTable, UniformBlock
from translucent.threads import DeferredSignals

#: Key of a program, the same in every process: its files, and its switches.
ProgramName: TypeAlias = tuple[tuple[str, str], tuple[tuple[str, int], ...]]

#: Kinds of the textures that a program reads, by the names of their samplers.
Kinds: TypeAlias = tuple[tuple[str, int], ...]


class PostponedError(Exception):
    """Signal that a frame is left unfinished, as it would exceed the compile budget.

    Attributes
    ----------
    program : ProgramName, optional
        What its context is not to compile yet; None if the frame has made enough for now, and the next one goes on.
    """

    def __init__(self, program: ProgramName | None) -> None:
        super().__init__("the frame has compiled enough shaders" if program is None else (f"{program} must wait"))
        self.program = program


@dataclass(eq=False)
class CompileBudget:
    """Compile budget of a context, which holds it as its ``extra``, with a record of the programs that it has made.

    Attributes
    ----------
    postpones : bool
        Frames raise `PostponedError` rather than compile what `elsewhere` does not have, or make more than one thing
        after the time that `begin_frame` gives them.
    elsewhere : set of ProgramName
        What another process has compiled: the driver finds it on disk.
    needed : set of ProgramName
        What this context has compiled.
    """

    postpones: bool = False
    elsewhere: set[ProgramName] = field(default_factory=set)
    needed: set[ProgramName] = field(default_factory=set)
    _until: float = 0.0
    _made: bool = False

    def begin_frame(self, seconds: float) -> None:
        """Begin a frame with a compile budget in seconds."""
        self._until, self._made = time.perf_counter() + seconds, False

    def leave_room(self) -> None:
        """Raise `PostponedError` if the frame has used up its compile budget."""
        if self.postpones and self._made and time.perf_counter() > self._until:
            raise PostponedError(None)

    def enter(self, program: ProgramName | None) -> None:
        """Record a program that is about to be made, or raise `PostponedError`."""
        if self.postpones and program is not None and program not in self.elsewhere:
            raise PostponedError(program)
        self.leave_room()  # every frame makes something, or none would ever be done
        self._made = True
        if program is not None:
            self.needed.add(program)


def before_making(gl: moderngl.Context, program: ProgramName | None = None) -> None:
    """Ask the context's compile budget whether a program, or another cached object that takes time, may be made now."""
    if isinstance(gl.extra, CompileBudget):
        gl.extra.enter(program)


def before_drawing(gl: moderngl.Context) -> None:
    """Ask the context's compile budget whether the frame has time left to draw with what it has made."""
    if isinstance(gl.extra, CompileBudget):
        gl.extra.leave_room()


def before_drawing_with(gl: moderngl.Context, program: moderngl.Program, kinds: Kinds) -> None:
    """Ask the context's compile budget whether a program may be used now with textures of these types.

    Drivers compile it once more at its first use with them.
    """
    budget, name = gl.extra, program.extra
    if isinstance(budget, CompileBudget) and name is not None:
        files, switches = name
        if (used := (files, (*switches, *kinds))) not in budget.needed:
            budget.enter(used)


_NAME = re.compile(r"[A-Za-z_]\w*")
_COMMENT = re.compile(r"//.*")
_FUNCTION = re.compile(r"[\w\s\[\]]*?\b(\w+)\s*\([^;{]*\)\s*\{")
_MACRO = re.compile(r"\s*#define (\w+)")
#: GLSL keywords and types, which no declaration can have as its name.
_WORDS = re.compile(
    r"[iub]?vec[234]|mat[234](x[234])?|float|u?int|bool|void|[iu]?sampler\w+|const|uniform|buffer|struct|layout|std140|"
    r"std430|row_major|binding|location|define|if|else|for|while|return|in|out|inout|flat|\d\w*"
)
_FACE = re.compile(r"\s*(layout\s*\([^)]*\)\s*)?(flat\s+)?(in|out|invariant)\b")
_LINE = re.compile(r"#line \d+ (\d+)$")
DIRECTIVE = re.compile(r"\s*#\s*(if|elif|else|endif|error)\b(.*)$")
_INCLUDE = re.compile(r'^\s*#include\s+(?:"([^"]+)"|<([^>]+)>)\s*(?://.*)?$')
_CONDITION = re.compile(r"^\s*#\s*(?:if|elif|ifdef|ifndef)\b(.*)$")
# "0:12(5): error" (Mesa), "0(12) : error" (NVIDIA), "ERROR: 0:12:" (others)
_LOCATION = re.compile(r"\b(\d+)(?::(\d+)\(\d+\)|\((\d+)\)|:(\d+):)")

#: What makes a driver compute values declared ``precise`` as they are written, where that is possible before OpenGL 4.
_PRECISE = ("#extension GL_ARB_gpu_shader5 : enable", "#ifndef GL_ARB_gpu_shader5", "#define precise", "#endif")


@dataclass(frozen=True)
class ShaderSource:
    """Complete text of one stage.

    Attributes
    ----------
    text : str
        What the compiler gets.
    files : tuple of str
        Names of the parts; the compiler's source string number indexes them.
    """

    text: str
    files: tuple[str, ...]

    def locate(self, log: str) -> str:
        """Compiler `log` with ``shaders/<file>:<line>`` in place of source string numbers."""

        def located(match: re.Match[str]) -> str:
            number, line = int(match[1]), match[2] or match[3] or match[4]
            return f"shaders/{self.files[number]}:{line}" if number < len(self.files) else match[0]

        return _LOCATION.sub(located, log)


def preprocess(name: str, defines: Mapping[str, int] | None = None, version: int = 330) -> ShaderSource:
    """Text of the shader file `name` with its includes, each once.

    Parameters
    ----------
    name : str
        File under ``shaders/``.
    defines : dict of str to int, optional
        Switches for ``#if``; exactly the ones that the source reads.

    Raises
    ------
    RenderError
        If an include is missing or goes in circles, or the switches do not match the source.
    """
    return _with_switches(name, gather(name), defines, version)


def _with_switches(name: str, gathered: Gathered, defines: Mapping[str, int] | None, version: int) -> ShaderSource:
    """Preprocessed text of gathered shader files."""
    body = "\n".join(gathered.lines)
    given = dict(defines or {})
    if unknown := sorted(given.keys() - gathered.switches):
        raise RenderError(
            f"shader {name!r}", f"the code defines {unknown}, which the shader does not use", "check the spelling"
        )
    if missing := sorted(gathered.switches - given.keys()):
        raise RenderError(
            f"shader {name!r}", f"the shader needs {missing}, which the code does not define", "define them as 0 or 1"
        )
    head = [f"#version {version} core", f"// shaders/{name}"]
    head += [f"#define {key} {int(value)}" for key, value in given.items()]
    if re.search(r"^\s*precise ", body, re.MULTILINE):
        head += _PRECISE
    return ShaderSource("\n".join([*head, body, ""]), tuple(gathered.files))


class Gathered:
    """Lines of a file and of its includes, and the switches that they use."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.files: list[str] = []
        self.switches: set[str] = set()

    def add(self, name: str, parents: tuple[str, ...]) -> None:
        """Add a file, reached through includes from `parents`, and the files that it includes."""
        if name in parents:
            raise RenderError(
                f"shader {parents[0]!r}",
                f"files include each other in a circle: {' -> '.join([*parents, name])}",
                "remove one of these includes",
            )
        if name in self.files:
            return
        number = len(self.files)
        self.files.append(name)
        pieces, switches = _pieces(_text(name, parents))
        self.switches |= switches
        for line_number, lines, included in pieces:
            self.lines += [f"#line {line_number} {number}", *lines]
            if included is not None:
                self.add(included, (*parents, name))


@lru_cache(maxsize=256)
def _pieces(text: str) -> tuple[tuple[tuple[int, tuple[str, ...], str | None], ...], frozenset[str]]:
    """Number of the first line, lines, and name of the file included after them or None; and the switches in them all.

    Hundreds of programs are made of the same files.
    """
    pieces, switches, lines, first = [], set[str](), list[str](), 1
    for number, line in enumerate(text.splitlines(), 1):
        if match := _INCLUDE.match(line):
            pieces.append((first, tuple(lines), match[1] or f"<{match[2]}>"))
            lines, first = [], number + 1
            continue
        if match := _CONDITION.match(line):
            switches.update(re.findall(r"[A-Z_][A-Z0-9_]*", match[1]))
        lines.append(line)
    return (*pieces, (first, tuple(lines), None)), frozenset(switches)


def gather(name: str) -> Gathered:
    """A shader file with its includes, each once."""
    gathered = Gathered()
    gathered.add(name, ())
    return gathered


def _text(name: str, parents: tuple[str, ...]) -> str:
    if name == "<constants>":
        return "\n".join(f"#define {key} {value}" for key, value in CONSTANTS.items())
    if name.startswith("<"):
        generated: dict[str, UniformBlock | PackedTable] = {**BLOCKS, **TABLES}
        of_block, _, instance = name[1:-1].partition(" as ")
        if (found := generated.get(of_block)) is None:
            raise RenderError(
                f"shader {parents[-1]!r}",
                f"the shader includes {name}, which does not exist",
                f"include one of {', '.join(generated)}, or constants",
            )
        return found.named(instance) if instance and isinstance(found, UniformBlock) else found.glsl
    return shader_path(name).read_text(encoding="utf-8")


@dataclass
class ShaderPart:
    """Part of a shader: a top-level declaration with the comment above it, or a comment that stands alone."""

    file: int
    text: str
    code: str

    @property
    def function(self) -> str | None:
        """Name of the function that the part defines."""
        return _function(self.code)

    @property
    def names(self) -> frozenset[str]:
        """All names in the part."""
        return _names(self.code)

    @property
    def declares(self) -> frozenset[str]:
        """Names that other parts may need from it: that of a function or macro, or any name in the part."""
        if macro := _MACRO.match(self.code):
            return frozenset([macro[1]])
        return self.names if self.function is None else frozenset([self.function])


@lru_cache(maxsize=4096)  # programs are made of the same parts
def _function(code: str) -> str | None:
    match = _FUNCTION.match(code.strip()) if "{" in code else None
    return None if match is None else match[1]


@lru_cache(maxsize=4096)
def _names(code: str) -> frozenset[str]:
    return frozenset(name for name in _NAME.findall(code) if not _WORDS.fullmatch(name))


def decided_lines(
    name: str, gathered: Gathered, defines: Mapping[str, int], missing: set[str]
) -> Iterator[tuple[int, str]]:
    """Lines that remain after preprocessing the switches, each with the number of its file.

    Switches that conditions ask for and nobody has decided go into `missing`: lines are not to be used then.
    """
    file = 0
    live, done = [True], [True]  # for each nested condition: whether we are in, and whether a branch has been taken
    for line in gathered.lines:
        if line.startswith("#line ") and (match := _LINE.match(line)):
            file = int(match[1])
            continue
        match = DIRECTIVE.match(line) if "#" in line else None
        word, rest = (match[1], _COMMENT.sub("", match[2]).strip()) if match else ("", "")
        if word in ("if", "elif"):
            if word == "elif":
                live.pop()
            taken = done.pop() if word == "elif" else False
            reached = live[-1] and not taken
            absent = {key for key in _NAME.findall(rest) if key not in defines} if reached else set()
            missing |= absent
            holds = reached and not absent and bool(_evaluated(_condition(rest), defines))
            live.append(live[-1] and holds)
            done.append(taken or holds)
        elif word == "else":
            live[-1] = live[-2] and not done[-1]
        elif word == "endif":
            live.pop()
            done.pop()
        elif live[-1] and word == "error" and not missing:
            raise InputError(f"shader {name!r}", rest, "choose other values for --define")
        elif live[-1] and not word:
            yield file, line


@lru_cache(maxsize=1024)
def _condition(text: str) -> ast.expr:
    """A preprocessor condition, as Python parses it."""
    text = re.sub(r"!(?!=)", " not ", text.replace("&&", " and ").replace("||", " or ")).strip()
    return ast.parse(text, mode="eval").body


def _evaluated(node: ast.expr, defines: Mapping[str, int]) -> int:
    """Value of a preprocessor condition of whole numbers and switches, as Python parses it."""
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
    raise ValueError(f"this is not a condition on whole numbers: {ast.unparse(node)}")


def parts_of(lines: Iterable[tuple[int, str]]) -> Iterator[ShaderPart]:
    """Top-level declarations in order, without constants, which are written anew.

    Raises
    ------
    InputError
        If the last declaration does not end: it would be lost.
    """
    above: list[str] = []
    part: list[str] = []
    depth = 0
    last = 0
    for file, line in lines:
        code = _COMMENT.sub("", line) if "//" in line else line
        if not part and not code.strip():
            # A comment apart from what follows speaks of the file.
            if (not line.strip() or file != last) and above:
                yield ShaderPart(last, "\n".join(above), "")
                above = []
            above += [line] if line.strip() else []
            last = file
            continue
        if not part and "#" in line and (define := _MACRO.match(line)) and define[1] in CONSTANTS:
            continue
        last = file
        part.append(line)
        depth += code.count("{") - code.count("}") + code.count("(") - code.count(")")
        if depth == 0 and (code.lstrip().startswith("#") or code.rstrip().endswith((";", "}"))):
            text = "\n".join(part)
            yield ShaderPart(file, "\n".join([*above, text]), _COMMENT.sub("", text) if "//" in text else text)
            above, part = [], []
    if part:
        found = f"a declaration that begins with {brief(part[0].strip())} does not end"
        raise InputError("shader code", found, "close its braces and parentheses")
    if above:
        yield ShaderPart(last, "\n".join(above), "")


@lru_cache(maxsize=1024)  # programs have most of their files in common
def _parts_of_file(lines: tuple[str, ...]) -> tuple[ShaderPart, ...]:
    return tuple(parts_of((0, line) for line in lines))


def reached(parts: list[ShaderPart]) -> list[ShaderPart]:
    """Parts that the shader needs, and the comments on files that have such parts."""
    functions = {part.function for part in parts}
    declaring: dict[str, list[ShaderPart]] = {}
    for part in parts:
        for name in part.declares:
            declaring.setdefault(name, []).append(part)
    # Inputs and outputs of a stage have to match the neighboring stage.
    roots = [
        part
        for part in parts
        if (part.function == "main" if "main" in functions else part.file == 0) or _FACE.match(part.code)
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


def used_constants(used: Collection[str]) -> list[str]:
    """Constants that are used, directly or by other constants, in the order in which they are written."""
    needed = {key for key in CONSTANTS if key in used}
    while more := {key for one in needed for key in _NAME.findall(CONSTANTS[one]) if key in CONSTANTS} - needed:
        needed |= more
    return [key for key in CONSTANTS if key in needed]


def used_code(name: str, gathered: Gathered, source: ShaderSource, defines: Mapping[str, int]) -> str:
    """Text of a shader with nothing that its switches leave out or that it does not use: compilers read all they get.

    That is half of the time in which Mesa's makes a program. A shader that refuses the switches, or has a declaration
    without an end, stays whole.
    """
    try:
        by_file = groupby(decided_lines(name, gathered, defines, set()), itemgetter(0))
        parts = reached([part for _, lines in by_file for part in _parts_of_file(tuple(line for _, line in lines))])
    except InputError:
        return source.text
    head = source.text.partition("#line ")[0]
    used = frozenset[str]().union(*(part.names for part in parts))
    constants = (f"#define {key} {CONSTANTS[key]}" for key in used_constants(used))
    return "\n".join([head, *constants, *(part.code for part in parts), ""])


def build_program(
    gl: moderngl.Context,
    vertex: str,
    fragment: str,
    defines: Mapping[str, int] | None = None,
    version: int = 330,
    /,
    **samplers: int,
) -> moderngl.Program:
    """Compile and link two files.

    Parameters
    ----------
    vertex, fragment : str
        Files under ``shaders/``.
    defines : dict, optional
        Switches; each stage gets the ones in its text, and at least one stage must have each.
    version : int
        Of GLSL: 330, or 430 where shaders write to buffers.
    samplers : int
        Texture unit of each sampler.

    Raises
    ------
    RenderError
        With the compiler's message, by file and line.
    """
    given = dict(defines or {})
    stages, texts = [], []
    for name in (vertex, fragment):
        gathered = gather(name)
        own = {key: value for key, value in given.items() if key in gathered.switches}
        stages.append(_with_switches(name, gathered, own, version))
        texts.append(used_code(name, gathered, stages[-1], own))
    used = {key for stage in stages for key in given if f"#define {key} " in stage.text}
    if unused := sorted(given.keys() - used):
        raise RenderError(f"shaders {vertex!r} and {fragment!r}", f"neither shader uses {unused}", "check the spelling")
    try:
        try:
            program = _linked(gl, *texts)
        except moderngl.Error:  # the compiler's message has to name lines of the files
            program = _linked(gl, *(stage.text for stage in stages))
    except moderngl.Error as error:
        log = str(error)
        stage = stages[1] if "fragment_shader" in log else stages[0]
        raise _refused(stage, log) from error
    _bind(program, stages, samplers)
    return program


def build_compute(
    gl: moderngl.Context, name: str, defines: Mapping[str, int] | None = None, /, **samplers: int
) -> moderngl.ComputeShader:
    """Compile a compute shader, as `build_program` does two files; it gets the switches in its text."""
    gathered = gather(name)
    own = {key: value for key, value in (defines or {}).items() if key in gathered.switches}
    stage = _with_switches(name, gathered, own, 430)
    try:
        try:
            program = _linked(gl, used_code(name, gathered, stage, own))
        except moderngl.Error:
            program = _linked(gl, stage.text)
    except moderngl.Error as error:
        raise _refused(stage, str(error)) from error
    _bind(program, [stage], samplers)
    return program


def _linked(gl: moderngl.Context, *texts: str) -> Any:
    """Program of a vertex and a fragment shader, or a compute shader."""
    with DeferredSignals():
        if len(texts) == 1:
            return gl.compute_shader(*texts)
        return gl.program(vertex_shader=texts[0], fragment_shader=texts[1])


def _refused(stage: ShaderSource, log: str) -> RenderError:
    return RenderError(f"shader {stage.files[0]!r}", stage.locate(log).strip(), "correct the GLSL code")


def _bind(
    program: moderngl.Program | moderngl.ComputeShader, stages: Sequence[ShaderSource], samplers: Mapping[str, int]
) -> None:
    """Set the bindings of a program's uniform blocks, and the units of its samplers."""
    for name, block in BLOCKS.items():
        if name in program:
            program[name].binding = block.binding
    for name, unit in samplers.items():
        # A sampler that this variant declares but does not need is gone from the linked program.
        if name in program or not any(_mentions(stage.text, name) for stage in stages):
            set_uniform(program, name, unit)


def _mentions(text: str, name: str) -> bool:
    """True if a text has this word. A regular expression alone takes milliseconds for a large shader."""
    at = text.find(name)
    return at >= 0 and re.compile(rf"\b{name}\b").search(text, at) is not None


def set_uniform(program: moderngl.Program | moderngl.ComputeShader, name: str, value: Any) -> None:
    """Set a loose uniform; a name that the program does not have is an error, not a black picture."""
    try:
        program[name].value = value
    except KeyError:
        known = ", ".join(sorted(program))
        raise RenderError(
            f"uniform {name!r}", f"the program only has the uniforms {known}", "check the spelling"
        ) from None


def set_used(program: moderngl.Program | moderngl.ComputeShader, values: Mapping[str, Any]) -> None:
    """Set these loose uniforms where the program has them."""
    for name, value in values.items():
        if (uniform := program.get(name, None)) is not None:  # `in` goes through all names
            uniform.value = value
