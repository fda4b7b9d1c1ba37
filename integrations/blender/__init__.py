"""Translucent for Blender: metric thickness, media from a color at a distance, and a check of glTF materials.

The toolkit runs in a process of its own (`toolkit.py`), so that Blender stays usable, and nothing of it depends on how
Blender draws. Nothing here opens a network connection.
"""

import bpy

from . import baking, checking, material, panel, preferences, toolkit

_CLASSES = (*preferences.CLASSES, *baking.CLASSES, *material.CLASSES, *checking.CLASSES, *panel.CLASSES)


def register() -> None:
    """Make the operators, the panel and the preferences known."""
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.translucent = bpy.props.PointerProperty(type=baking.TRANSLUCENT_PG_bake)


def unregister() -> None:
    """Stop what runs, and take all of it back."""
    toolkit.stop_all()
    material.forget_pictures()
    del bpy.types.Scene.translucent
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)
