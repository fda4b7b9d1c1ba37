"""A .glb to write media into."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.gltf.gltf_json import gltf


@pytest.fixture
def two_boxes(tmp_path: Path) -> Path:
    """Two meshes and three nodes that share one material; a second material is used by nobody."""
    positions = np.array(trimesh.creation.box((1, 2, 3)).triangles.reshape(-1, 3), dtype="<f4")
    data = positions.tobytes()
    primitive = {"attributes": {"POSITION": 0}, "material": 0}
    tree = gltf(
        {"name": "Glass", "doubleSided": True, "emissiveFactor": [0, 0.5, 0], "extras": {"kept": [1, 2]}},
        {"name": "Unused", "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}}},
        extensionsUsed=["KHR_materials_clearcoat"],
        scene=0,
        scenes=[{"nodes": [0, 1, 2]}],
        nodes=[
            {"name": "Left", "mesh": 0, "translation": [1, 2, 3]},
            {"name": "Right", "mesh": 0},
            {"name": "Other", "mesh": 1},
        ],
        meshes=[{"name": "Box", "primitives": [primitive]}, {"name": "Box2", "primitives": [dict(primitive)]}],
        accessors=[
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            }
        ],
        bufferViews=[{"buffer": 0, "byteLength": len(data), "target": 34962}],
        buffers=[{"byteLength": len(data)}],
    )
    path = tmp_path / "boxes.glb"
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    # An unknown chunk at the end has to survive, too.
    chunks = struct.pack("<II", len(data), 0x004E4942) + data + struct.pack("<II4s", 4, 0x12345678, b"more")
    header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(chunks))
    path.write_bytes(header + struct.pack("<II", len(text), 0x4E4F534A) + text + chunks)
    return path
