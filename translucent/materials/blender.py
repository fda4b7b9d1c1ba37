"""Blender: a material of Glass BSDF and a volume, Volume Absorption or Principled Volume; written and read.

Their colors are **not** colors at a distance. Volume Absorption has sigma_a = (1 - Color) Density, which is not
-ln(Color) Density: with Color 0.5 and Density 1 it lets exp(-0.5) = 0.61 pass after one unit, not 0.5. So a color that
is picked for a distance must be converted, as here.

Formulas, per unit of the scene (a metre unless the scene's unit scale says otherwise):
Volume Absorption: sigma_a = (1 - Color) Density.
Principled Volume: sigma_s = Color Density; sigma_a = (1 - Color) (1 - sqrt(Absorption Color)) Density; q = Emission
Strength times Emission Color; Anisotropy = g.
Inverted: Density is the largest channel of sigma_a (absorption) or of sigma_t (principled), the smallest for which all
colors are in 0..1. Colors are linear, as sockets store them.
The surface is a white Glass BSDF with the IOR and the Roughness, the square root of the GGX alpha as here; none where
the index is 1 and nothing is rough, since light then enters as it comes. Of its distributions Multiscatter GGX loses
least: a frosted ball (roughness 0.4) in a white world sends on 99 % of the light, and 90 % by GGX alone. It divides
single scattering by its albedo (Turquin 2019), which is not reciprocal: of diffuse light inside, 3 % more leaves than
in a walk among microfacets (Heitz et al. 2016) at roughness 0.4 and ior 1.45, and 17 % more at 0.6. So soap is 2 %
brighter than by our paths in the studio, 8 to 11 % at roughness 0.6, and polished soap 0.5 %. By GGX alone it is 10 %
darker, by Beckmann 3 %.
Where the medium scatters or the surface is rough, the bounces of the scene are raised to `BOUNCES`: Blender starts
with none in volumes, and 4 among mirror images inside. A ball of 4 cm of whole milk (mean free path 0.4 mm) then shows
no more than the mirror image on it, 3 % of white instead of 95 %; it is 7 % too dark with 256, and 1 % with 1024.
Frosted glass of roughness 0.4 is 7 % too dark as Blender starts.
Source: Blender manual, Glass BSDF, Volume Absorption, Principled Volume, "Volume Coefficients", Light Paths. The tests
render the snippet in Cycles where Blender is installed; ``tools/measure_blender.py`` compares balls with our truth.

Not carried over: heterogeneous density.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.materials.target import ExportTarget, roughness_behind, stated
from translucent.media.medium import Medium

#: Largest number of bounces in Cycles.
BOUNCES = 1024


def absorption_node(medium: Medium) -> tuple[Array, float]:
    """Color (3,) and Density in 1/m of a Volume Absorption node with the absorption of the medium."""
    sigma = np.asarray(medium.absorption)
    density = float(sigma.max())
    return (1.0 - sigma / density if density > 0 else np.ones(3)), density


def from_absorption_node(color: npt.ArrayLike, density: float) -> Medium:
    """Medium of a Volume Absorption node; raises `InputError` outside 0 <= Color <= 1 and Density >= 0."""
    return Medium(absorption=(1.0 - _color("Color", color)) * _density(density))


def principled_node(medium: Medium) -> tuple[Array, Array, float]:
    """Color (3,), Absorption Color (3,) and Density in 1/m of a Principled Volume node for the medium."""
    density = float(medium.extinction.max())
    if density == 0:
        return np.zeros(3), np.ones(3), 0.0
    scattering, absorption = np.asarray(medium.scattering), np.asarray(medium.absorption)
    left = density - scattering
    # A channel that scatters all that it takes has no absorption, whatever its absorption color.
    fraction = np.where(left > 0, absorption / np.where(left > 0, left, 1.0), 0.0)
    return scattering / density, (1.0 - np.minimum(fraction, 1.0)) ** 2, density


def from_principled_node(
    color: npt.ArrayLike, absorption_color: npt.ArrayLike, density: float, anisotropy: float = 0.0
) -> Medium:
    """Medium of a Principled Volume node without emission; raises `InputError` where a value is out of its range."""
    scatter, absorb = _color("Color", color), _color("Absorption Color", absorption_color)
    return Medium(
        absorption=(1.0 - scatter) * (1.0 - np.sqrt(absorb)) * _density(density),
        scattering=scatter * density,
        anisotropy=anisotropy,
    )


def _color(socket: str, value: npt.ArrayLike) -> Array:
    triple = np.asarray(value, dtype=np.float64)
    if triple.shape != (3,) or not ((triple >= 0).all() and (triple <= 1).all()):
        raise InputError(
            f"Blender {socket} {value!r}",
            "the color must be three numbers in 0..1",
            "give the linear color of the socket",
        )
    return triple


def _density(value: float) -> float:
    if not 0 <= value < np.inf:
        raise InputError(
            f"Blender Density {value!r}",
            "the density is negative or not finite",
            "give the density of the Blender node",
        )
    return float(value)


def blender_snippet(medium: Medium, roughness: float = 0.0) -> str:
    """Python for Blender's text editor that makes a material with this surface and volume; scene unit: metre."""
    if medium.scatters or medium.emits:
        color, absorption, density = principled_node(medium)
        emission = np.asarray(medium.emission)
        strength = float(emission.max())
        node = "ShaderNodeVolumePrincipled"
        sockets = {
            "Color": _rgba(color),
            "Absorption Color": _rgba(absorption),
            "Density": repr(density),
            "Anisotropy": repr(float(medium.anisotropy)),
            "Emission Strength": repr(strength),
            "Emission Color": _rgba(emission / strength if strength > 0 else np.ones(3)),
        }
    else:
        color, density = absorption_node(medium)
        node, sockets = "ShaderNodeVolumeAbsorption", {"Color": _rgba(color), "Density": repr(density)}
    lines = [
        "# Blender's volume colors are no colors at a distance: sigma_a = (1 - Color) * Density, per metre.",
        "import bpy",
        "",
        "material = bpy.data.materials.new('translucent')",
        "if material.node_tree is None:",
        "    material.use_nodes = True  # before Blender 5",
        "nodes, links = material.node_tree.nodes, material.node_tree.links",
        "nodes.clear()",
        'output = nodes.new("ShaderNodeOutputMaterial")',
        f'volume = nodes.new("{node}")',
        *(f'volume.inputs["{socket}"].default_value = {value}' for socket, value in sockets.items()),
        'links.new(volume.outputs["Volume"], output.inputs["Volume"])',
    ]
    if medium.ior > 1.0 or roughness > 0.0:
        lines += [
            'surface = nodes.new("ShaderNodeBsdfGlass")',
            'surface.distribution = "MULTI_GGX"',
            'surface.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)',
            f'surface.inputs["IOR"].default_value = {float(medium.ior)!r}',
            f'surface.inputs["Roughness"].default_value = {roughness!r}',
            'links.new(surface.outputs["BSDF"], output.inputs["Surface"])',
        ]
    if medium.scatters or roughness > 0.0:
        lines += [
            "# As Cycles is set up, light ends in volumes, and soon in frosted glass. More bounces, for the scene:",
            'cycles = getattr(bpy.context.scene, "cycles", None)',
            'for kind in ("max", "volume", "glossy", "transmission") if cycles else ():',
            f'    setattr(cycles, f"{{kind}}_bounces", max({BOUNCES}, getattr(cycles, f"{{kind}}_bounces")))',
        ]
    return "\n".join(lines) + "\n"


