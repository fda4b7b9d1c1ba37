"""Unity's High Definition Render Pipeline: transmittance color at an absorption distance, of the Lit shader.

Formula: sigma_t = -ln(color) / distance, as here; the shader adds 2^-24 to the color, so that black is finite. The
distance is in metres. Properties, by their names in the shader's source: _TransmittanceColor, _ATDistance, _Ior (1 to
2.5 in the inspector). They have an effect only with the surface type Transparent, an alpha below 1 and a refraction
model, which are chosen in the inspector. Unity's color properties are sRGB-encoded; the shader gets them linear.
The surface: _Ior and _Smoothness, which is 1 - roughness (the square root of the GGX alpha, as here).
Source: Unity HDRP, HDRP/Lit shader (properties), VolumeRendering (absorption from a color at a distance); manual, "Lit
shader", "Create a refractive material".

Not carried over: scattering (its extinction is written), anisotropy, emission; thickness is the shader's own, of the
refraction model.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from translucent.formulas.color import linear_to_srgb, srgb_to_linear
from translucent.materials.snippet import stated, stated_color, stated_length
from translucent.media.medium import Medium, color_at, extinction_at


def from_unity(color: npt.ArrayLike, distance: float, ior: float = 1.5) -> Medium:
    """Medium of a transmittance color (sRGB-encoded, 0..1, as Unity stores it) at a distance in metres."""
    return Medium(absorption=extinction_at(srgb_to_linear(color), distance), ior=ior)


def unity_text(medium: Medium, distance: float | None = None, roughness: float = 0.0) -> str:
    """C# that sets the properties on a ``material``; the color is stated at `distance` in metres, see `color_at`."""
    color, metres = color_at(medium, distance)
    red, green, blue = np.clip(linear_to_srgb(color), 0.0, 1.0)
    return (
        "// HDRP/Lit, with Surface Type: Transparent, Base Map alpha below 1, Refraction Model: Planar or Sphere.\n"
        f'material.SetColor("_TransmittanceColor", new Color({red:.9g}f, {green:.9g}f, {blue:.9g}f)); // sRGB\n'
        f'material.SetFloat("_ATDistance", {metres if math.isfinite(metres) else 1.0:.9g}f); // metres\n'
        f'material.SetFloat("_Ior", {medium.ior:.9g}f);\n'
        f'material.SetFloat("_Smoothness", {1.0 - roughness:.9g}f); // 1 - roughness\n'
    )


def read_unity(text: str) -> Medium:
    """Read the medium of such a text, as far as nine digits go; raises `InputError` if it is none."""
    what = "Unity material"
    distance, ior = stated_length(what, text, '"_ATDistance"'), float(stated(what, text, '"_Ior"')[0])
    return from_unity(stated_color(what, text, '"_TransmittanceColor", new Color('), distance, ior)
