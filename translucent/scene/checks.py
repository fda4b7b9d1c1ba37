"""Refusal of what is no scene."""

from __future__ import annotations

from translucent.errors import InputError
from translucent.scene.scene import Scene


def check_scene(scene: object) -> None:
    """Raise `InputError` unless this is a scene."""
    if not isinstance(scene, Scene):
        kind = type(scene).__name__
        raise InputError("a scene", f"it is a {kind}", "give a tl.Scene, for example tl.showcase(mesh, medium)")
