"""Formulas of lights, in float64. Each has a twin of the same name in ``shaders/lib/light.glsl``.

References
----------
KHR_lights_punctual (Khronos 2020), "Inner and outer cone angles".
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array

#: Cone of a light that shines alike in all directions; see `light_cone`.
ALL_AROUND = (0.0, 0.0, 0.0, 1.0)


def light_cone(direction: npt.ArrayLike, inner: float, outer: float) -> Array:
    """(4,): a cone as `cone_attenuation` takes it.

    The unit `direction` (3,) times k, with k^2 = 1 / (2 (cos inner - cos outer)), and
    (1 - cos outer) / (cos inner - cos outer); half angles in radians, 0 <= inner < outer <= pi / 2.
    """
    # Neither difference of cosines loses digits, however narrow the cone is.
    fall = 2.0 * np.sin(0.5 * (outer + inner)) * np.sin(0.5 * (outer - inner))
    return np.array([*np.asarray(direction) * np.sqrt(0.5 / fall), 2.0 * np.sin(0.5 * outer) ** 2 / fall])


def cone_attenuation(travel: npt.ArrayLike, cone: npt.ArrayLike) -> Array:
    """Share of a light's intensity in the unit directions `travel` (..., 3): (...).

    KHR_lights_punctual: the square of (cos - cos outer) / (cos inner - cos outer), within 0 to 1. Cosines come from
    chords, 1 - cos = |travel - direction|^2 / 2, which have their digits in narrow cones, too.
    """
    cone = np.asarray(cone, dtype=np.float64)
    axis = cone[..., :3]
    with np.errstate(under="ignore"):
        apart = np.linalg.norm(axis, axis=-1, keepdims=True) * np.asarray(travel, dtype=np.float64) - axis
        level = np.clip(cone[..., 3] - (apart**2).sum(axis=-1), 0.0, 1.0)
        return np.asarray(level * level)
