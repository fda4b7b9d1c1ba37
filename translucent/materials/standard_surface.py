"""Autodesk Standard Surface 1.0.1 as a MaterialX document (``standard_surface``), written and read.

Inputs: transmission 1, transmission_color, transmission_depth, transmission_scatter, transmission_scatter_anisotropy,
specular_IOR, specular_roughness. Semantics, formulas, source and losses: `translucent.materials.materialx`.
A depth of 0 makes the color a tint of the surface: it is read as a medium without extinction.
"""

from __future__ import annotations

from translucent.materials.materialx import Shader, read_shader, write_shader
from translucent.media.medium import Medium

SHADER = Shader("standard_surface", weight="transmission", ior="specular_IOR", title="Standard Surface")


def write_standard_surface(
    medium: Medium, distance: float | None = None, name: str = "translucent", unit: str = "m", roughness: float = 0.0
) -> str:
    """Write a MaterialX document with a Standard Surface around this medium; parameters as in `write_openpbr`."""
    return write_shader(SHADER, medium, distance, name, unit, roughness)


def read_standard_surface(text: str, unit: str = "m") -> Medium:
    """Read the medium of the first Standard Surface in a MaterialX document; errors as in `read_openpbr`."""
    return read_shader(SHADER, text, unit)
