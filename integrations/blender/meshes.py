"""Selected objects as closed bodies: triangles in metres, with modifiers, scale and units of the scene applied."""

from dataclasses import dataclass

import bpy
import numpy as np

from .toolkit import ToolkitError

#: Types of objects that Blender turns into meshes.
TYPES = ("MESH", "CURVE", "SURFACE", "META", "FONT")

#: Columns and rows of UDIM tiles: 1001 to 1010 in the first row.
COLUMNS, ROWS = 10, 900


@dataclass
class Body:
    """Triangles of one object.

    `vertices` (n, 3) are in metres, where the object is in the scene; `faces` (m, 3) are counter-clockwise from
    outside; `uv` (m, 3, 2) are those of the active UV map, or None; `slots` (m,) says which of `images` a face is on.
    """

    name: str
    mesh: str
    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None
    slots: np.ndarray
    images: list[str]
    key: tuple


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Length of a unit of the scene in metres; without units it is taken as one metre."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else units.scale_length


def bodies_of(context: bpy.types.Context) -> list[Body]:
    """Bodies of the selected objects; raises `ToolkitError` if there are none, or one of them is no body."""
    if context.mode != "OBJECT":
        raise ToolkitError("Objects are being edited. Go to Object Mode first")
    chosen = [item for item in context.selected_objects if item.type in TYPES]
    graph = context.evaluated_depsgraph_get()
    parents = {one.parent.original.name for one in graph.object_instances if one.is_instance and one.parent}
    if several := [item.name for item in context.selected_objects if item.name in parents]:
        do = "make them real (Object > Apply > Make Instances Real), and select those"
        raise ToolkitError(f"{quoted(several)} shows instances, which have no images of their own: {do}")
    if not chosen:
        raise ToolkitError("No object with a surface is selected. Select meshes, curves, metaballs or texts")
    scale = metres_per_unit(context.scene)
    return [_body(item, graph, scale) for item in chosen]


def _body(item: bpy.types.Object, graph: bpy.types.Depsgraph, scale: float) -> Body:
    evaluated = item.evaluated_get(graph)
    mesh = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=graph)
    try:
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        if not count:
            raise ToolkitError(f"{item.name!r} has no faces. Leave it out of the selection")
        corners = _array(mesh.loop_triangles, "loops", (count, 3), np.int32)
        faces = _array(mesh.loop_triangles, "vertices", (count, 3), np.int32)
        slots = _array(mesh.loop_triangles, "material_index", (count,), np.int32)
        local = _array(mesh.vertices, "co", (len(mesh.vertices), 3), np.float32).astype(np.float64)
        layer = mesh.uv_layers.active
        uv = None if layer is None else _array(layer.uv, "vector", (len(mesh.loops), 2), np.float32)[corners]
        materials = [slot.material.name if slot.material else None for slot in evaluated.material_slots]
    finally:
        evaluated.to_mesh_clear()
    matrix = np.array(item.matrix_world, dtype=np.float64)
    turned = scale * matrix[:3, :3]
    if not abs(np.linalg.det(turned)) > 0:
        raise ToolkitError(f"{item.name!r} is flat: its scale is 0 along an axis. Give it a scale")
    if np.linalg.det(turned) < 0:  # a mirrored object keeps its outside outside, as Blender draws it
        faces = faces[:, ::-1]
        uv = None if uv is None else uv[:, ::-1]
    bare = item.name if item.name not in bpy.data.materials else f"{item.name} (object)"
    names = [material or bare for material in materials] or [bare]
    images = list(dict.fromkeys(names[min(slot, len(names) - 1)] for slot in np.unique(slots)))
    which = np.array([images.index(name) if name in images else 0 for name in names])
    # Of objects that share a mesh and a shape one is enough.
    shape = tuple(np.round(turned.T @ turned / scale**2, 6).ravel())
    key = (item.name,) if len(item.modifiers) else (item.data.name, shape, *images)
    vertices = local @ turned.T + scale * matrix[:3, 3]
    return Body(item.name, item.data.name, vertices, faces, uv, which[np.minimum(slots, len(names) - 1)], images, key)


def _array(items: bpy.types.bpy_prop_collection, name: str, shape: tuple[int, ...], dtype: type) -> np.ndarray:
    found = np.empty(int(np.prod(shape)), dtype=dtype)
    items.foreach_get(name, found)
    return found.reshape(shape)


def tiles_of(body: Body, slot: int) -> list[int]:
    """UDIM tiles on which the faces of one material lie, each by its middle.

    Raises
    ------
    ToolkitError
        If there is no UV map, or faces lie where no tile is.
    """
    if body.uv is None:
        raise ToolkitError(f"{body.name!r} has no UV map. Unwrap it, or bake to a vertex attribute")
    middle = body.uv[body.slots == slot].astype(np.float64).mean(axis=1)
    column, row = np.floor(middle).T
    outside = ~((column >= 0) & (column < COLUMNS) & (row >= 0) & (row < ROWS))  # no number is outside, too
    if outside.any():
        found = f"{outside.sum()} triangles of {body.name!r} lie outside of all UDIM tiles in its UV map"
        raise ToolkitError(f"{found}. Move them into one, or to 0..1")
    return sorted({int(tile) for tile in 1001 + column + COLUMNS * row})


def quoted(names: list[str]) -> str:
    """Names as a list for a sentence, the first few of many."""
    shown = ", ".join(repr(name) for name in names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more"
