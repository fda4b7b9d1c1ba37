// Irradiance on a ground by light that has diffused in bodies, and that they mirror: a lookup in the last layer of their texture.
// It is below 0 where they keep more light of the environment from the ground than they send.
// Points count from the center of the media. DIFFUSED: there are such bodies.

#include <Lights>
#include "shade/ground_map.glsl"

#if DIFFUSED
#include "shade/diffused_texture.glsl"

vec3 ground_light(vec3 point, vec3 normal) {
    float reach = inversesqrt(dot(ground_light_right.xyz, ground_light_right.xyz));
    float above = dot(ground_light_plane.xyz, point) - ground_light_plane.w;
    if (ground_light_layer.x == 0.0 || abs(above) > GROUND_TOLERANCE * reach || dot(normal, ground_light_plane.xyz) <= 0.0) { return vec3(0.0); }
    vec2 at = vec2(dot(ground_light_right, vec4(point, 1.0)), dot(ground_light_up, vec4(point, 1.0)));
    vec2 texel = clamp((0.5 + 0.5 * squeezed(at)) * ground_light_layer.y, 0.5, ground_light_layer.y - 0.5);
    return textureLod(diffused_light, vec3(texel, ground_light_layer.x + 0.5) / vec3(textureSize(diffused_light, 0)), 0.0).rgb;
}
#else
vec3 ground_light(vec3 point, vec3 normal) { return vec3(0.0); }
#endif
