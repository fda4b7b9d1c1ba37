// The surface of an opaque object at a fragment, with its textures. Needs <constants>.

#include "shade/surface_textures.glsl"

uniform sampler2D reflectance_table;  // scale and bias of the reflectance at normal incidence
uniform vec4 opaque_finish;           // metallic, roughness, ior, alpha below which there is a hole
uniform vec4 opaque_passed;           // share of light on the paint that passes to the other side; w: seen from both
uniform float opaque_passed_share;    // the same without its color: what paint does not reflect
uniform vec3 opaque_emissive;
#if THIN_FILM
uniform vec3 opaque_film;             // share of the surface that has it, its ior, and metres
#endif
#if CLEAR_COAT
uniform vec2 opaque_clearcoat;        // share of the surface that has it, and its roughness
#endif

#include "shade/opaque_light.glsl"

// Of a fragment; takes derivatives. vertex: color and opacity of the mesh there.
OpaqueFinish opaque_finish_at(vec3 base, vec3 normal, vec3 position, vec2 uv, vec4 vertex) {
    vec4 painted = vertex * texture(color_texture, texture_coordinate(COLOR_TEXTURE, uv));
    vec4 rough = texture(roughness_texture, texture_coordinate(ROUGHNESS_TEXTURE, uv));
    vec3 emitted = opaque_emissive * texture(emissive_texture, texture_coordinate(EMISSIVE_TEXTURE, uv)).rgb;
    vec3 mapped = mapped_normal(normal, position, uv);
    return OpaqueFinish(base * painted.rgb, opaque_finish.x * rough.b, clamp(opaque_finish.y * rough.g, 0.0, 1.0), opaque_finish.z,
                        opaque_passed.rgb, opaque_passed_share, emitted,
                        mapped, normal_variance(mapped), painted.a, unoccluded(uv), painted.a < opaque_finish.w
#if THIN_FILM
                        , opaque_film
#endif
#if CLEAR_COAT
                        , opaque_clearcoat
#endif
    );
}
