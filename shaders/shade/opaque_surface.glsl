// The surface of an opaque object at a fragment, with its textures. Needs <constants>.

#include "shade/normal_variance.glsl"
#include "shade/surface_textures.glsl"

// Fields of the same names in the table of objects (gpu/layout.py), and the alpha below which there is a hole.
uniform float opaque_metallic;
uniform float opaque_roughness;
uniform float opaque_ior;
uniform vec3 opaque_passed;
uniform float opaque_passed_share;
uniform float opaque_one_sided;
uniform vec3 opaque_emissive;
uniform float opaque_hole_below;
#if THIN_FILM
uniform vec3 opaque_film;
#else
const vec3 opaque_film = vec3(0.0, 1.0, 0.0);
#endif
#if CLEAR_COAT
uniform float opaque_clearcoat;
uniform float opaque_clearcoat_roughness;
#else
const float opaque_clearcoat = 0.0;
const float opaque_clearcoat_roughness = 0.0;
#endif

#include "shade/opaque_light.glsl"

// Of a fragment; takes derivatives. normal: as interpolated, not normalized; vertex: color and opacity of the mesh there.
OpaqueSurface opaque_surface_at(vec3 base, vec3 normal, vec3 position, vec2 uv, vec4 vertex) {
    vec4 textured = vertex * textured_color(uv);
    vec4 rough = textured_roughness(uv);
    vec3 emitted = opaque_emissive * textured_emission(uv);
    vec3 mapped = mapped_normal(normalize(normal), position, uv);
    return OpaqueSurface(base * textured.rgb, opaque_metallic * rough.b, clamp(opaque_roughness * rough.g, 0.0, 1.0), opaque_ior,
        opaque_passed, opaque_passed_share, emitted, mapped, sample_filter(SURFACE_TEXTURES == 1 ? mapped : normal, position),
        textured.a, unoccluded(uv), textured.a < opaque_hole_below, opaque_film, vec2(opaque_clearcoat, opaque_clearcoat_roughness), NO_IRRADIANCE_MAP);
}
