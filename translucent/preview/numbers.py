"""Text of the numbers in panels, in the words and to the digits of ``translucent extinction`` and ``render``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.formulas.color import linear_to_srgb, srgb_to_linear, to_hex
from translucent.frames.appearance import average_color
from translucent.media.conversion import summary
from translucent.media.medium import Medium, color_at
from translucent.preview.document import Material, Triple
from translucent.preview.scenes import medium_of
from translucent.units import metres_per_unit

#: Darkest linear channel of the color field: 0 has no finite extinction. See `translucent.media.conversion.CLAMP`.
DARKEST = 1e-4


def triple_text(values: npt.ArrayLike) -> str:
    """Text of three numbers, to the digits that ``translucent extinction`` prints."""
    return " ".join(f"{value:.5g}" for value in np.asarray(values, dtype=np.float64).tolist())


def length_text(metres: float, unit: str) -> str:
    """Text of a length in the user's unit, to five digits."""
    return f"{metres / metres_per_unit(unit):.5g} {unit}"


def told(material: Material) -> dict[str, Any]:
    """Facts that ``translucent extinction`` prints of this medium."""
    medium = medium_of(material)
    color, distance = np.asarray(material.color), material.distance
    if material.source != "color" or medium.scatters:
        color = medium.transmittance(distance)
    if not (color > 0).all():  # too dark to be stated there
        color, distance = color_at(medium, None)
    return summary(color, float(distance), medium.extinction)


def extinction_lines(material: Material) -> list[tuple[str, str]]:
    """Names and values, as ``translucent extinction`` prints them."""
    facts = told(material)
    infinite = [[np.inf if v is None else v for v in facts[key]] for key in ("mean_free_path", "half_value_thickness")]
    return [
        (
            "color",
            f"{triple_text(facts['color'])} linear, {to_hex(facts['color'])} sRGB, after {facts['distance']:g} m",
        ),
        ("extinction", f"{triple_text(facts['extinction'])} 1/m"),
        ("mean free path", f"{triple_text(infinite[0])} m"),
        ("half-value", f"{triple_text(infinite[1])} m"),
    ]


def to_display(color: Triple) -> Triple:
    """Encode a linear color in sRGB, as a color field shows it."""
    red, green, blue = np.clip(linear_to_srgb(color), 0.0, 1.0).tolist()
    return red, green, blue


def from_display(encoded: npt.ArrayLike) -> Triple:
    """Decode a color field's 8-bit value to linear; black is raised to the darkest color of a medium."""
    levels = np.rint(np.clip(np.asarray(encoded, dtype=np.float64), 0.0, 1.0) * 255.0) / 255.0
    red, green, blue = np.maximum(srgb_to_linear(levels), DARKEST).tolist()
    return red, green, blue


def swatches(material: Material) -> list[tuple[float, str]]:
    """Distances in metres, and the hex colors of white light after them."""
    facts = told(material)
    return [(float(factor) * facts["distance"], to_hex(row)) for factor, row in facts["transmittance"].items()]


@dataclass(frozen=True, eq=False)
class Seen:
    """Thickness of a model in its picture.

    Attributes
    ----------
    thickness : (n,) float64
        Of the covered, valid pixels, in metres.
    counts, edges : ndarray
        Their histogram.
    pixels, invalid : int
        Covered pixels, and those of all that cannot be trusted.
    """

    thickness: Array
    counts: Array
    edges: Array
    pixels: int
    invalid: int

    @classmethod
    def of(cls, thickness: Array, pixels: int, invalid: int) -> Seen:
        """Thickness statistics of a frame, with a histogram of 48 bins."""
        most = float(thickness.max(initial=0.0)) or 1.0
        counts, edges = np.histogram(thickness, bins=48, range=(0.0, most))
        return cls(thickness, counts / max(int(counts.max()), 1), edges, pixels, invalid)

    def average_hex(self, medium: Medium) -> str:
        """The model's average color before white light."""
        return to_hex(average_color(self.thickness, medium)) if self.thickness.size else "#ffffff"


def transmittance_curves(material: Material, most: float) -> tuple[Array, Array]:
    """Distances (64,) from 0 to `most` metres, and transmittance (64, 3) there."""
    distances = np.linspace(0.0, most, 64)
    return distances, medium_of(material).transmittance(distances)
