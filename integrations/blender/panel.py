"""Panel of the extension in the sidebar of the 3D view."""

import bpy

from .baking import BakeSettings, TRANSLUCENT_OT_bake_thickness
from .checking import TRANSLUCENT_OT_check_materials
from .material import TRANSLUCENT_OT_material


class TRANSLUCENT_PT_panel(bpy.types.Panel):
    """Buttons of all operators, and the settings of bakes."""

    bl_label = "Translucent"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Translucent"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings, and a button for each operator, with bakes for both targets."""
        column = self.layout.column()
        column.operator(TRANSLUCENT_OT_material.bl_idname, icon="MATERIAL")
        column.separator()
        names, settings = tuple(BakeSettings.__annotations__), context.scene.translucent
        for name in names:
            column.prop(settings, name)
        for target, text, icon in (("IMAGE", "Images", "IMAGE_DATA"), ("ATTRIBUTE", "Vertices", "VERTEXSEL")):
            identifier = TRANSLUCENT_OT_bake_thickness.bl_idname
            bake = column.operator(identifier, text=f"Bake Thickness to {text}", icon=icon)
            bake.target = target
            for name in names:
                setattr(bake, name, getattr(settings, name))
        column.separator()
        column.operator(TRANSLUCENT_OT_check_materials.bl_idname, icon="CHECKMARK")


CLASSES = (TRANSLUCENT_PT_panel,)
