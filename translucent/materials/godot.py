"""Godot 4: a spatial shader that lets the screen behind the surface through, dimmed by the medium; written and read.

StandardMaterial3D has no absorption by length, and its refraction is an offset on the screen, so that a shader is
written. Formulas: exp(-sigma_t d) with d a constant thickness, or where the uniform `exact` is set, that of a texture
in metres, as the pass of docs/lifting.md makes it; Schlick's Fresnel with F0 = ((n - 1) / (n + 1))^2, which Godot's
SPECULAR states as 0.16 SPECULAR^2. Source: Godot documentation, Spatial shaders, Screen-reading shaders. Tests
compile and run it as GLSL; it is not run in Godot.

Not carried over: bending of light (what is behind is seen straight on), scattering (its extinction is written),
anisotropy, emission; a surface of index above 2.33 reflects as one of 2.33.
"""

from __future__ import annotations

import numpy as np

from translucent.materials.snippet import stated
from translucent.media.medium import Medium

_WHAT = "Godot shader"


def godot_text(medium: Medium, distance: float, roughness: float = 0.0) -> str:
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


def read_godot(text: str) -> Medium:
    """Read the medium of such a shader; raises `InputError` if it is none."""
    ior = float(stated(_WHAT, text, "uniform float ior")[0])
    return Medium(absorption=stated(_WHAT, text, "extinction = vec3(", 3), ior=ior)
