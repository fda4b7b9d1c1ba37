"""Scales of false colors: the lengths at their ends."""

from __future__ import annotations

from translucent.preview.workspace import Workspace


def thickest(workspace: Workspace) -> float:
    """Length in metres of the last false color: the thickest that was measured, or a guess."""
    measured = workspace.measured
    if measured is not None and measured.seen.thickness.size:
        return float(measured.seen.thickness.max()) or 1.0
    return workspace.loaded.scene.diagonal or 1.0 if workspace.loaded else 1.0


def worst(workspace: Workspace) -> float:
    """Largest error in metres that has a color of its own."""
    measured = workspace.measured
    least = 1e-7 * thickest(workspace)
    return max(measured.errors[0].p99, least) if measured is not None and measured.errors else 10 * least
