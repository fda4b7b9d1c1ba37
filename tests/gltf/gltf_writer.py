"""glTF files in the making, and scenes of them."""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import translucent as tl

Json = dict[str, Any]

COLOR = [0.1, 0.5, 0.9]
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
BOX = trimesh.creation.box((2.0, 4.0, 6.0))
# 90 degrees about y: x goes to -z.
TURN = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]


class Writer:
    """A glTF file in the making."""

    def __init__(self) -> None:
        self.tree: Json = {"asset": {"version": "2.0"}}
        self.data = b""

    def add(self, key: str, **item: Any) -> int:
        self.tree.setdefault(key, []).append(item)
        return len(self.tree[key]) - 1

    def view(self, data: bytes, **fields: Any) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        index = self.add("bufferViews", buffer=0, byteOffset=len(self.data), byteLength=len(data), **fields)
        self.data += data
        return index

    def accessor(self, values: Any, dtype: str = "f4", **fields: Any) -> int:
        array = np.asarray(values).astype(f"<{dtype}")
        width = array.shape[1] if array.ndim == 2 else 1
        view = self.view(array.tobytes())
        fields = {"bufferView": view, "componentType": TYPES[dtype], "count": len(array), "type": KINDS[width]} | fields
        return self.add("accessors", **fields)

    def primitive(self, mesh: trimesh.Trimesh = BOX, **fields: Any) -> Json:
        indices = self.accessor(mesh.faces.ravel(), "u2")
        return {"attributes": {"POSITION": self.accessor(mesh.vertices)}, "indices": indices} | fields

    def mesh(self, *primitives: Json, **fields: Any) -> int:
        return self.add("meshes", primitives=list(primitives or [self.primitive()]), **fields)

    def material(self, **fields: Any) -> int:
        return self.add("materials", **fields)

    def save(self, path: Path) -> Path:
        tree = dict(self.tree)
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            tree.setdefault("buffers", [{"byteLength": len(self.data), "uri": uri}])
            path.write_text(json.dumps(tree))
            return path
        tree.setdefault("buffers", [{"byteLength": len(self.data)}])
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        binary = self.data + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path


def glass(transmission: float = 1.0, thickness: float | None = 1.0, ior: float | None = None, **volume: Any) -> Json:
    """Extensions of a material that light passes."""
    found: Json = {"KHR_materials_transmission": {"transmissionFactor": transmission}}
    if thickness is not None:
        found["KHR_materials_volume"] = {"thicknessFactor": thickness, **volume}
    if ior is not None:
        found["KHR_materials_ior"] = {"ior": ior}
    return found


WINE = glass(ior=1.33, attenuationColor=COLOR, attenuationDistance=0.5)


def box_file(path: Path, **node: Any) -> Writer:
    """A box on one node, in the file as yet unsaved."""
    writer = Writer()
    writer.add("nodes", mesh=writer.mesh(), **node)
    return writer


def load(writer: Writer, tmp_path: Path, suffix: str = ".glb", **options: Any) -> Any:
    return tl.load_scene(writer.save(tmp_path / f"model{suffix}"), **options)


def material_scene(tmp_path: Path, material: Json, **options: Any) -> Any:
    writer = Writer()
    writer.mesh(writer.primitive(material=writer.material(**material)))
    writer.add("nodes", mesh=0, name="Thing", scale=[3.0, 3.0, 3.0])
    return load(writer, tmp_path, **options)


def lit_scene(tmp_path: Path, *lights: Json, **node: Any) -> Any:
    writer = box_file(tmp_path)
    writer.tree["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
    for i in range(len(lights)):
        writer.add("nodes", name=f"Lamp {i}", extensions={"KHR_lights_punctual": {"light": i}}, **node)
    return load(writer, tmp_path)
