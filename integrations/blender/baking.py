"""Bake metric thickness of the selected objects, into an image for each material or into an attribute of vertices."""

import json
import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np

from .meshes import Body, bodies_of, quoted, tiles_of
from .running import RunsWork
from .toolkit import WORKER, Task, ToolkitError

#: Property that marks images that were made here, which the next bake replaces.
MARK = "translucent_thickness"

#: Name of the node with the image in a material.
NODE = "Thickness"

_MODES = (
    ("cone", "Around the normal", "Mean distance to the exit over a hemisphere of directions"),
    ("normal", "Along the normal", "Distance to the exit straight behind the surface"),
    ("inscribed", "Largest sphere", "Diameter of the largest sphere inside that touches the surface there"),
)
_TARGETS = (
    ("IMAGE", "Images", "An image for each material, with all of its UDIM tiles"),
    ("ATTRIBUTE", "Attribute", "A float for each vertex"),
)


class Baking:
    """A bake that runs: what it is of, its task, and where the results go."""

    def __init__(self, context: bpy.types.Context, target: str, attribute: str, settings: dict[str, object]) -> None:
        bodies = bodies_of(context)
        self.unitless = context.scene.unit_settings.system == "NONE"
        self.bodies = list({body.key: body for body in reversed(bodies)}.values())[::-1]
        self.attribute, self.vertices, self.images = attribute, [], []
        if target == "ATTRIBUTE":
            self.vertices = [_checked_attribute(bodies, body, attribute) for body in self.bodies]
        else:
            self.images = _images_of(self.bodies)
        self.folder = Path(tempfile.mkdtemp(prefix="translucent-"))
        try:
            self._write(settings)
            self.task = Task(WORKER, self.folder)
        except BaseException:
            self.close()
            raise

    def _write(self, settings: dict[str, object]) -> None:
        arrays = {}
        for number, body in enumerate(self.bodies):
            arrays |= {f"vertices_{number}": body.vertices, f"faces_{number}": body.faces}
            if self.images:
                arrays |= {f"slots_{number}": body.slots, f"uv_{number}": body.uv}
        np.savez(self.folder / "meshes.npz", **arrays)
        images = [
            {"name": name, "tile": tile if len(tiles) > 1 or tile != 1001 else None, "parts": parts}
            for name, tiles in self.images
            for tile, parts in tiles.items()
        ]
        job = {
            "names": [body.name for body in self.bodies],
            "settings": settings,
            "images": images,
            "vertices": list(range(len(self.vertices))),
        }
        (self.folder / "job.json").write_text(json.dumps(job), "utf-8")

    def finish(self, context: bpy.types.Context) -> list[tuple[str, str]]:
        """Put images or attributes into the file; raises `ToolkitError`, and then nothing has changed."""
        self.task.output()
        messages = [("WARNING", text) for text in dict.fromkeys(self.task.warnings)]
        if self.unitless:
            messages.append(("WARNING", "The scene has no units (Scene > Units): one unit is taken as one metre"))
        count = sum(len(tiles) for _, tiles in self.images)
        values = [np.load(self.folder / f"image_{i}.npy") for i in range(count)]
        floats = [np.load(self.folder / f"vertices_{i}.npy") for i in range(len(self.vertices))]
        gone = [name for name in self.vertices if name not in bpy.data.meshes]
        changed = [
            name
            for name, one in zip(self.vertices, floats, strict=True)
            if name not in gone and len(bpy.data.meshes[name].vertices) != len(one)
        ]
        if gone or changed:
            raise ToolkitError(f"{quoted(gone or changed)} was changed during the bake. Bake again")
        for name, one in zip(self.vertices, floats, strict=True):
            attributes = bpy.data.meshes[name].attributes
            held = attributes.get(self.attribute) or attributes.new(self.attribute, "FLOAT", "POINT")
            held.data.foreach_set("value", one)
            bpy.data.meshes[name].update()
        if floats:
            text = f"Thickness is the attribute {self.attribute!r} of {quoted(self.vertices)}"
            messages.append(("INFO", f"{text}: {_range(floats)}"))
        for name, tiles in self.images:
            some = {tile: values.pop(0) for tile in tiles}
            image = _image(f"{name} thickness", some, self.folder)
            _show_in_material(name, image)
            messages.append(("INFO", f"Image {image.name!r}, packed into the file: {_range(list(some.values()))}"))
        return messages

    def close(self) -> None:
        """Remove the temporary folder."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _checked_attribute(bodies: list[Body], body: Body, attribute: str) -> str:
    """Name of the mesh that the attribute of a body goes to."""
    mesh = bpy.data.meshes.get(body.mesh)
    item = bpy.data.objects[body.name]
    if mesh is None or item.data != mesh:
        raise ToolkitError(f"{body.name!r} is no mesh, and has no attributes. Convert it, or bake to images")
    if mesh.library is not None:
        raise ToolkitError(f"The mesh of {body.name!r} is in another file. Make it local, or bake to images")
    if len(body.vertices) != len(mesh.vertices):
        found = f"Modifiers of {body.name!r} make {len(body.vertices)} vertices of {len(mesh.vertices)}"
        raise ToolkitError(f"{found}. Apply them, or bake to images")
    if unlike := [one.name for one in bodies if one.mesh == body.mesh and one.key != body.key]:
        found = f"{quoted([body.name, *unlike])} share a mesh, and are not of the same size or shape"
        raise ToolkitError(f"{found}. Make it single-user, or select one of them")
    held = mesh.attributes.get(attribute)
    if not attribute or (held is not None and (held.domain, held.data_type) != ("POINT", "FLOAT")):
        raise ToolkitError(f"{body.name!r} has an attribute {attribute!r} of another type. Choose another name")
    return body.mesh


def _images_of(bodies: list[Body]) -> list[tuple[str, dict[int, list[tuple[int, int]]]]]:
    """Name of each material, with its tiles, each with the (object, material of the object) on it."""
    found: dict[str, dict[int, list[tuple[int, int]]]] = {}
    for number, body in enumerate(bodies):
        for slot, name in enumerate(body.images):
            for tile in tiles_of(body, slot):
                found.setdefault(name, {}).setdefault(tile, []).append((number, slot))
    return [(name, dict(sorted(tiles.items()))) for name, tiles in found.items()]


def _range(values: list[np.ndarray]) -> str:
    return f"{min(one.min() for one in values):.4g} to {max(one.max() for one in values):.4g} m"


def _image(name: str, tiles: dict[int, np.ndarray], folder: Path) -> bpy.types.Image:
    """Image of floats with these tiles, packed into the file; it replaces the one of the last bake."""
    old = bpy.data.images.get(name)
    if set(tiles) == {1001}:
        image = _generated(name, tiles[1001])
    else:
        # Pixels of tiles beyond the first are read from files alone.
        stem = bpy.path.clean_name(name)
        for tile, values in tiles.items():
            made = _generated(name, values)
            made.file_format, made.filepath_raw = "OPEN_EXR", str(folder / f"{stem}.{tile}.exr")
            made.save()
            bpy.data.images.remove(made)
        image = bpy.data.images.load(str(folder / f"{stem}.{min(tiles)}.exr"))
        image.source, image.filepath = "TILED", str(folder / f"{stem}.<UDIM>.exr")
        for tile in set(tiles) - {one.number for one in image.tiles}:
            image.tiles.new(tile)
        image.colorspace_settings.name = "Non-Color"
    image.pack()
    image[MARK] = True
    if old is not None and old.get(MARK):
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
    return image


def _generated(name: str, values: np.ndarray) -> bpy.types.Image:
    height, width = values.shape
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[::-1, :, None]  # the lowest row first
    image.pixels.foreach_set(pixels.ravel())
    return image


def _show_in_material(name: str, image: bpy.types.Image) -> None:
    """Put the image into the material that it is of, as a node that nothing is linked to yet."""
    material = bpy.data.materials.get(name)
    if material is None or material.library is not None:
        return
    if material.node_tree is None:
        material.use_nodes = True  # before Blender 5
    nodes = material.node_tree.nodes
    node = nodes.get(NODE) or nodes.new("ShaderNodeTexImage")
    node.name, node.label, node.image = NODE, "Thickness in metres", image
    node.location.x = min((other.location.x for other in nodes if other != node), default=0.0) - 300.0


class BakeSettings:
    """Settings of a bake, which the scene keeps for the panel, and the operator takes."""

    mode: bpy.props.EnumProperty(name="Thickness", items=_MODES, default="cone")
    size: bpy.props.IntProperty(name="Size", description="Texels along each side", default=1024, min=1, max=16384)
    padding: bpy.props.IntProperty(name="Margin", description="Texels around each UV island", default=16, min=0)
    rays: bpy.props.IntProperty(name="Rays", description="From each texel or vertex", default=64, min=2, max=65536)
    attribute: bpy.props.StringProperty(name="Attribute", description="Of vertices", default="thickness")


class TRANSLUCENT_PG_bake(BakeSettings, bpy.types.PropertyGroup):
    """Settings of the next bake."""


class TRANSLUCENT_OT_bake_thickness(RunsWork, BakeSettings, bpy.types.Operator):
    """Bake the thickness of the selected objects in metres, with modifiers, scale and units of the scene applied."""

    bl_idname = "translucent.bake_thickness"
    bl_label = "Bake Metric Thickness"
    bl_options = {"REGISTER", "UNDO"}
    doing = "Baking thickness"

    target: bpy.props.EnumProperty(name="Into", items=_TARGETS, default="IMAGE")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return True in Object Mode with objects selected."""
        if context.mode != "OBJECT" or not context.selected_objects:
            cls.poll_message_set("Select objects in Object Mode")
            return False
        return True

    def begin(self, context: bpy.types.Context) -> Baking:
        """Start the bake."""
        settings = {"mode": self.mode, "size": self.size, "rays": self.rays, "padding": self.padding}
        return Baking(context, self.target, self.attribute, settings)


CLASSES = (TRANSLUCENT_PG_bake, TRANSLUCENT_OT_bake_thickness)
