"""Media of every kind, and when two are alike."""

from __future__ import annotations

import numpy as np

import translucent as tl

COLOR = (0.18, 0.62, 0.35)
JADE = tl.Medium.from_color(COLOR, distance=0.02, ior=1.6)
MILK = tl.Medium(absorption=(1.4, 2.5, 14.2), scattering=(700, 1220, 1900), anisotropy=0.25, ior=1.3)
GLOW = tl.Medium(absorption=(1, 2, 3), scattering=(3, 0, 1), emission=(0.5, 2, 0), anisotropy=-0.4)
CLEAR = tl.Medium(ior=1.33)


def close(found: tl.Medium, expected: tl.Medium, rtol: float = 1e-12) -> None:
    scale = float(expected.extinction.max())
    for field in ("absorption", "scattering"):
        np.testing.assert_allclose(getattr(found, field), getattr(expected, field), rtol=0, atol=rtol * scale)
