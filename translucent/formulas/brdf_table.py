"""Reflectance of a rough interface under uniform light: a table for the split-sum approximation.

With Schlick's Fresnel term F = F0 + (F90 - F0) (1 - v.h)^5 the reflectance for light from everywhere is
``F0 * scale + F90 * bias`` (Karis 2013, "Real Shading in Unreal Engine 4"). The microfacets are GGX with alpha =
roughness^2 and height-correlated shadowing and masking (Heitz 2014, eq. 99), as in glTF 2.0, appendix B.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas.stored import stored

#: Rows (roughness) and columns (cosine) of the table; both ends are in it.
TABLE_SIZE = 64


def brdf_table() -> npt.NDArray[np.float32]:
    """(64, 64, 2) float32: scale and bias at roughness i / 63 in row i and cosine j / 63 in column j; stored."""
    return stored("brdf")
