"""glTF files as JSON, and a medium to write into them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import translucent as tl
from translucent.gltf.file import GltfFile
from translucent.gltf.nodes import node_transforms

JADE = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02, ior=1.5)

Json = dict[str, Any]


def gltf(*materials: Json, **more: Any) -> Json:
    return {"asset": {"version": "2.0"}, "materials": list(materials), **more}


def uses(file: GltfFile) -> Iterator[tuple[str, int, np.ndarray]]:
    """Name of a node, index of a material that its mesh has, and node to world, for all of a file."""
    transforms = node_transforms(file)
    for index, node in enumerate(file.items("nodes")):
        if "mesh" in node:
            mesh = file.item("meshes", node["mesh"])
            name = str(node.get("name", mesh.get("name", "")))
            for material in sorted({part["material"] for part in mesh["primitives"] if "material" in part}):
                yield name, material, transforms[index]
