"""Values of bakes and frames as arrays on the meshes of trimesh and PyVista."""

from __future__ import annotations

from typing import Any

import numpy as np

from translucent.arguments import brief, checked
from translucent.arrays import Array, Integers, Mask
from translucent.bake.check import look_up
from translucent.bake.thickness_map import ThicknessMap, VertexThickness
from translucent.errors import InputError
from translucent.frames.frame import Frame
from translucent.geometry.foreign import foreign_name, foreign_parts, is_scene, unit_of
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import ray_caster_of
from translucent.scene.scene import Object, Scene

#: Largest distance of a vertex from its own place, as a fraction of the diagonal: ten times what welding moves.
SAME_PLACE = 1e-5

#: Fraction of the distance to a vertex by which something has to be nearer to hide it.
IN_FRONT = 1e-4

#: Quantities of a frame that a mesh can carry, and those of bakes with the fields that hold them.
OF_FRAMES = ("thickness", "radiance", "transmittance", "optical_depth")
OF_BAKES = {"thickness": "values", "standard_error": "standard_error"}


@checked
def attach(
    mesh: Any, result: VertexThickness | ThicknessMap | Frame, quantity: str = "thickness", unit: str | None = None
) -> Array:
    """Store baked or rendered values in a mesh of trimesh or PyVista, as an array with a value for each vertex.

    It is ``mesh.vertex_attributes[quantity]`` of a `trimesh.Trimesh`, and ``mesh[quantity]`` of a `pyvista.PolyData`.
    Vertices are found by their positions, so that welded ones get the value of the one that is left.

    Parameters
    ----------
    mesh : trimesh.Trimesh or pyvista.PolyData
        The one that was baked or rendered. Of a frame, the object that has its vertices.
    result : VertexThickness, ThicknessMap or Frame
        A map is read at the texture coordinates. A frame gives each vertex the value of the pixel that shows it, and
        NaN where it is hidden, outside the picture, or the pixel is not valid.
    quantity : str
        Name of the array: ``thickness`` in metres, or ``standard_error`` of bakes, or ``radiance``, ``transmittance``
        and ``optical_depth`` of frames.
    unit : str, optional
        Unit of the vertices, as for `load_mesh`.

    Returns
    -------
    (n,) or (n, 3) float64
        The array; NaN for vertices without a face that the toolkit left out.

    Raises
    ------
    InputError
        If the vertices are not those of the result, the mesh holds no arrays, or there is no such quantity.
    """
    known = OF_FRAMES if isinstance(result, Frame) else tuple(OF_BAKES)
    if quantity not in known:
        raise InputError(f"quantity {quantity!r} of {type(result).__name__}", "unknown", f"use {', '.join(known)}")
    held = getattr(mesh, "vertex_attributes", None)
    held = getattr(mesh, "point_data", None) if held is None else held
    parts = None if is_scene(mesh) else foreign_parts(mesh)
    if parts is None or held is None:
        do = "give a trimesh.Trimesh or a pyvista.PolyData, for example scene.geometry['name']"
        raise InputError(f"attach to {brief(mesh)}", "this is not a single mesh with values at its vertices", do)
    points, used = parts[0][0] * unit_of(mesh, unit)[0], np.unique(parts[0][1]).astype(np.int64)
    if isinstance(result, Frame):
        values = _of_frame(points, used, result, quantity, foreign_name(mesh))
    else:
        own = np.asarray(getattr(result, OF_BAKES[quantity]), dtype=np.float64)
        if isinstance(result, ThicknessMap):
            assert result.mesh.uv is not None
            own = look_up(result.mesh, own, result.mesh.uv)
        at, missing = _places(points, used, result.mesh)
        if missing:
            raise _strange(foreign_name(mesh), missing, len(used), f"mesh {result.mesh.name!r}, which was baked")
        values = np.where(at >= 0, own[at], np.nan)
    held[quantity] = values
    return values


def _places(points: Array, used: Integers, mesh: Mesh) -> tuple[Integers, int]:
    """(n,): the mesh vertex at each point, -1 if there is none; and how many of the `used` points have none."""
    from scipy.spatial import KDTree

    found = KDTree(mesh.vertices).query(points, distance_upper_bound=SAME_PLACE * mesh.diagonal)[1]
    at = np.where(found < len(mesh.vertices), found, -1)
    return at, int((at[used] < 0).sum())


def _strange(name: str, missing: int, count: int, what: str) -> InputError:
    found = f"{missing} of its {count} vertices are not vertices of {what}"
    return InputError(
        f"attach to {name!r}",
        found,
        "attach to the mesh that was baked or rendered, and state its unit=",
    )


def _of_frame(points: Array, used: Integers, frame: Frame, quantity: str, name: str) -> Array:
    if frame.scene is None:
        raise InputError(
            "attach a frame",
            "the frame holds no scene, so pixels cannot be assigned to vertices",
            "attach a frame that renderer.render(scene, size) returned",
        )
    strangers: dict[str, int] = {}
    for item in frame.scene.objects:
        at, missing = _places(points, used, item.mesh)
        if not missing:
            break
        strangers[item.mesh.name] = missing
    else:
        nearest = min(strangers, key=strangers.__getitem__)
        raise _strange(name, strangers[nearest], len(used), f"mesh {nearest!r} or another of the scene")
    row, column, shown = _pixels(item, frame)
    values = np.asarray(getattr(frame, quantity), dtype=np.float64)[row, column]
    values[~(shown & frame.valid[row, column])] = np.nan
    found = np.full((len(points), *values.shape[1:]), np.nan)
    found[at >= 0] = values[at[at >= 0]]
    return found


def _pixels(item: Object, frame: Frame) -> tuple[Integers, Integers, Mask]:
    """Row and column of the pixel of each vertex of an object, (n,), and whether that pixel shows it."""
    assert frame.scene is not None
    camera, (width, height) = frame.scene.camera, frame.size
    world = item.world_vertices
    away = world - camera.eye
    ahead = away @ camera.forward
    half_width, half_height = camera.half_extent(frame.size)
    aside, above = camera.center(frame.size)
    depth = np.where(ahead > 0, ahead, np.nan) if camera.fov_y is not None else np.ones(len(away))
    x, y = away @ camera.right / (depth * half_width), away @ camera.up / (depth * half_height)
    column, row = 0.5 * width * (1 + x - aside), 0.5 * height * (1 + above - y)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    start = camera.eye if camera.fov_y is not None else world - ahead[:, None] * camera.forward
    shown = inside & ~_hidden(np.broadcast_to(start, world.shape), world, frame.scene)
    return np.where(inside, row, 0).astype(np.int64), np.where(inside, column, 0).astype(np.int64), shown


def _hidden(start: Array, world: Array, scene: Scene) -> Mask:
    """(n,): whether a surface is between the start and the end of a line."""
    hidden = np.zeros(len(world), dtype=bool)
    for item in scene.objects:
        inverse = np.linalg.inv(item.matrix[:3, :3])
        begin, end = ((points - item.matrix[:3, 3]) @ inverse.T for points in (start, world))
        hidden |= ray_caster_of(item.mesh).nearest(begin, end - begin)[1] < 1.0 - IN_FRONT
    return hidden
