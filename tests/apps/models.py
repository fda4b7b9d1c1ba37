"""Models for the command line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from tests.boxes import boxes
from translucent.gltf.file import write_gltf


def write_scene(path: Path, *materials: dict[str, Any], cameras: bool = True) -> Path:
    """A file of one 1 x 1 x 2 m box per material, 10 m apart along x; and cameras 20 m away along z, and along x."""
    file = boxes(path, list(materials), extents=(1, 1, 2), step=(10, 0, 0))
    if cameras:
        file.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.3, "znear": 1}}] * 2
        file.tree["nodes"] += [
            {"camera": 0, "name": "Front", "translation": [0, 0, 20]},
            {
                "camera": 1,
                "name": "Side",
                "translation": [-20, 0, 0],
                "rotation": [0, -math.sqrt(0.5), 0, math.sqrt(0.5)],
            },
        ]
        nodes = file.tree["scenes"][0]["nodes"]
        nodes += range(len(file.tree["nodes"]) - 2, len(file.tree["nodes"]))
    write_gltf(file, path)
    return path
