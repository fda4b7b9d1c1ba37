"""Constants shared by Python and shaders: written here and nowhere else; ``#include <constants>`` emits them."""

from __future__ import annotations

from typing import get_args

from translucent.diffusion.environment_ahead import DEPTHS, HEIGHT, WIDTH
from translucent.formulas.bsdf import TABLE_SIZE
from translucent.formulas.color import LUMINANCE_WEIGHTS
from translucent.formulas.diffusion import (
    AHEAD_ANGLE,
    AZIMUTHS,
    IN_SCATTERED_ROUGHNESS,
    LEAST_COSINE,
    LEAST_EVENT_DEPTH,
    SAMPLE_REACH,
)
from translucent.formulas.interface import CLEARCOAT_IOR
from translucent.formulas.optics import MIN_THIN_LAYER_COSINE
from translucent.formulas.sampling import ALPHA_OF_DEVIATION, LEAST_ACROSS, LEAST_BREADTH, MOST_LOOKUPS
from translucent.formulas.spherical_harmonics import BAND_0, BAND_1, BAND_2, BAND_2_ZONAL
from translucent.formulas.thin_film import (
    FILM_BLUE_CENTER,
    FILM_BLUE_SHARE,
    FILM_BLUE_WIDTH,
    FILM_CENTERS,
    FILM_COHERENT,
    FILM_ORDERS,
    FILM_TO_RGB,
    FILM_WIDTHS,
)
from translucent.formulas.tone import (
    AGX_DISPLAY,
    AGX_MIDDLE_GRAY,
    AGX_MIX,
    AGX_SHOULDER,
    AGX_SLOPE,
    AGX_STOPS,
    AGX_TOE,
    NEUTRAL_DESATURATION,
    NEUTRAL_F90,
    NEUTRAL_START,
)
from translucent.planning.interfaces import INTERIOR_SIZE
from translucent.planning.methods.ray_marched import LEAST_SEEN, Quadrature
from translucent.scene.grounds import TOLERANCE

#: Peeling passes that are folded at a time: as many textures as every driver can read, besides those of their state.
PEEL_BATCH = 8

#: Pixels along a side of the tiles for which depth peeling reads the largest number of crossings.
PEEL_TILE = 16

#: Binding points of the buffers that shaders write to. Lists of lights are made at those of the lists of pixels, which
#: are there at no other time.
STORAGE_BINDINGS = {
    "words": 0,
    "count": 0,
    "heads": 1,
    "nodes": 2,
    "light_heads": 3,
    "light_nodes": 4,
    "light_media": 5,
    "light_ends": 6,
    "path_states": 0,
    "live_paths": 1,
    "ended_paths": 2,
    "path_segments": 3,
    "next_segments": 4,
    "photons": 0,
    "live_photons": 1,
    "photon_segments": 2,
    "rays": 0,
    "ray_segments": 1,
    "live_rays": 2,
    "branches": 3,
    "branch_segments": 4,
    "branch_pixels": 5,
    "ray_light": 6,
    "pixel_rays": 0,
    "traced_light": 7,
    "ray_ends": 8,
    "end_counts": 9,
    "ended_rays": 0,
    "first_pixels": 8,
    "horizons": 10,
    "mesh_nodes": 0,
    "mesh_triangles": 1,
}

#: Parts along a side of a pixel that is drawn enlarged, and such pixels along a side of what is drawn.
PIXEL_PARTS, ENLARGED_ACROSS = 8, 4

#: Invocations in a group of a compute shader.
COMPUTE_GROUP = 64

#: Bits of the width of the textures that hold hierarchies, in texels: every OpenGL has that.
HIERARCHY_WIDTH_BITS = 12

#: Width of the textures that hold photons, in texels.
PHOTON_WIDTH = 512

#: A photon ends after so many surfaces.
MOST_PHOTON_HITS = 96

#: Types of objects, in the order of their numbers: an absorber is a thin wall that only absorbs and emits, and what is
#: unseen is drawn over the picture, or from its back.
OBJECT_TYPES = ("SOLID", "THIN_WALL", "OPAQUE", "UNSEEN", "ABSORBER")

