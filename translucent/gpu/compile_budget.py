"""Compile budget of an OpenGL context: programs wait for another process to compile them, or for a later frame."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TypeAlias

import moderngl

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
        super().__init__("the frame has made enough for now" if program is None else f"{program} has to wait")
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
        """Raise `PostponedError` if what the frame has made has taken its compile budget: the next one draws."""
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
