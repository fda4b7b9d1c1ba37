"""Preferences of the extension: which Python has the toolkit."""

import bpy


class TranslucentPreferences(bpy.types.AddonPreferences):
    """Preferences of the extension: the Python that has the toolkit."""

    bl_idname = __package__

    python: bpy.props.StringProperty(
        name="Python with the toolkit",
        description="Python in which translucent-shading is installed. Empty: the one that comes with this extension",
        subtype="FILE_PATH",
    )

    def draw(self, _: bpy.types.Context) -> None:
        """Draw the field, and what it stands for while it is empty."""
        self.layout.prop(self, "python")


def python_of_preferences() -> str:
    """Path of the Python that the user has chosen, or nothing."""
    addon = bpy.context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.python) if addon else ""


CLASSES = (TranslucentPreferences,)
