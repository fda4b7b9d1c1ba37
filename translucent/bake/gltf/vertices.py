"""Writing of thickness per vertex into a glTF file: a float attribute ``_THICKNESS`` of its primitives, in units of the
file.

Materials and everything else in the file stay as they are: no extension reads thickness from vertices.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from translucent.bake.baked import BakedVertices
from translucent.bake.encoding import Encoding
from translucent.bake.gltf.bodies import PrimitiveKey
from translucent.bake.gltf.builder import GlbBuilder
from translucent.bake.record import Record, describe, shared, unit_of, write_record
from translucent.gltf.accessors import Accessors
from translucent.gltf.file import GltfFile
from translucent.gltf.write_file import write_gltf

ATTRIBUTE = "_THICKNESS"


def write_vertices(
    model: GltfFile | GlbBuilder,
    path: Path,
    results: Mapping[PrimitiveKey, BakedVertices],
    *,
    metres: float = 1.0,
    about: Record | None = None,
) -> Record:
    """Write a .glb whose vertices have their thickness, and its record beside it.

    Parameters
    ----------
    model : GltfFile or GlbBuilder
    path : Path
        A .glb file.
    results : mapping of (mesh, primitive) to BakedVertices
        The vertices of their meshes may be in another order than those of the file, and welded: positions count.
    metres : float
        Per unit of the file.
    about : dict, optional
        More for the record.

    Raises
    ------
    InputError
        If the file's data are wrong.
    RenderError
        If a file cannot be written.
    """
    from scipy.spatial import cKDTree

    builder = model if isinstance(model, GlbBuilder) else GlbBuilder(model)
    told: list[Record] = []
    for key, result in results.items():
        unit = unit_of(result.settings.mode)
        per_unit = metres if unit == "m" else 1.0
        attributes = builder.primitive(*key)["attributes"]
        positions = Accessors(builder.file()).vectors(attributes.get("POSITION"), "VEC3")
        with np.errstate(under="ignore"):
            _, nearest = cKDTree(result.mesh.vertices).query(positions * metres)
            attributes[ATTRIBUTE] = builder.add_accessor((result.values[nearest] / per_unit).astype(np.float32))
        told.append({"place": list(key), "attribute": ATTRIBUTE, **describe(result, Encoding(per_unit, unit=unit))})
    write_gltf(builder.file(), path)
    return write_record(path, {**(about or {}), **shared(told), "primitives": told})
