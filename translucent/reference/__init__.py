"""Ground truth in float64 on the CPU, independent of any GPU: `render`, `march`, `path_trace` and
`trace_photons`."""

from translucent.reference.hits import Hits, Rays, camera_hits, line_hits, pixel_rays
from translucent.reference.intervals import Intervals
from translucent.reference.light_paths import light_transmittance
from translucent.reference.march import march
from translucent.reference.path_trace import path_trace
from translucent.reference.photons import LandedPhotons, photon_irradiance, trace_photons
from translucent.reference.refracted import light_over_pixels, refracted_light
from translucent.reference.render import hit_counts, opaque_counts, render, shade_hits
from translucent.reference.surfaces import sheet_thicknesses

__all__ = [
    "Hits",
    "Intervals",
    "LandedPhotons",
    "Rays",
    "camera_hits",
    "hit_counts",
    "light_over_pixels",
    "light_transmittance",
    "line_hits",
    "march",
    "opaque_counts",
    "path_trace",
    "photon_irradiance",
    "pixel_rays",
    "refracted_light",
    "render",
    "shade_hits",
    "sheet_thicknesses",
    "trace_photons",
]
