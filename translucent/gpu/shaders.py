"""Programs from files in ``shaders/``: includes, constants from Python, and compiler messages with file and line."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import moderngl

from translucent.assets import shader_path
from translucent.errors import RenderError
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
    stages = []
    for name in (vertex, fragment):
        gathered = gather(name)
        own = {key: value for key, value in given.items() if key in gathered.switches}
        stages.append(_with_switches(name, gathered, own, version))
    used = {key for stage in stages for key in given if f"#define {key} " in stage.text}
    if unused := sorted(given.keys() - used):
        raise RenderError(f"shaders {vertex!r} and {fragment!r}", f"neither shader uses {unused}", "check the spelling")
    try:
        with DeferredSignals():
            program = gl.program(vertex_shader=stages[0].text, fragment_shader=stages[1].text)
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
        with DeferredSignals():
            program = gl.compute_shader(stage.text)
    except moderngl.Error as error:
        raise _refused(stage, str(error)) from error
    _bind(program, [stage], samplers)
    return program


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
