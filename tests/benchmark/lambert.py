"""A renderer of sixty lines, as a stranger would write it from the docs: Lambert's surfaces, opaque, one sample."""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR


def triangles(path: Path) -> list[Any]:
    """Corners (n, 3, 3) of each object of a scene.glb, whose vertices are in the world."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    told, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    found = []
    for mesh in told["meshes"]:
        accessor = told["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
        offset = told["bufferViews"][accessor["bufferView"]]["byteOffset"]
        values = np.frombuffer(binary, "<f4", 3 * accessor["count"], offset)
        found.append(values.reshape(-1, 3, 3).astype(np.float64))
    return found


def render(folder: Path) -> Any:
    """Linear radiance (h, w, 3) of a scene."""
    told = json.loads((folder / "scene.json").read_text())
    camera, (width, height) = told["camera"], told["size"]
    axes = np.array([camera["right"], camera["up"], camera["forward"]])
    half = np.tan(np.radians(camera["fov_y_degrees"]) / 2)
    with OpenEXR.File(str(folder / "environment.exr")) as file:
        sky = np.array(file.channels()["RGB"].pixels)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * half * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * half
    rays = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1) @ axes
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    row = np.arccos(rays[..., 1]) / np.pi * len(sky)
    column = (np.arctan2(rays[..., 0], -rays[..., 2]) / (2 * np.pi) + 0.5) * len(sky[0])
    picture = sky[row.astype(int) % len(sky), column.astype(int) % len(sky[0])].astype(np.float64)
    depth = np.full((height, width), np.inf)
    for item, corners in zip(told["objects"], triangles(folder / "scene.glb"), strict=True):
        color = np.array(item.get("diffuse_reflectance") or np.exp(-0.3 * np.array(item["absorption"])))
        seen = (corners - camera["eye"]) @ axes.T
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for at, normal in zip(seen, normals, strict=True):
            if (at[:, 2] <= 0).any():
                continue
            screen = at[:, :2] / at[:, 2:] / half
            px, py = (screen[:, 0] + 1) * width / 2 - 0.5, (1 - screen[:, 1]) * height / 2 - 0.5
            x0, x1 = max(int(np.ceil(px.min())), 0), min(int(px.max()) + 1, width)
            y0, y1 = max(int(np.ceil(py.min())), 0), min(int(py.max()) + 1, height)
            gx, gy = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
            area = (px[1] - px[0]) * (py[2] - py[0]) - (px[2] - px[0]) * (py[1] - py[0])
            if gx.size == 0 or area == 0:
                continue
            b1 = ((gx - px[0]) * (py[2] - py[0]) - (px[2] - px[0]) * (gy - py[0])) / area
            b2 = ((px[1] - px[0]) * (gy - py[0]) - (gx - px[0]) * (py[1] - py[0])) / area
            z = 1 / ((1 - b1 - b2) / at[0, 2] + b1 / at[1, 2] + b2 / at[2, 2])
            nearer = (b1 >= 0) & (b2 >= 0) & (b1 + b2 <= 1) & (z < depth[y0:y1, x0:x1])
            up = normal[1] / max(np.linalg.norm(normal), 1e-30)
            picture[y0:y1, x0:x1][nearer] = color * (0.6 + 0.4 * up) * sky.mean()
            depth[y0:y1, x0:x1][nearer] = z[nearer]
    return picture


if __name__ == "__main__":
    for scene in sorted(Path(sys.argv[1]).iterdir()):
        if scene.is_dir():
            np.save(Path(sys.argv[2]) / f"{scene.name}.npy", render(scene).astype(np.float32))
