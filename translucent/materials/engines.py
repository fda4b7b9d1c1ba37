"""Texts to paste into engines: three.js, Godot, Unity, Unreal and CSS, written and, but for CSS, read; JSON and glTF.

Emission, anisotropy, and scattering as such are not carried over: the extinction of a medium that scatters is written.

three.js: a MeshPhysicalMaterial. sigma_t = -ln(attenuationColor) / attenuationDistance, as here and in glTF; colors are
linear where their space is named. Lengths are in units of the scene, a metre here. An index of refraction above 2.333,
the largest of three.js, is lost. `thickness` is one number for the whole mesh, the distance that is stated: the module
in web/ of this project measures it for each pixel instead, and takes the same properties. Source: three.js,
MeshPhysicalMaterial and the shader chunk transmission_pars_fragment (volumeAttenuation), after the glTF sample viewer.

Godot 4: a spatial shader that lets the screen behind the surface through, dimmed by the medium, since
StandardMaterial3D has no absorption by length and its refraction is an offset on the screen. exp(-sigma_t d) with d a
constant thickness, or where the uniform `exact` is set, that of a texture in metres, as the pass of docs/lifting.md
makes it; Schlick's Fresnel with F0 = ((n - 1) / (n + 1))^2, which Godot's SPECULAR states as 0.16 SPECULAR^2. What is
behind is seen straight on; a surface of index above 2.33 reflects as one of 2.33. Source: Godot documentation, Spatial
shaders, Screen-reading shaders. Tests compile and run it as GLSL; it is not run in Godot.

Unity's High Definition Render Pipeline: transmittance color at an absorption distance, of the Lit shader. sigma_t =
-ln(color) / distance, as here; the shader adds 2^-24 to the color, so that black is finite. The distance is in metres.
Properties, by their names in the shader's source: _TransmittanceColor, _ATDistance, _Ior (1 to 2.5 in the inspector),
_Smoothness = 1 - roughness. They have an effect only with the surface type Transparent, an alpha below 1 and a
refraction model, which are chosen in the inspector. Unity's color properties are sRGB-encoded; the shader gets them
linear. Thickness is the shader's own, of the refraction model. Source: Unity HDRP, HDRP/Lit shader (properties),
VolumeRendering (absorption from a color at a distance); manual, "Lit shader", "Create a refractive material".

Unreal Engine's Substrate: mean free path in centimeters, or transmittance at a thickness. MFP = 1 / sigma_t, and for a
transmittance T (seen along the normal) at a thickness t: MFP = -t / ln(T). The node Transmittance-To-MeanFreePath takes
T and t in **centimeters** (0.01 by default) and gives the MFP of a slab. F0 = ((n - 1) / (n + 1))^2 is what a slab
reflects at normal incidence; the index n itself is for the material's refraction. A slab derives scattering from its
diffuse albedo. A channel without extinction has an infinite mean free path; the text shows `LONGEST_CM` there, as
engines take finite numbers. Source: Unreal Engine documentation, Substrate Transmittance-To-MeanFreePath, Substrate
Slab BSDF, Refraction mode.

CSS: the color of a medium at a distance as custom properties, and a gradient from no thickness to twice the distance,
T(x) = exp(-sigma_t x) at each stop. Colors are ``color(srgb-linear ...)`` (CSS Color 4), with the nearest hex color for
older browsers. CSS has no thickness: all but the look in front of white is lost.

JSON: complete media, without loss; fields are those of `Medium`, in 1/m and linear Rec.709. A glTF material is an entry
of a file's ``materials``; reading and writing whole files: `translucent.gltf.materials` and `translucent.gltf.write`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.files.reading import json_value
from translucent.formulas.color import linear_to_srgb, srgb_to_linear, to_hex
from translucent.formulas.phase import parse_phase
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import materials_of
from translucent.gltf.write import volume_extensions
from translucent.materials.target import ExportTarget, roughness_behind, stated, stated_color, stated_length
from translucent.media.medium import Medium, color_at, extinction_at

#: Largest index of refraction of a MeshPhysicalMaterial of three.js.
LARGEST_IOR = 2.333
#: Mean free path in cm that the text for Unreal gives to a channel without extinction: 10 km.
LONGEST_CM = 1e6
CENTIMETERS_PER_METRE = 100.0

#: Stops of the gradient of CSS.
_STOPS = 9

_GODOT_ROUGHNESS = roughness_behind("uniform float roughness : hint_range(0.0, 1.0) =")

#: Fields of a medium in JSON.
_TRIPLES = ("absorption", "scattering", "emission")
_NUMBERS = ("anisotropy", "ior")
_PHASE = "phase"


def threejs_text(medium: Medium, distance: float, roughness: float) -> str:
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


def read_threejs(text: str, _: str = "m") -> Medium:
    """Read the medium of a material for three.js; raises `InputError` if it has none."""
    what = "three.js material"
    ior = float(stated(what, text, "  ior:")[0])
    if "attenuationDistance:" not in text:
        return Medium(ior=ior)
    distance = stated_length(what, text, "attenuationDistance:")
    return Medium(absorption=extinction_at(stated_color(what, text, "setRGB("), distance), ior=ior)


THREEJS = ExportTarget("three.js", threejs_text, ".js", read_threejs, roughness_behind("  roughness:"))


def godot_text(medium: Medium, distance: float, roughness: float) -> str:
    """A .gdshader whose thickness is `distance` in metres unless a texture says more."""
    extinction = ", ".join(repr(value) for value in np.asarray(medium.extinction).tolist())
    return f"""shader_type spatial;
