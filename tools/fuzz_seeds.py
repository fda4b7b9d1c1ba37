"""Good files of every kind that the toolkit reads, small, for ``tools/fuzz_readers.py`` to damage."""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

import translucent as tl
from translucent.bench.codec import Packed
from translucent.bench.output import heat_map, read_report, write_csv
from translucent.bench.record import (
    CaseRecord,
    ErrorStatistics,
    MethodRow,
    Provenance,
    Report,
    ReportPicture,
    TimeStatistics,
)
from translucent.files.images import PICTURES
from translucent.frames.photographs import read_photographs, read_picture
from translucent.geometry.solids import Box
from translucent.gltf.materials import read_materials
from translucent.gltf.write import write_medium
from translucent.materials import load_medium, text_block
from translucent.media.colors import pixel_color
from translucent.media.preset import read_presets
from translucent.scene.environment_files import read_environment_map

JADE = tl.Medium.from_color((0.2, 0.6, 0.4), 0.02, ior=1.5)

TABLE = b'name,color,distance\nred,#7b1e3a,1cm\n"two, three","linear(.2,.6,.3)",2 in\n'
ROWS = b'[{"name": "a", "color": [0.1, 0.2, 0.3], "distance": "1cm"}]'
SESSION = b"""version = 1
[model]
path = "bear"
unit = "m"
[material]
color = [0.1, 0.2, 0.3]
ior = 1.5
[look]
light = true
"""
SCRIPT = b"""[[action]]
do = "turn"
right = 30.0
up = 1
[[action]]
do = "change"
field = "look.light"
value = true
"""
PHOTOGRAPHS = b"""
white = "10,10,60,60"
[[photograph]]
file = "steps.jpg"
patches = ["90,10,400,60=1mm,2mm", "9,9,160,20=1mm..8mm"]
"""

PRESETS = b"""[wax]
kind = "estimated"
source = "me"
ior = 1.4
unit = "mm"
absorption = [1, 2.5, 3]
scattering = [1.0, 1, 1]
"""


#: A key of many dots, which may become a session, a script, photographs or presets.
DEEP = b"[model.a.a.a]\npath = 'bear'\n" + b".".join([b"a"] * 90) + b" = 1\nb = [[[{c.d.e.f = [1, 2]}]]]\n"


class Reader(NamedTuple):
    """A reader of files, and good files for it: name and content of each."""

    read: Callable[[Path], object]
    seeds: list[tuple[str, bytes]]


def picture(kind: str, mode: str = "RGB", size: tuple[int, int] = (16, 8)) -> bytes:
    """A picture with a gradient, of a format of Pillow."""
    stream = io.BytesIO()
    Image.linear_gradient("L").resize(size).convert(mode).save(stream, format=kind)
    return stream.getvalue()