#: Values of the constants by their names in GLSL.
CONSTANTS: dict[str, str] = {
    **{f"TYPE_{name}": str(number) for number, name in enumerate(OBJECT_TYPES)},
    "PI": "3.14159265358979",
    "LUMINANCE_WEIGHTS": f"vec3{LUMINANCE_WEIGHTS}",
    "MIN_THIN_LAYER_COSINE": repr(MIN_THIN_LAYER_COSINE),
    "MAX_OPTICAL_DEPTH": "1e4",  # exp of its negative is 0 with a wide margin
    "SERIES_LIMIT": "0.5",
    "NOTHING": "1e30",  # beyond every distance: coordinates end at 1e18
    "UNEXPECTED": "1e6",  # a count that no pixel expects
    "AXIAL_BITS": "29",  # bits for axial depth and slot together, of the 30 of a crossing; one is the side's
    "LARGEST_WORD": "0x3fffffffu",
    "SORTABLE_OFFSET": "0x00800000u",  # bits of the smallest normal float
    "PEEL_UNIT": "4096.0",  # alpha of a peeling pass holds two numbers: this times one, plus the other
    "PEEL_BATCH": str(PEEL_BATCH),
    "PEEL_TILE": str(PEEL_TILE),
    "STEEP_IN_LIGHT_VIEW": "5e-3",  # axial depth per texel, from which on a face may well curve within a texel
    "SHADOW_MARGIN": "1.0",  # texels that a surface may be behind what is opaque in a map of shadows, and still is lit
    "STEEPEST_SHADOW": "64.0",  # texels along a light's rays that a surface may rise from one texel to the next
    **{f"MARCH_{rule.upper()}": str(i) for i, rule in enumerate(get_args(Quadrature))},
    "LEAST_SEEN": repr(LEAST_SEEN),
    "AHEAD_DEPTHS": f"{DEPTHS}.0",
    "AHEAD_HEIGHT": f"{HEIGHT}.0",
    "AHEAD_WIDTH": f"{WIDTH}.0",
    "AHEAD_ANGLE": repr(AHEAD_ANGLE),
    "IN_SCATTERED_ROUGHNESS": repr(IN_SCATTERED_ROUGHNESS),
    "DENSITY_GRID": "1.0",
    "DENSITY_LINEAR": "2.0",
    "DENSITY_EXPONENTIAL": "3.0",
    "TURNS_BITS": "6",  # of a word, for how often a medium fills a point
    "TURNS_PER_WORD": "5",
    "NEAR_LIGHT": "0.25",  # lights nearer to a segment than this fraction of it are near
    "FLAG_COVERED": "1.0",
    "FLAG_VALID": "2.0",
    "ENVIRONMENT_CONSTANT": "0",
    "ENVIRONMENT_GRADIENT": "1",
    "ENVIRONMENT_CHECKERBOARD": "2",
    "ENVIRONMENT_IMAGE": "3",
    "NEUTRAL_F90": repr(NEUTRAL_F90),
    "NEUTRAL_START": repr(NEUTRAL_START),
    "NEUTRAL_DESATURATION": repr(NEUTRAL_DESATURATION),
    "AGX_LOW": repr(AGX_STOPS[0]),
    "AGX_HIGH": repr(AGX_STOPS[1]),
    "AGX_MIDDLE_GRAY": repr(AGX_MIDDLE_GRAY),
    "AGX_MIX": f"vec3{AGX_MIX}",
    "AGX_TOE": repr(AGX_TOE),
    "AGX_SHOULDER": repr(AGX_SHOULDER),
    "AGX_SLOPE": repr(AGX_SLOPE),
    "AGX_DISPLAY": repr(AGX_DISPLAY),
    "HARMONIC_0": repr(BAND_0),
    "HARMONIC_1": repr(BAND_1),
    "HARMONIC_2": repr(BAND_2),
    "HARMONIC_2_ZONAL": repr(BAND_2_ZONAL),
    "LEAST_ENTERING_COSINE": repr(LEAST_COSINE),
    "LEAST_EVENT_DEPTH": repr(LEAST_EVENT_DEPTH),
    "MOST_BESIDE": repr(SAMPLE_REACH),
    "AZIMUTHS": repr(AZIMUTHS),
    "CLEARCOAT_IOR": repr(CLEARCOAT_IOR),
    "GROUND_TOLERANCE": repr(TOLERANCE),
    "FILM_CENTERS": f"vec3{FILM_CENTERS}",
    "FILM_WIDTHS": f"vec3{FILM_WIDTHS}",
    "FILM_BLUE_CENTER": repr(FILM_BLUE_CENTER),
    "FILM_BLUE_WIDTH": repr(FILM_BLUE_WIDTH),
    "FILM_BLUE_SHARE": repr(FILM_BLUE_SHARE),
    "FILM_TO_RGB": f"mat3{tuple(FILM_TO_RGB.T.ravel().tolist())}",
    "FILM_SHORT": repr(FILM_COHERENT[0]),
    "FILM_LONG": repr(FILM_COHERENT[1]),
    "FILM_ORDERS": str(FILM_ORDERS),
    "HIERARCHY_WIDTH_BITS": str(HIERARCHY_WIDTH_BITS),
    "HIERARCHY_STEPS": "32767.5",  # of the grid of bounds, from the middle of a hierarchy to its end
    "INTERIOR_SIZE": str(INTERIOR_SIZE),
    "MIRROR_TOLERANCE": "1e-3",  # from a ground to where a rasterizer may see it, as a fraction of the scene
    "MIRROR_MARGIN": "1e-4",  # from a ground to where its mirrored rays start, as a fraction of the scene
    "PHOTON_WIDTH": f"{PHOTON_WIDTH}u",
    "MOST_PHOTON_HITS": str(MOST_PHOTON_HITS),
    "SURFACE_OFFSET": "1e-6",  # from a surface to where the next segment of a ray starts, as a fraction of the scene
    "TOUCHING": "1e-6",  # axial depth between surfaces that count as one interface
    "LEAST_ACROSS": repr(LEAST_ACROSS),
    "LEAST_BREADTH": repr(LEAST_BREADTH),
    "MOST_LOOKUPS": f"{MOST_LOOKUPS:.1f}",
    "ALPHA_OF_DEVIATION": repr(ALPHA_OF_DEVIATION),
    "REFLECTANCE_TABLE_SIZE": f"{TABLE_SIZE:.1f}",
    **{f"{name.upper()}_BINDING": str(point) for name, point in STORAGE_BINDINGS.items()},
    "COMPUTE_GROUP": str(COMPUTE_GROUP),
    "SMALLEST_HIGHLIGHT": "1e-3",  # alpha of the microfacets in which points of light are mirrored
    "PIXEL_PARTS": str(PIXEL_PARTS),
    "ENLARGED_ACROSS": str(ENLARGED_ACROSS),
    "LEAST_VISIBLE": "0.25",  # fraction of an average over a sample by which a highlight at a silhouette is divided
    "FAINTEST_HIGHLIGHT": "1e-6",  # of a light's irradiance, in 1/sr, for which occluders are not looked for
}