def read_blender(text: str, _: str = "m") -> Medium:
    """Read the medium of Python for Blender, which is not run; raises `InputError` if it has none."""

    def socket(node: str, name: str, count: int = 1, default: float | None = None) -> Array:
        return stated("Blender material", text, f'{node}.inputs["{name}"].default_value', count, default)

    ior, density = float(socket("surface", "IOR", default=1.0)[0]), float(socket("volume", "Density")[0])
    color = socket("volume", "Color", 3)
    if "ShaderNodeVolumePrincipled" not in text:
        return Medium(absorption=from_absorption_node(color, density).absorption, ior=ior)
    anisotropy = float(socket("volume", "Anisotropy", default=0.0)[0])
    found = from_principled_node(color, socket("volume", "Absorption Color", 3), density, anisotropy)
    emission = socket("volume", "Emission Strength", default=0.0) * socket("volume", "Emission Color", 3, 1.0)
    return Medium(found.absorption, found.scattering, emission, anisotropy, ior)


def _rgba(color: Array) -> str:
    return f"({', '.join(repr(channel) for channel in [*color.tolist(), 1.0])})"


BLENDER = ExportTarget(
    "Blender",
    lambda medium, _, roughness: blender_snippet(medium, roughness),
    ".py",
    read_blender,
    roughness_behind('surface.inputs["Roughness"].default_value'),
)
