"""Textures that darken around a middle, by a formula that rays can evaluate where no texture is read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.scene.texture import Texture

#: Texels each way.
SIZE = 64


@dataclass(frozen=True, eq=False)
class Falloff(Texture):
    """Texture of a share of gray: 1 around its middle, `far` at the radius of its edges and beyond.

    Attributes
    ----------
    start : float
        Radius in texture coordinates, 0 to 1/2, at which it begins to get darker, by a smooth step.
    far : float
        Share at the radius 1/2.
    """

    start: float = 0.0
    far: float = 1.0

    @classmethod
    def around(cls, start: float, far: float) -> Falloff:
        """Falloff from a radius on, to a share."""
        place = (np.arange(SIZE) + 0.5) / SIZE - 0.5
        share = np.clip((np.hypot(place[:, None], place) - start) / (0.5 - start), 0.0, 1.0)
        values = 1.0 + (far - 1.0) * share * share * (3.0 - 2.0 * share)
        return cls(np.repeat(values[..., None], 3, axis=-1), wrap=("clamp", "clamp"), start=start, far=far)
