"""Panel of the extension in the sidebar of the 3D view."""

import bpy

from .baking import TRANSLUCENT_OT_bake_thickness
from .checking import TRANSLUCENT_OT_check_materials
from .material import TRANSLUCENT_OT_material


class TRANSLUCENT_PT_panel(bpy.types.Panel):
    """Buttons of all operators."""

    bl_label = "Translucent"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Translucent"

    def draw(self, _: bpy.types.Context) -> None:
        """Draw a button for each operator, and bakes for both targets."""
        column = self.layout.column()
        column.operator(TRANSLUCENT_OT_material.bl_idname, icon="MATERIAL")
        column.separator()
        for target, name, icon in (("IMAGE", "Images", "IMAGE_DATA"), ("ATTRIBUTE", "Vertices", "VERTEXSEL")):
            bake = TRANSLUCENT_OT_bake_thickness.bl_idname
            column.operator(bake, text=f"Bake Thickness to {name}", icon=icon).target = target
        column.separator()
        column.operator(TRANSLUCENT_OT_check_materials.bl_idname, icon="CHECKMARK")


CLASSES = (TRANSLUCENT_PT_panel,)
