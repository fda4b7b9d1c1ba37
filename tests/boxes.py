"""glTF files of boxes, one for each material."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import trimesh

from translucent.gltf.file import GltfFile, read_gltf

GLASS = {
    "KHR_materials_transmission": {"transmissionFactor": 1},
    "KHR_materials_volume": {"thicknessFactor": 1, "attenuationColor": [0.25, 0.5, 1], "attenuationDistance": 0.5},
}


def boxes(path: Path, materials: list[dict[str, Any]], extents: Sequence[float], step: Sequence[float]) -> GltfFile:
    """A box of each material, ``Box 0`` at the origin and each a step from the last; changes are yet to be written."""
    scene = trimesh.Scene()
    for i in range(len(materials)):
        shift = trimesh.transformations.translation_matrix([i * along for along in step])
        scene.add_geometry(trimesh.creation.box(extents), f"Box {i}", f"Box {i}", transform=shift)
    path.write_bytes(scene.export(file_type="glb"))
    file = read_gltf(path)
    file.tree["materials"] = materials
    for i, mesh in enumerate(file.tree["meshes"]):
        mesh["primitives"][0]["material"] = i
    return file


_BOX = trimesh.creation.box((2.0, 4.0, 6.0))


def box_buffer() -> bytes:
    """Positions and indices of `linked_box`."""
    return bytes(_BOX.vertices.astype("<f4").tobytes() + _BOX.faces.astype("<u2").tobytes())


def linked_box(uri: str) -> dict[str, Any]:
    """glTF: a box of 2 x 4 x 6 m, whose buffer, `box_buffer`, is at `uri`."""
    points, faces = _BOX.vertices.astype("<f4"), _BOX.faces.astype("<u2")
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": points.nbytes},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": faces.nbytes},
        ],
        "buffers": [{"uri": uri, "byteLength": points.nbytes + faces.nbytes}],
    }