// For Godot 4. Lengths in metres; thickness is one number for the whole mesh unless exact is set, and the texture then
// has metres in red, as the pass of translucent's docs/lifting.md measures them.
uniform vec3 extinction = vec3({extinction}); // 1/m
uniform float ior = {float(medium.ior)!r};
uniform float roughness : hint_range(0.0, 1.0) = {roughness!r};
uniform float thickness = {float(distance)!r};
uniform bool exact = false;
uniform sampler2D metres : hint_default_black, filter_nearest, repeat_disable;
uniform sampler2D behind : hint_screen_texture, filter_linear_mipmap, repeat_disable;

void fragment() {{
	float path = exact ? texture(metres, SCREEN_UV).r : thickness;
	float f0 = pow((ior - 1.0) / (ior + 1.0), 2.0);
	float reflected = f0 + (1.0 - f0) * pow(1.0 - clamp(dot(NORMAL, VIEW), 0.0, 1.0), 5.0) * step(1.0001, ior);
	vec3 seen = textureLod(behind, SCREEN_UV, 6.0 * roughness * step(1.0001, ior)).rgb;
	ALBEDO = vec3(0.0);
	EMISSION = seen * exp(-extinction * path) * (1.0 - reflected);
	ROUGHNESS = roughness;
	SPECULAR = min(sqrt(f0 / 0.16), 1.0);
}}
"""


def read_godot(text: str, _: str = "m") -> Medium:
    """Read the medium of a Godot shader; raises `InputError` if it has none."""
    what = "Godot shader"
    ior = float(stated(what, text, "uniform float ior")[0])
    return Medium(absorption=stated(what, text, "extinction = vec3(", 3), ior=ior)


GODOT = ExportTarget("Godot", godot_text, ".gdshader", read_godot, _GODOT_ROUGHNESS)


def from_unity(color: npt.ArrayLike, distance: float, ior: float = 1.5) -> Medium:
    """Medium of a transmittance color (sRGB-encoded, 0..1, as Unity stores it) at a distance in metres."""
    return Medium(absorption=extinction_at(srgb_to_linear(color), distance), ior=ior)


def unity_text(medium: Medium, distance: float, roughness: float) -> str:
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


def read_unity(text: str, _: str = "m") -> Medium:
    """Read the medium of C# for Unity, to nine digits; raises `InputError` if it has none."""
    what = "Unity material"
    distance, ior = stated_length(what, text, '"_ATDistance"'), float(stated(what, text, '"_Ior"')[0])
    return from_unity(stated_color(what, text, '"_TransmittanceColor", new Color('), distance, ior)


def _unity_roughness(text: str) -> float:
    return 1.0 - float(stated("surface", text, '"_Smoothness"', default=1.0)[0])


UNITY = ExportTarget("Unity", unity_text, ".cs", read_unity, _unity_roughness)


def mean_free_path_cm(medium: Medium) -> Array:
    """(3,): mean free path in cm; infinite where there is no extinction."""
    extinction = medium.extinction
    safe = np.where(extinction > 0, extinction, 1.0)
    return np.where(extinction > 0, CENTIMETERS_PER_METRE / safe, math.inf)


def from_mean_free_path_cm(mean_free_path: npt.ArrayLike) -> Medium:
    """Absorbing medium of a mean free path (3,) in cm, > 0; infinity is no extinction."""
    path = np.asarray(mean_free_path, dtype=np.float64)
    if path.shape != (3,) or not (path > 0).all():
        raise InputError(
            f"mean free path {mean_free_path!r}",
            "the mean free path must be three lengths above 0",
            "give three lengths in cm",
        )
    return Medium(absorption=CENTIMETERS_PER_METRE / path)


def unreal_text(medium: Medium, distance: float, roughness: float) -> str:
    """Inputs of the Substrate nodes; the color is stated at `distance` in metres, see `color_at`."""
    color, metres = color_at(medium, distance)
    thickness = CENTIMETERS_PER_METRE * metres if math.isfinite(metres) else 1.0
    path = np.minimum(mean_free_path_cm(medium), LONGEST_CM)
    return (
        "Substrate Transmittance-To-MeanFreePath\n"
        f"  Transmittance Color (linear) = {_triple(color)}\n"
        f"  Thickness (cm)               = {thickness:.9g}\n"
        "or Substrate Slab BSDF\n"
        f"  SSS MFP (cm)                 = {_triple(path)}\n"
        "and of the surface\n"
        f"  F0                           = {((medium.ior - 1.0) / (medium.ior + 1.0)) ** 2:.9g}\n"
        f"  Roughness                    = {roughness:.9g}\n"
        f"  Refraction, index (IOR)      = {medium.ior:.9g}\n"
    )


