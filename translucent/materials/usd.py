"""UsdShade: a material with an OpenPBR surface, as .usda text. Written only.

UsdPreviewSurface has neither transmission nor volume, so the material is a MaterialX network of one node,
``ND_open_pbr_surface_surfaceshader``. The inputs are those of `translucent.materials.openpbr`, with its formulas,
source and losses; lengths are in the stage's ``metersPerUnit``, here 1.
"""

from __future__ import annotations

import numpy as np

from translucent.materials.materialx import transmission_inputs
from translucent.materials.openpbr import SHADER
from translucent.medium import Medium


def usda_text(medium: Medium, distance: float | None = None, name: str = "translucent") -> str:
    """A .usda layer with one material; the color is stated at `distance` in metres, see `color_at`."""
    lines = []
    for key, value in transmission_inputs(SHADER, medium, distance).items():
        if isinstance(value, float):
            lines.append(f"        float inputs:{key} = {value!r}")
        else:
            text = ", ".join(repr(channel) for channel in np.asarray(value).tolist())
            lines.append(f"        color3f inputs:{key} = ({text})")
    inputs = "\n".join(lines)
    return f"""#usda 1.0
(
    defaultPrim = "{name}"
    metersPerUnit = 1
    upAxis = "Y"
)

def Material "{name}"
{{
    token outputs:mtlx:surface.connect = </{name}/surface.outputs:out>

    def Shader "surface"
    {{
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
{inputs}
        token outputs:out
    }}
}}
"""
