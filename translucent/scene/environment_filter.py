"""Prefiltered environments for rough reflection and for diffuse irradiance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap
from translucent.scene.lobes import KEPT, convolved, irradiance_map, sized

#: Blurred pictures between roughness 0 and 1, and their rows and columns.
LEVELS = 8
LEVEL_SIZE = (128, 256)


@dataclass(frozen=True, eq=False)
class FilteredEnvironment:
    """Prefiltered environment: blurred reflections and irradiance, before its rotation and exposure. Row 0 is straight
    up (+Y).

    Attributes
    ----------
    sharp : EnvironmentMap
        As a mirror reflects it, in full resolution.
    levels : (n, h, w, 3) float32
        As rough surfaces reflect it around each direction: its mean over a GGX lobe.
    roughness : (n,) float64
        Of the levels: 1/n, 2/n, ... 1. The alpha of GGX is its square.
    irradiance : (h, w, 3) float32
        On a surface with each normal: the integral of radiance times cosine.
    """

    sharp: EnvironmentMap
    levels: npt.NDArray[np.float32]
    roughness: Array
    irradiance: npt.NDArray[np.float32]


def filtered(environment: Environment) -> FilteredEnvironment:
    """Prefilter an environment for surfaces: done once for each picture, in less than a second.

    The lobe is that of the split-sum approximation (Karis 2013, "Real Shading in Unreal Engine 4", section on image
    based lighting): seen along the normal and the reflected direction at once (n = v = r), GGX half vectors h, whose
    density is D(h) n.h / (4 v.h) = D(h) / 4 around r, weighted with n.l. It is a mean: a uniform environment stays what
    it is, and so does the integral over all directions.
    """
    return _filtered(environment.light_map)


@lru_cache(maxsize=KEPT)
def _filtered(source: EnvironmentMap) -> FilteredEnvironment:
    roughness = np.arange(1, LEVELS + 1) / LEVELS
    color = source.pixels[0, 0]
    if (source.pixels == color).all():  # which blurring leaves as it is
        levels = np.full((LEVELS, *LEVEL_SIZE, 3), color, dtype=np.float32)
    else:
        pixels = sized(source, LEVEL_SIZE)
        with np.errstate(under="ignore"):
            blurred = [convolved(pixels, partial(ggx_lobe, alpha=alpha)) for alpha in roughness**2]
            levels = np.stack(blurred).astype(np.float32)
    return FilteredEnvironment(source, levels, roughness, irradiance_map(source).pixels.astype(np.float32))


def ggx_lobe(cosine: npt.ArrayLike, alpha: float) -> Array:
    """GGX weight of light at an angle of this cosine to the reflected direction, up to a factor: D(h) n.l, n = v = r.

    The half vector has half the angle: (n.h)^2 = (1 + cos) / 2. Walter et al. 2007, eq. 33, for D.
    """
    c = np.asarray(cosine, dtype=np.float64)
    falloff = 1.0 + 0.5 * (1.0 + c) * (alpha * alpha - 1.0)
    return np.maximum(c, 0.0) / (falloff * falloff)
