"""three.js: a MeshPhysicalMaterial, written and read.

Formula: sigma_t = -ln(attenuationColor) / attenuationDistance, as here and in glTF; colors are linear where their space
is named. Lengths are in units of the scene, a metre here. Source: three.js, MeshPhysicalMaterial and the shader chunk
transmission_pars_fragment (volumeAttenuation), after the glTF sample viewer.

Not carried over: scattering (its extinction is written), anisotropy, emission; an index of refraction above 2.333,
which is the largest of three.js. `thickness` is one number for the whole mesh, the distance that is stated: the module
in web/ of this project measures it for each pixel instead, and takes the same properties.
"""

from __future__ import annotations

import math

from translucent.materials.snippet import stated, stated_color, stated_length
from translucent.media.medium import Medium, color_at, extinction_at

#: Largest index of refraction of a MeshPhysicalMaterial.
LARGEST_IOR = 2.333

_WHAT = "three.js material"


def threejs_text(medium: Medium, distance: float, roughness: float = 0.0) -> str:
    """JavaScript that makes the material; the color is stated at `distance` in metres, see `color_at`."""
    color, metres = color_at(medium, distance)
    red, green, blue = (repr(channel) for channel in color.tolist())
    lines = [
        "// Lengths in metres. thickness is one number for the whole mesh; TranslucentMaterial, of translucent's web",
        "// module, takes the same properties and measures it in each pixel.",
        "const material = new THREE.MeshPhysicalMaterial({",
        f"  roughness: {roughness!r},",
        "  metalness: 0,",
        "  transmission: 1,",
        f"  ior: {min(float(medium.ior), LARGEST_IOR)!r},",
        f"  thickness: {float(distance)!r},",
    ]
    if medium.extinction.any() and math.isfinite(metres):
        lines += [
            f"  attenuationColor: new THREE.Color().setRGB({red}, {green}, {blue}, THREE.LinearSRGBColorSpace),",
            f"  attenuationDistance: {metres!r},",
        ]
    return "\n".join([*lines, "});", ""])


def read_threejs(text: str) -> Medium:
    """Read the medium of such a text; raises `InputError` if it is none."""
    ior = float(stated(_WHAT, text, "  ior:")[0])
    if "attenuationDistance:" not in text:
        return Medium(ior=ior)
    distance = stated_length(_WHAT, text, "attenuationDistance:")
    return Medium(absorption=extinction_at(stated_color(_WHAT, text, "setRGB("), distance), ior=ior)
