"""Check materials: the audit of ``translucent material check``, on what Blender exports of the scene as glTF."""

import json
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

import bpy

from .running import RunsWork
from .toolkit import Task, ToolkitError

#: Text of the file that holds the findings.
TEXT = "Material check"

#: Exit codes of the check: nothing wrong, and a finding of severity error.
_CODES = (0, 1)

#: Nodes that light passes, which glTF has no words for: Blender's exporter leaves them out without a sentence.
_LOST = ("BSDF_GLASS", "BSDF_REFRACTION", "BSDF_TRANSLUCENT", "PRINCIPLED_VOLUME", "VOLUME_SCATTER")

_KINDS = {"error": "ERROR", "warning": "WARNING", "note": "INFO"}


class Checking:
    """A check that runs on a temporary file."""

    def __init__(self, context: bpy.types.Context, selection: bool) -> None:
        if context.mode != "OBJECT":
            raise ToolkitError("Objects are being edited. Go to Object Mode first")
        if selection and not context.selected_objects:
            raise ToolkitError("No object is selected. Select some, or check the whole scene")
        if "io_scene_gltf2" not in context.preferences.addons:
            raise ToolkitError("Blender's glTF exporter is disabled. Enable the add-on 'glTF 2.0 format'")
        self.lost = _lost(context.selected_objects if selection else context.view_layer.objects)
        self.folder = Path(tempfile.mkdtemp(prefix="translucent-"))
        file = self.folder / "scene.glb"
        try:
            try:
                bpy.ops.export_scene.gltf(
                    filepath=str(file),
                    export_format="GLB",
                    use_selection=selection,
                    export_apply=True,
                    export_animations=False,
                )
            except RuntimeError as error:
                raise ToolkitError(f"Blender could not export the scene: {error}") from None
            self.task = Task("-m", "translucent", "material", "check", file, "--json")
        except BaseException:
            self.close()
            raise

    def finish(self, _: bpy.types.Context) -> list[tuple[str, str]]:
        """Write the findings into a text of the file, and report them."""
        found = json.loads(self.task.output(accept=_CODES))
        lines, messages = [], []
        do = "Use a Principled BSDF with Transmission, and Volume Absorption, in what you export"
        for name, nodes in self.lost.items():
            said = f"glTF has no {nodes}: an export leaves it out, and so it is not checked"
            lines += [f"warning lost: material {name!r}", f"    {said}", f"    do: {do}"]
            messages.append(("WARNING", f"material {name!r}: {said}; {do}"))
        for one in found["findings"]:
            lines += [f"{one['severity']} {one['code']}: {one['where']}", f"    {one['text']}", f"    do: {one['do']}"]
            messages.append((_KINDS[one["severity"]], f"{one['where']}: {one['text']}; {one['do']}"))
        if not found["bodies"] and not lines:
            lines = ["No material transmits light in glTF: it takes Transmission and Volume of a Principled BSDF."]
            messages = [("WARNING", lines[0])]
        elif not lines:
            lines = ["Nothing was found."]
        text = bpy.data.texts.get(TEXT) or bpy.data.texts.new(TEXT)
        text.from_string("\n".join(lines) + "\n")
        count = len(found["bodies"])
        total = len(found["findings"]) + len(self.lost)
        what = f"{count} bod{'y' if count == 1 else 'ies'} that light passes, {total} findings"
        # Errors of a report raise in scripts: the check itself went well.
        messages = [("WARNING" if kind == "ERROR" else kind, said) for kind, said in messages]
        return [*messages, ("INFO", f"{what}: see the text {TEXT!r}")]

    def close(self) -> None:
        """Remove the temporary folder."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _lost(items: Iterable[bpy.types.Object]) -> dict[str, str]:
    """Nodes that an export leaves out, by the name of the material that shows them on an object."""
    found = {}
    for material in dict.fromkeys(slot.material for item in items for slot in item.material_slots):
        if material is None or material.node_tree is None:
            continue
        outputs = (
            node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output
        )
        waiting, seen = list(outputs), set()
        names = []
        while waiting:
            node = waiting.pop()
            if node in seen:
                continue
            seen.add(node)
            if node.type in _LOST:
                names.append(node.bl_label)
            waiting += [link.from_node for socket in node.inputs if socket.type == "SHADER" for link in socket.links]
        if names:
            found[material.name] = " and ".join(sorted(names))
    return found


class TRANSLUCENT_OT_check_materials(RunsWork, bpy.types.Operator):
    """Check whether thickness and attenuation of glTF materials are those of the meshes."""

    bl_idname = "translucent.check_materials"
    bl_label = "Check Materials"
    bl_options = {"REGISTER", "UNDO"}
    doing = "Checking materials"

    selection: bpy.props.BoolProperty(name="Selected objects only", default=False)

    def begin(self, context: bpy.types.Context) -> Checking:
        """Start the check."""
        return Checking(context, self.selection)


CLASSES = (TRANSLUCENT_OT_check_materials,)
