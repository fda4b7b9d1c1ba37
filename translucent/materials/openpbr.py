"""OpenPBR Surface 1.1 as a MaterialX document (``open_pbr_surface``), written and read.

Inputs: transmission_weight 1, transmission_color, transmission_depth, transmission_scatter,
transmission_scatter_anisotropy, specular_ior, specular_roughness.
Semantics, formulas, source, losses: `translucent.materials.materialx`.
A depth of 0 makes the color a tint of the surface: it is read as a medium without extinction.
"""

from __future__ import annotations

from translucent.materials.materialx import Shader, read_shader, write_shader
from translucent.media.medium import Medium

SHADER = Shader(
    "open_pbr_surface", title="OpenPBR", weight="transmission_weight", ior="specular_ior", last_version=(1, 1)
)


def write_openpbr(
    medium: Medium, distance: float | None = None, name: str = "translucent", unit: str = "m", roughness: float = 0.0
) -> str:
    """Write a MaterialX document with an OpenPBR surface around this medium.

    Parameters
    ----------
    medium : Medium
        Emission is lost.
    distance : float, optional
        Where the color is stated, in metres; None: where the densest channel lets 1/e pass.
    name : str
        Name of the material, letters, digits and underscores.
    unit : str
        Unit of the scene's lengths, for the depth.
    roughness : float
        Of the surface, 0 to 1.
    """
    return write_shader(SHADER, medium, distance, name, unit, roughness)


def read_openpbr(text: str, unit: str = "m") -> Medium:
    """Read the medium of the first OpenPBR surface in a MaterialX document, whose lengths are in `unit`.

    Raises
    ------
    InputError
        If the document is broken, has no such surface, or inputs are out of range or not constant; or if it is of
        version 1.2 or later and scatters.
    """
    return read_shader(SHADER, text, unit)
