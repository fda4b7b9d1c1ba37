"""Meshes of other libraries, recognized by their attributes: trimesh, PyVista, and similar objects.

None of these libraries is imported. What is no mesh of triangles is refused by a sentence that says how to make one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.threads import import_trimesh
from translucent.units import METRES_PER_UNIT, metres_per_unit

#: Attributes that hold positions and corners, with the libraries that call them so.
_NAMES = (
    ("vertices", "faces"),  # trimesh
    ("points", "faces"),  # PyVista
    ("vertices", "triangles"),  # Open3D
)

#: Vertices (n, 3) in the unit of the object, faces (m, 3), and texture coordinates (n, 2) if there are some.
Part = tuple[Array, npt.NDArray[np.int32], Array | None]


def is_scene(thing: object) -> bool:
    """True if an object is a scene of trimesh: geometries, and a graph of transforms that places them."""
    return all(hasattr(thing, name) for name in ("geometry", "graph", "dump"))


def foreign_name(thing: Any) -> str:
    """Name of a mesh or scene of another library: that of its metadata, or its file, or else of its type."""
    metadata = getattr(thing, "metadata", None)
    known = metadata if isinstance(metadata, dict) else {}
    found = known.get("name") or known.get("file_name")
    return found if isinstance(found, str) else type(thing).__name__.lower()


def unit_of(thing: Any, unit: str | None = None) -> tuple[float, str]:
    """Length of one unit of an object in metres, and the unit that was assumed because neither names one, or nothing.

    Parameters
    ----------
    thing : object
        Its `units` count where no unit is given, as those of trimesh.
    unit : str, optional

    Raises
    ------
    InputError
        If a unit is not known, or the parts of a scene have different ones.
    """
    if unit is not None:
        return metres_per_unit(unit), ""
    parts = thing.geometry.values() if is_scene(thing) else [thing]
    units = {getattr(part, "units", None) for part in parts}
    if len(units) > 1:
        found = f"the parts of the scene have different units: {', '.join(sorted(map(str, units)))}"
        raise InputError(
            f"scene {foreign_name(thing)!r}", found, "convert all meshes to metres: scene.convert_units('meters')"
        )
    own = next(iter(units), None)
    if not isinstance(own, str) or own == "none":  # as trimesh notes units that are set to None
        return 1.0, "m"
    if own in METRES_PER_UNIT:
        return METRES_PER_UNIT[own], ""
    try:
        return float(import_trimesh("trimesh.units").unit_conversion(own, "meters")), ""
    except (KeyError, ValueError):
        do = f"state unit=, one of {', '.join(METRES_PER_UNIT)}"
        raise InputError(f"mesh {foreign_name(thing)!r}", f"the unit {own!r} of the mesh is not known", do) from None


def foreign_parts(thing: Any) -> list[Part] | None:
    """Triangles of an object of another library, placed in its scene; None if the object is no mesh.

    Raises
    ------
    InputError
        If its faces are no triangles, or its arrays no numbers.
    """
    if is_scene(thing):
        return [part for one in thing.dump() for part in foreign_parts(one) or () if len(part[1])]
    for points, corners in _NAMES:
        if hasattr(thing, points) and hasattr(thing, corners):
            vertices, faces = _numbers(thing, points), _triangles(thing, corners)
            if not len(faces) and hasattr(thing, "extract_surface"):
                raise _faceless(thing)
            return [(vertices, faces, _uv(thing, len(vertices)))]
    if hasattr(thing, "extract_surface"):  # grids, blocks and points of PyVista
        if not getattr(thing, "n_cells", 1):
            raise _faceless(thing)
        do = "use its surface: grid.extract_surface().triangulate()"
        raise InputError(
            f"mesh {foreign_name(thing)!r}", f"an object of type {type(thing).__name__} is not a surface", do
        )
    return None


def _faceless(thing: Any) -> InputError:
    """Error for PyVista points, lines and empty meshes."""
    counts = [(getattr(thing, f"n_{name}", 0), name) for name in ("points", "lines")]
    found = " and ".join(f"{count} {name}" for count, name in counts if count)
    surface = "points, cloud.reconstruct_surface().triangulate(), or of lines, line.tube(radius=1).triangulate()"
    return InputError(
        f"mesh {foreign_name(thing)!r}",
        f"the mesh has {found or 'no points'} and no faces",
        f"make a surface from {surface}",
    )


def _numbers(thing: Any, name: str) -> Array:
    try:
        return np.array(getattr(thing, name), dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError(
            f"mesh {foreign_name(thing)!r}", f"the {name} of the mesh are not numbers", "check the arrays of the mesh"
        ) from None


def _triangles(thing: Any, name: str) -> npt.NDArray[np.int32]:
    """(m, 3): corners of the faces, which PyVista stores in one row, each behind their number."""
    asked, advice = f"mesh {foreign_name(thing)!r}", "triangulate it"
    if hasattr(thing, "triangulate"):
        advice = "triangulate the mesh: mesh.triangulate()"
    if getattr(thing, "n_strips", 0):
        raise InputError(asked, f"the mesh has {thing.n_strips} triangle strips", advice)
    try:
        faces = np.asarray(getattr(thing, name))
    except ValueError:  # rows of unequal lengths
        raise InputError(asked, "the faces of the mesh have different numbers of corners", advice) from None
    if faces.ndim == 1 and faces.dtype.kind in "iu":
        if len(faces) % 4 or (faces[::4] != 3).any():
            raise InputError(asked, "not all faces of the mesh are triangles", advice)
        faces = faces.reshape(-1, 4)[:, 1:]
    if not faces.size:
        return np.empty((0, 3), np.int32)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        kinds = {4: "quads"}.get(faces.shape[-1], f"an array of shape {faces.shape} of {faces.dtype}")
        raise InputError(asked, f"the faces of the mesh are {kinds}, and not triangles", advice)
    return np.array(faces, dtype=np.int32, order="C")


def _uv(thing: Any, count: int) -> Array | None:
    """(n, 2): texture coordinates, v upwards, of trimesh's visual or PyVista's point data."""
    found = getattr(getattr(thing, "visual", None), "uv", None)
    if found is None:
        found = getattr(thing, "active_texture_coordinates", None)
    if found is None or np.shape(found) != (count, 2):
        return None
    return np.array(found, dtype=np.float64, order="C")
