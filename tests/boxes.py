"""glTF files of boxes, one for each material."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import trimesh

from translucent.materials.gltf_file import GltfFile, read_gltf

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