def gltf_tree(binary: bytes | None) -> tuple[dict[str, Any], bytes]:
    """JSON and buffer of a scene with what scenes have: a textured, sparse, transformed, lit body and a camera."""
    box = Box((0, 0, 0), (1, 1, 1)).tessellate(1)
    parts = [
        box.vertices.astype("<f4").tobytes(),
        np.linspace(0, 1, 2 * len(box.vertices)).astype("<f4").tobytes(),
        box.faces.astype("<u2").tobytes(),
        np.array([0, 1], "<u2").tobytes() + box.vertices[:2].astype("<f4").tobytes(),
        picture("PNG", "RGBA"),
    ]
    starts = np.cumsum([0, *(len(part) + -len(part) % 4 for part in parts)]).tolist()
    data = b"".join(part + bytes(-len(part) % 4) for part in parts)
    n, m = len(box.vertices), box.faces.size
    low, high = box.vertices.min(axis=0).tolist(), box.vertices.max(axis=0).tolist()
    texture = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.1, 0], "scale": [2, 2]}}}
    volume = {"thicknessFactor": 0.1, "attenuationColor": [0.2, 0.6, 0.4], "attenuationDistance": 0.02}
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_volume", "KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{"nodes": [0, 2, 3]}],
        "nodes": [
            {"name": "body", "mesh": 0, "children": [1], "rotation": [0, 0.7071068, 0, 0.7071068], "scale": [1, 2, 1]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1]},
            {"camera": 0, "translation": [0, 0, 8]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0, "mode": 4}]},
            {"name": "other", "primitives": [{"attributes": {"POSITION": 3}, "material": 1, "indices": 2}]},
        ],
        "materials": [
            {
                "name": "jade",
                "pbrMetallicRoughness": {"baseColorTexture": texture, "metallicFactor": 0, "roughnessFactor": 0.2},
                "normalTexture": {"index": 0, "scale": 0.5},
                "extensions": {
                    "KHR_materials_transmission": {"transmissionFactor": 1},
                    "KHR_materials_volume": {**volume, "thicknessTexture": {"index": 0}},
                    "KHR_materials_ior": {"ior": 1.4},
                },
            },
            {"alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": True, "emissiveFactor": [0.1, 0, 0]},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.1}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3, "color": [1, 1, 0.5]}]}},
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33648, "wrapT": 33071, "magFilter": 9729}],
        "images": [{"bufferView": 4, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5126, "count": n, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": m, "type": "SCALAR"},
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": n,
                "type": "VEC3",
                "min": low,
                "max": high,
                "sparse": {
                    "count": 2,
                    "indices": {"bufferView": 3, "componentType": 5123},
                    "values": {"bufferView": 3, "byteOffset": 4},
                },
            },
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
            for start, part in zip(starts[:-1], parts, strict=True)
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if binary is None:
        tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
    return tree, data


def packed_glb(tree: Any, data: bytes) -> bytes:
    """A .glb of a JSON value and its binary chunk."""
    text = (tree if isinstance(tree, str) else json.dumps(tree)).encode("utf-8", "surrogatepass")
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def report_text() -> bytes:
    """A report with every kind of value that matters to its reader."""
    error = Packed.of(np.array([[0.0, 1e-9, 0.1], [np.nan, -3e-3, 1e-5]]))
    shown = base64.b64encode(picture("PNG")).decode()
    marks = Packed.of(np.array([[True, False, False], [False, False, True]]))
    row = MethodRow(
        "A", "A", "A()", "method", "exact", True, TimeStatistics(1, 2, 0.1, 9), thickness=ErrorStatistics(*([1e-3] * 6))
    )
    case = CaseRecord("knot", "Knot", "", "thickness", rows=(row,), pictures=(ReportPicture("A", shown, error, marks),))
    where = Provenance("c", "2026-01-01", "p", "p", 2, "egl", "r", "d", True, {"numpy": "2"}, None, None, 0, True)
    return Report(where, (case,)).to_json().encode()


def _numpy(save: Callable[..., None], *arrays: Any, **named: Any) -> bytes:
    stream = io.BytesIO()
    save(stream, *arrays, **named)
    return stream.getvalue()


def _meshes() -> list[tuple[str, bytes]]:
    import trimesh

    box = Box((0, 0, 0), (1, 2, 3)).tessellate(2)
    solid = trimesh.Trimesh(box.vertices, box.faces, process=False)
    found = []
    for kind, options in (("obj", {}), ("stl", {}), ("ply", {}), ("off", {}), ("ply", {"encoding": "ascii"})):
        content = solid.export(file_type=kind, **options)
        found.append((f"mesh.{kind}", content if isinstance(content, bytes) else content.encode()))
    found.append(("text.stl", solid.export(file_type="stl_ascii").encode()))
    found += [("fan.obj", _fan(300)), ("polygon.obj", _polygon(300)), ("apart.obj", _apart(60))]
    found.append(("uv.obj", b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nusemtl a\nf 1/1 2/2 3/1\n"))
    return found


def _obj(vertices: Any, faces: Any) -> bytes:
    lines = [f"v {x:.5g} {y:.5g} {z:.5g}" for x, y, z in vertices]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def _fan(count: int) -> bytes:
    """Many faces on one edge."""
    angle = np.linspace(0, 6, count)
    rim = np.stack([np.cos(angle), np.sin(angle), np.full(count, 0.5)], axis=1)
    return _obj([(0, 0, 0), (0, 0, 1), *rim], [(0, 1, i + 2) for i in range(count)])


def _polygon(count: int) -> bytes:
    """One polygon whose corners repeat."""
    return _obj([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[i % 3 for i in range(count)]])


def _apart(count: int) -> bytes:
    """Tetrahedra, apart and one in another; the faces of half of them look inwards."""
    corners, faces = (
        np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]),
        [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
    )
    vertices = [(i % 7, i % 5, i % 3) + corners * (1 + i % 4) for i in range(count)]
    turned = [[face[:: 1 if i % 2 else -1] for face in faces] for i in range(count)]
    listed = [[4 * i + corner for corner in face] for i in range(count) for face in turned[i]]
    return _obj(np.concatenate(vertices), listed)


def _hdr(folder: Path) -> list[tuple[str, bytes]]:
    rows = np.frombuffer(np.random.default_rng(0).bytes(16 * 8 * 4), np.uint8).reshape(8, 4, 16)
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 8 +X 16\n"
    coded = b"".join(b"\2\2\0\20" + b"".join(b"\20" + channel.tobytes() for channel in row) for row in rows)
    flat = np.moveaxis(rows, 1, 2).tobytes()
    return [
        ("runs.hdr", head + coded),
        ("flat.hdr", head + flat),
        ("old.hdr", head + b"\x80\x80\x80\x80\1\1\1\x7f"),
        ("long.hdr", head + b"\5\5\5\x80" + b"\1\1\1\0" * 3 + b"\1\1\1\xff"),
    ]


def _exr(folder: Path) -> bytes:
    import OpenEXR

    channels = {name: np.linspace(0, 1, 128, dtype=np.float32).reshape(8, 16) for name in ("R", "G", "B", "Y")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "scale": 1.0, "offset": 0.0}
    OpenEXR.File(header, channels).write(str(folder / "seed.exr"))
    return (folder / "seed.exr").read_bytes()


def _read_report(path: Path) -> None:
    report = read_report(path)
    write_csv(report, path.with_suffix(".csv"))
    for case in report.cases:
        for one in case.pictures:
            heat_map(one)


def _read_mesh(path: Path) -> None:
    str(tl.load_mesh(path).diagnosis)


def _read_scene(path: Path) -> None:
    for item in tl.load_scene(path).objects:
        str(item.mesh.diagnosis)


def _read_presets(path: Path) -> None:
    read_presets(path.read_text("utf-8", "replace"))


def _read_table(path: Path) -> None:
    from translucent.media.presets import convert_table

    convert_table(path, "m", "m", False)


def _read_preview(path: Path) -> None:
    from translucent.preview.session import load_session

    load_session(path)


def _read_script(path: Path) -> None:
    from translucent.preview.script import read_script

    read_script(path)


def readers(folder: Path) -> dict[str, Reader]:
    """Every reader by its name; `folder` is for files that only a library can make."""
    from translucent.bake.thickness_map import load_thickness_map
    from translucent.media.fitting import fit_wedge

    glb = ("scene.glb", packed_glb(*gltf_tree(b"")))
    text = ("scene.gltf", json.dumps(gltf_tree(None)[0]).encode())
    color = JADE.transmittance(0.02)
    targets = {"a.usda": "usd", "a.mtlx": "openpbr", "b.mtlx": "standard_surface", "a.json": "json"}
    targets |= {"a.py": "blender", "a.js": "threejs", "a.gdshader": "godot", "a.cs": "unity", "a.txt": "unreal"}
    materials = {name: text_block(target, JADE, color, 0.02).encode() for name, target in targets.items()}
    grid = np.linspace(0, 1, 24)
    map_values = {"scale": np.array(1.0), "offset": np.array(0.0), "values": np.ones((4, 4), np.float32)}
    return {
        "scene": Reader(_read_scene, [glb, text]),
        "gltf mesh": Reader(_read_mesh, [glb, text]),
        "gltf materials": Reader(read_materials, [glb, text]),
        "gltf written": Reader(lambda path: write_medium(path, path.with_name("out.glb"), JADE), [glb, text]),
        "mesh": Reader(_read_mesh, _meshes()),
        "hdr": Reader(read_environment_map, _hdr(folder)),
        "exr": Reader(read_environment_map, [("sky.exr", _exr(folder))]),
        "environment": Reader(read_environment_map, [("a.png", picture("PNG")), ("a.jpg", picture("JPEG"))]),
        "density": Reader(tl.DensityGrid.load, [("grid.npy", _numpy(np.save, grid.reshape(2, 3, 4)))]),
        "thickness map": Reader(
            load_thickness_map,
            [
                ("t.exr", _exr(folder)),
                ("t.npz", _numpy(np.savez_compressed, **map_values)),
                ("t.npy", _numpy(np.save, map_values["values"])),
            ],
        ),
        "material": Reader(load_medium, list(materials.items())),
        "table": Reader(_read_table, [("t.csv", TABLE), ("t.json", ROWS)]),
        "wedge": Reader(fit_wedge, [("w.csv", b"distance,color,weight\n1cm,#7b1e3a,1\n2cm,#3b0e1a,2\n")]),
        "photographs": Reader(read_photographs, [("p.toml", PHOTOGRAPHS), ("d.toml", DEEP)]),
        "picture": Reader(read_picture, [("a.png", picture("PNG")), ("a.exr", _exr(folder))]),
        "presets": Reader(_read_presets, [("p.toml", PRESETS), ("d.toml", DEEP)]),
        "session": Reader(_read_preview, [("s.toml", SESSION), ("d.toml", DEEP)]),
        "script": Reader(_read_script, [("s.toml", SCRIPT), ("d.toml", DEEP)]),
        "report": Reader(_read_report, [("report.json", report_text())]),
        "pixel": Reader(
            lambda path: pixel_color(path, 1, 1),
            [(f"p.{kind.lower()}", picture(kind)) for kind in PICTURES],
        ),
    }  # fmt: skip