def read_unreal(text: str, _: str = "m") -> Medium:
    """Read the medium of values for Unreal, to nine digits; raises `InputError` if there is none."""
    path = stated("Unreal material", text, "SSS MFP (cm)", 3)
    found = from_mean_free_path_cm(np.where(path >= LONGEST_CM, math.inf, path))
    ior = float(stated("Unreal material", text, "index (IOR)", default=1.0)[0])
    return Medium(absorption=found.absorption, ior=ior)


def _triple(values: Array) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"


UNREAL = ExportTarget("Unreal", unreal_text, ".txt", read_unreal, roughness_behind("  Roughness"))


def css_text(medium: Medium, distance: float, _: float) -> str:
    """Custom properties and a gradient for the color that the medium has at `distance` metres."""
    color = medium.transmittance(distance)
    red, green, blue = color.tolist()
    stops = ", ".join(to_hex(row) for row in medium.transmittance(np.linspace(0.0, 2.0 * distance, _STOPS)))
    return (
        ":root {\n"
        f"  --translucent-color: {to_hex(color)};\n"
        f"  --translucent-color: color(srgb-linear {red:.6g} {green:.6g} {blue:.6g});\n"
        f"  --translucent-distance: {distance:.6g}; /* metres */\n"
        f"  --translucent-gradient: linear-gradient(to right, {stops}); /* 0 to {2.0 * distance:.6g} m */\n"
        "}\n"
    )


CSS = ExportTarget("CSS", css_text)


def write_json(medium: Medium) -> str:
    """The medium as one JSON object."""
    triples = {field: np.asarray(getattr(medium, field)).tolist() for field in _TRIPLES}
    numbers = {field: float(getattr(medium, field)) for field in _NUMBERS}
    phase = {_PHASE: str(medium.phase)} if medium.phase else {}
    return json.dumps({**triples, **numbers, **phase}, indent=2) + "\n"


def read_json(text: str) -> Medium:
    """Read the medium of such an object; absent fields have their defaults.

    Raises
    ------
    InputError
        If the text is no JSON object, or has unknown fields or values that a medium cannot have.
    """
    try:
        values = json_value(text)
    except ValueError as error:
        raise InputError("medium as JSON", f"the JSON is broken ({error})", "save the medium again") from error
    if not isinstance(values, dict):
        raise InputError("medium as JSON", "the JSON is not an object", "save the medium again")
    known = (*_TRIPLES, *_NUMBERS, _PHASE)
    if unknown := sorted(set(values) - set(known)):
        raise InputError(
            "medium as JSON",
            f"the JSON has the unknown keys {', '.join(unknown)}",
            f"use only the keys {', '.join(known)}",
        )
    for field in _NUMBERS:
        if isinstance(number := values.get(field, 0), bool) or not isinstance(number, int | float):
            raise InputError(
                "medium as JSON", f"the value of {field} is {number!r}, and not a number", "save the medium again"
            )
    if _PHASE in values:
        values[_PHASE] = parse_phase(str(values[_PHASE]))
    return Medium(**values)


def _gltf_text(medium: Medium, distance: float, roughness: float) -> str:
    extensions = volume_extensions(medium, distance, thickness=distance, ior=medium.ior)
    # Without these, a material is a rough metal.
    surface = {"metallicFactor": 0.0, "roughnessFactor": roughness}
    return json.dumps({"pbrMetallicRoughness": surface, "extensions": extensions}, indent=2) + "\n"


def _read(text: str, _: str) -> Medium:
    if (entry := _gltf_entry(text)) is None:
        return read_json(text)
    (found,) = materials_of(GltfFile(Path("material.gltf"), {"asset": {"version": "2.0"}, "materials": [entry]}))
    if (medium := found.medium()) is None:
        raise InputError("glTF material", "the material has no volume", "use a material with KHR_materials_volume")
    return medium


def _roughness(text: str) -> float:
    surface = (_gltf_entry(text) or {"pbrMetallicRoughness": {"roughnessFactor": 0.0}}).get("pbrMetallicRoughness", {})
    return 0.0 if "metallicRoughnessTexture" in surface else float(surface.get("roughnessFactor", 1.0))


def _gltf_entry(text: str) -> Any:
    """A glTF material; None where the text is another, or broken."""
    try:
        entry = json_value(text)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) and "extensions" in entry else None


GLTF = ExportTarget("glTF", _gltf_text, ".json", _read, _roughness)
JSON = ExportTarget("JSON", lambda medium, *_: write_json(medium), ".json", _read, _roughness)
