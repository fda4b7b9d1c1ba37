"""Ground truth in float64 on the CPU, independent of any GPU: `render`, `march` and `path_trace`."""

from translucent.reference.hits import Hits, camera_hits, line_hits
from translucent.reference.intervals import Intervals
from translucent.reference.march import march
from translucent.reference.path_trace import path_trace
from translucent.reference.rays import Rays, pixel_rays
from translucent.reference.refraction import refracted_light
from translucent.reference.render import hit_counts, opaque_counts, render, shade_hits
from translucent.reference.sheets import SHEET_ON_OPAQUE, sheet_thicknesses
from translucent.reference.surface_light import light_transmittance

__all__ = [
    "SHEET_ON_OPAQUE",
    "Hits",
    "Intervals",
    "Rays",
    "camera_hits",
    "hit_counts",
    "light_transmittance",
    "line_hits",
    "march",
    "opaque_counts",
    "path_trace",
    "pixel_rays",
    "refracted_light",
    "render",
    "shade_hits",
    "sheet_thicknesses",
]
