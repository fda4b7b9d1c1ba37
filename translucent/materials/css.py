"""CSS: the color of a medium at a distance as custom properties, and a gradient. Written only.

Formula: the gradient runs from no thickness to twice the distance, T(x) = exp(-sigma_t x) at each stop. Colors are
``color(srgb-linear ...)`` (CSS Color 4), with the nearest hex color for older browsers.
Not carried over: everything but the look in front of white; CSS has no thickness.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.formulas.color import to_hex
from translucent.media.medium import Medium

_STOPS = 9


def css_text(medium: Medium, color: npt.ArrayLike, distance: float) -> str:
    """Custom properties and a gradient for the linear `color` that the medium has at `distance` metres."""
    red, green, blue = np.asarray(color, dtype=np.float64).tolist()
    stops = ", ".join(to_hex(row) for row in medium.transmittance(np.linspace(0.0, 2.0 * distance, _STOPS)))
    return (
        ":root {\n"
        f"  --translucent-color: {to_hex(color)};\n"
        f"  --translucent-color: color(srgb-linear {red:.6g} {green:.6g} {blue:.6g});\n"
        f"  --translucent-distance: {distance:.6g}; /* metres */\n"
        f"  --translucent-gradient: linear-gradient(to right, {stops}); /* 0 to {2.0 * distance:.6g} m */\n"
        "}\n"
    )
