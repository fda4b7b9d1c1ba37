// The surface of an opaque object at a fragment, with its textures. Needs <constants>.

#include "shade/normal_variance.glsl"
#include "shade/surface_textures.glsl"

uniform vec4 opaque_parameters;     // metallic, roughness, ior, alpha below which there is a hole
uniform vec4 opaque_passed;         // fraction of the light on the base that passes to the other side; w: visible from both
uniform float opaque_passed_share;  // the same without its color: what the base does not reflect
uniform vec3 opaque_emissive;
#if THIN_FILM
uniform vec3 opaque_film;           // fraction of the surface that has it, its ior, and metres
#else
const vec3 opaque_film = vec3(0.0, 1.0, 0.0);
#endif
#if CLEAR_COAT
uniform vec2 opaque_clearcoat;      // fraction of the surface that has it, and its roughness
#else
const vec2 opaque_clearcoat = vec2(0.0);
#endif

#include "shade/opaque_light.glsl"

// Of a fragment; takes derivatives. vertex: color and opacity of the mesh there.
OpaqueSurface opaque_surface_at(vec3 base, vec3 normal, vec3 position, vec2 uv, vec4 vertex) {
    vec4 textured = vertex * texture(color_texture, texture_coordinate(COLOR_TEXTURE, uv));
    vec4 rough = texture(roughness_texture, texture_coordinate(ROUGHNESS_TEXTURE, uv));
    vec3 emitted = opaque_emissive * texture(emissive_texture, texture_coordinate(EMISSIVE_TEXTURE, uv)).rgb;
    vec3 mapped = mapped_normal(normal, position, uv);
    return OpaqueSurface(base * textured.rgb, opaque_parameters.x * rough.b, clamp(opaque_parameters.y * rough.g, 0.0, 1.0),
        opaque_parameters.z, opaque_passed.rgb, opaque_passed_share, emitted, mapped, normal_variance(mapped), textured.a,
        unoccluded(uv), textured.a < opaque_parameters.w, opaque_film, opaque_clearcoat);
}
