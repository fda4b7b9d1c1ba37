"""Operators that wait for a task: with progress and Esc in the window, and at once in scripts.

A `Work` changes the scene only when its task has ended well. So an error and a cancel leave everything as it was.
"""

from __future__ import annotations

from typing import Any, Protocol

import bpy

from .toolkit import Task, ToolkitError

#: Seconds between looks at the task.
STEP = 0.1


class Work(Protocol):
    """Modal operator around one task of the toolkit, and the use of its results."""

    task: Task

    def finish(self, context: bpy.types.Context) -> list[tuple[str, str]]:
        """Put the results into the scene; returns messages, each with its type for `Operator.report`."""

    def close(self) -> None:
        """Remove temporary files, whatever happened."""


class RunsWork:
    """Mixin of operators that run a `Work`, which `begin` makes from the context."""

    #: What the status bar says is done.
    doing = "Working"

    def begin(self, context: bpy.types.Context) -> Work:
        """Check the scene and start the task; raises `ToolkitError`."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run from a script: wait until it is done."""
        if (work := self._begun(context)) is None:
            return {"CANCELLED"}
        return self._finish(context, work)

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        """Run from the window: go on beside it."""
        if (work := self._begun(context)) is None:
            return {"CANCELLED"}
        self._work = work
        self._timer = context.window_manager.event_timer_add(STEP, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show the progress; Esc stops the task."""
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, f"{self.doing} was cancelled; nothing has changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._work.task.ended():
            percent = 100 * self._work.task.progress
            context.window_manager.progress_update(percent)
            context.workspace.status_text_set(f"{self.doing}: {percent:.0f} %   Esc: cancel")
            return {"RUNNING_MODAL"}
        self._tidy(context)
        return self._finish(context, self._work)

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the task, and leave the scene as it is; Blender calls this, too, when it quits."""
        self._work.task.stop()
        self._work.close()
        self._tidy(context)

    def _tidy(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _begun(self: Any, context: bpy.types.Context) -> Work | None:
        try:
            return self.begin(context)
        except ToolkitError as error:
            self.report({"ERROR"}, str(error))
            return None

    def _finish(self: Any, context: bpy.types.Context, work: Work) -> set[str]:
        try:
            messages = work.finish(context)
        except ToolkitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            work.task.stop()
            work.close()
        for kind, text in messages:
            self.report({kind}, text)
        return {"FINISHED"}
