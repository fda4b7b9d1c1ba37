"""Preparations in the background without which the wanted picture cannot be drawn."""

from __future__ import annotations

from translucent.preview.workspace import Workspace


def relights(workspace: Workspace) -> bool:
    """True if another environment or stage is being prepared, so that what is drawn now will not stay."""
    task = workspace.lanes["light"].task
    return task is not None and bool(task.name)


def prepares(workspace: Workspace) -> bool:
    """True if processes are at work on what the picture waits for, which may take all the memory that there is."""
    lanes = workspace.lanes["trace"], workspace.compiler.lane
    return relights(workspace) or any(lane.task is not None and lane.task.name for lane in lanes)
