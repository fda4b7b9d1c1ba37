"""A translucent material for the selected objects: from a preset, or from a color at a distance.

The nodes are those that ``translucent extinction --as blender`` writes, with densities per unit of the scene.
"""

import json
from pathlib import Path

import bpy
import bpy.utils.previews

from .meshes import TYPES, metres_per_unit
from .toolkit import Task, ToolkitError

FOLDER = Path(__file__).parent

#: Presets as the build of the extension lists them: name, group, source.
PRESETS = FOLDER / "presets.json"

#: Inputs of volume nodes that are per length.
PER_LENGTH = ("Density", "Emission Strength")

_pictures: dict[str, bpy.utils.previews.ImagePreviewCollection] = {}
_items: list[tuple[str, str, str, int, int]] = []


def _presets(_operator: object, _context: object) -> list[tuple[str, str, str, int, int]]:
    """Presets with their pictures; Blender keeps no reference to the texts, so the list is kept here."""
    if not _items:
        listed = json.loads(PRESETS.read_text("utf-8")) if PRESETS.is_file() else []
        pictures = _pictures.setdefault("presets", bpy.utils.previews.new())
        for number, one in enumerate(listed):
            file, icon = FOLDER / "pictures" / f"{one['name']}.jpg", 0
            if file.is_file() and not bpy.app.background:
                icon = pictures.load(one["name"], str(file), "IMAGE").icon_id
            label = one["name"].replace("_", " ").capitalize()
            _items.append((one["name"], label, f"{one['group'].capitalize()}. {one['source']}", icon, number))
    return _items


def forget_pictures() -> None:
    """Free the pictures of the presets."""
    for collection in _pictures.values():
        bpy.utils.previews.remove(collection)
    _pictures.clear()
    _items.clear()


def _hues(values: object) -> str:
    return f"linear({', '.join(f'{value:.9g}' for value in values)})"


class TRANSLUCENT_OT_material(bpy.types.Operator):
    """Make a material of glass and a volume, and give it to the selected objects."""

    bl_idname = "translucent.material"
    bl_label = "Translucent Material"
    bl_options = {"REGISTER", "UNDO"}

    source: bpy.props.EnumProperty(
        name="From",
        items=(
            ("PRESET", "Preset", "A named medium, such as jade or whole milk"),
            ("COLOR", "Color at a distance", "White light has this color after this distance in the medium"),
        ),
    )
    preset: bpy.props.EnumProperty(name="Preset", items=_presets)
    color: bpy.props.FloatVectorProperty(name="Color", subtype="COLOR", default=(0.2, 0.6, 0.3), min=0.0, max=1.0)
    distance: bpy.props.FloatProperty(name="Distance", subtype="DISTANCE", default=0.02, min=1e-9, precision=4)
    ior: bpy.props.FloatProperty(name="IOR", description="Index of refraction", default=1.5, min=1.0, max=4.0)
    roughness: bpy.props.FloatProperty(name="Roughness", subtype="FACTOR", default=0.0, min=0.0, max=1.0)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return True if an object can take the material."""
        if context.mode != "OBJECT" or not any(item.type in TYPES for item in context.selected_objects):
            cls.poll_message_set("Select meshes, curves, metaballs or texts in Object Mode")
            return False
        return True

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        """Ask for the material first: each change would run the toolkit."""
        return context.window_manager.invoke_props_dialog(self, width=360)

    def draw(self, _: bpy.types.Context) -> None:
        """Draw what the chosen source needs."""
        layout = self.layout
        layout.use_property_split = True
        layout.row().prop(self, "source", expand=True)
        if self.source == "PRESET":
            layout.template_icon_view(self, "preset", show_labels=True, scale_popup=5.0)
            layout.prop(self, "preset", text="Name")
            return
        for name in ("color", "distance", "ior", "roughness"):
            layout.prop(self, name)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Let the toolkit write the nodes, make them, and give the material to the objects."""
        metres = metres_per_unit(context.scene)
        if self.source == "PRESET":
            name, asked = self.preset, ["--preset", self.preset]
        else:
            name, distance = "translucent", f"{self.distance * metres:.9g}m"
            asked = [_hues(self.color), distance, f"--ior={self.ior:.9g}", f"--roughness={self.roughness:.9g}"]
        chosen = [item for item in context.selected_objects if item.type in TYPES]
        far = [item.name for item in chosen if item.library or item.data.library]
        try:
            if not name:
                raise ToolkitError("There are no presets in this build. Choose a color at a distance")
            if far:
                raise ToolkitError(f"{far[0]!r} is in another file. Make it local first")
            task = Task("-m", "translucent", "extinction", *asked, "--as", "blender")
            try:
                snippet = task.output()
            finally:
                task.stop()
        except ToolkitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        material = _made(snippet, metres)
        material.name = name
        for item in chosen:
            if not item.material_slots:
                item.data.materials.append(None)
            item.material_slots[item.active_material_index].material = material
        for text in task.warnings:
            self.report({"WARNING"}, text)
        self.report({"INFO"}, f"Material {material.name!r} is on {len(chosen)} object{'s'[: len(chosen) != 1]}")
        return {"FINISHED"}


def _made(snippet: str, metres: float) -> bpy.types.Material:
    """Material that the snippet of the toolkit makes, whose densities are per metre."""
    names: dict[str, object] = {}
    exec(compile(snippet, "translucent extinction --as blender", "exec"), names)
    material, volume = names["material"], names["volume"]
    for socket in PER_LENGTH:
        if socket in volume.inputs:
            volume.inputs[socket].default_value *= metres
    return material


CLASSES = (TRANSLUCENT_OT_material,)
