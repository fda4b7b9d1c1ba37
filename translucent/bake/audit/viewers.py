"""Prediction of the color that viewers show for a body, beside what passes it in truth.

Means over views from all sides, of white light straight behind the body, without refraction and reflection. The lengths
and the formulas, per viewer, with their sources; versions move, and these were read, not run:

- three.js (`transmission_pars_fragment.glsl.js`, revision 08e1c55) and the Khronos glTF sample renderer (`ibl.glsl`,
  `punctual.glsl`): the stated thickness along the ray, whatever its angle, times the lengths of the columns of the
  node's matrix; sigma_t = -ln(c) / d.
- Filament (`surface_light_indirect.fs`): thickness times the cosine of the refracted ray, the chord of a ball of that
  diameter; c is clamped at 1e-5.
- Blender (glTF-Blender-IO, `KHR_materials_volume` of its importer, and the node Volume Absorption): Cycles traces the
  true length and ignores the thickness; the importer writes density 1 / d, and the node absorbs (1 - c) / d, not
  -ln(c) / d.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array
from translucent.bake.audit.body import Body
from translucent.bake.audit.thickness_rules import extinction_of
from translucent.media.medium import BLACKEST, Medium

#: Names of viewers, in the order in which they are told.
VIEWERS = ("three.js", "Khronos sample viewer", "Filament", "Blender (Cycles)")


def viewer_colors(body: Body) -> dict[str, Array]:
    """Mean linear color (3,) that passes a body, by viewer, and ``"true"``."""
    finite = np.isfinite(body.chords)
    if not finite.any():
        return {}
    material, matrix = body.material, body.placements[0].matrix[:3, :3]
    world = body.world_views()[finite]
    directions = body.views[finite] @ matrix.T / world[:, None]
    stated = body.seen_stated[finite]
    by_columns = stated * np.linalg.norm(directions * np.linalg.norm(matrix, axis=0), axis=1)
    ior = material.ior or 1.5
    refracted = np.sqrt(1.0 - (1.0 - body.cosines[finite] ** 2) / ior**2)
    color, distance = np.asarray(material.attenuation_color), material.attenuation_distance
    sigma = extinction_of(body)
    absorbed = np.zeros(3) if np.isinf(distance) else (1.0 - np.maximum(color, BLACKEST)) / distance
    lengths = {
        "true": (sigma, body.chords[finite] * world),
        "three.js": (sigma, by_columns),
        "Khronos sample viewer": (sigma, by_columns),
        "Filament": (sigma, by_columns * refracted),
        "Blender (Cycles)": (absorbed, body.chords[finite] * world),
    }
    with np.errstate(under="ignore"):
        return {name: Medium(absorption=s).transmittance(way).mean(axis=0) for name, (s, way) in lengths.items()}
