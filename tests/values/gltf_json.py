"""glTF files as JSON, and a medium to write into them."""

from __future__ import annotations

from typing import Any

import translucent as tl

JADE = tl.Medium.from_color((0.18, 0.62, 0.35), distance=0.02, ior=1.5)

Json = dict[str, Any]


def gltf(*materials: Json, **more: Any) -> Json:
    return {"asset": {"version": "2.0"}, "materials": list(materials), **more}
