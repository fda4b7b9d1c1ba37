// Irradiance on opaque surfaces by light that does not come straight: lookups in the texture of diffused light. Of a ground by light
// that has diffused in bodies, and that they mirror, in the last layer: it is below 0 where they keep more light of the environment
// from the ground than they send. And of objects that have a map, by all light that does not come straight from the lights
// (diffusion/irradiance_maps.py). Points count from the center of the media. DIFFUSED: there is such light.

#include <Lights>
#include "shade/ground_map.glsl"

// Where the map of an object is in the texture: its corner, its axes by the side of a cell, its cells, and its first layer.
struct IrradianceMap {
    vec3 low;
    vec3 x;
    vec3 y;
    vec3 z;
    vec3 size;
    float layer;
    float lit;  // 1 where it has the light of the lights, too
};

const IrradianceMap NO_IRRADIANCE_MAP = IrradianceMap(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0);

#if DIFFUSED
#include "shade/diffused_texture.glsl"

vec3 ground_light(vec3 point, vec3 normal) {
    float reach = inversesqrt(dot(ground_light_right.xyz, ground_light_right.xyz));
    float above = dot(ground_light_plane.xyz, point) - ground_light_plane.w;
    if (ground_light_layer.y == 0.0 || abs(above) > GROUND_TOLERANCE * reach || dot(normal, ground_light_plane.xyz) <= 0.0) { return vec3(0.0); }
    vec2 at = vec2(dot(ground_light_right, vec4(point, 1.0)), dot(ground_light_up, vec4(point, 1.0)));
    vec2 texel = clamp((0.5 + 0.5 * squeezed(at)) * ground_light_layer.y, 0.5, ground_light_layer.y - 0.5);
    return textureLod(diffused_light, vec3(texel, ground_light_layer.x + 0.5) / vec3(textureSize(diffused_light, 0)), 0.0).rgb;
}

// Of each side as much as the normal looks there.
vec3 mapped_irradiance(IrradianceMap map, vec3 point, vec3 normal) {
    vec3 texels = vec3(textureSize(diffused_light, 0)), place = point - map.low, sum = vec3(0.0);
    vec3 at = vec3(dot(place, map.x), dot(place, map.y), dot(place, map.z));
    at = clamp(at, vec3(0.5), map.size - 0.5) + vec3(0.0, 0.0, map.layer);
    vec3 towards = normalize(vec3(dot(normal, map.x), dot(normal, map.y), dot(normal, map.z)));
    for (int axis = 0; axis < 3; ++axis) {
        vec3 side = vec3(towards[axis] < 0.0 ? map.size.x : 0.0, float(axis) * map.size.y, 0.0);
        sum += towards[axis] * towards[axis] * textureLod(diffused_light, (at + side) / texels, 0.0).rgb;
    }
    return sum;
}
#else
vec3 ground_light(vec3 point, vec3 normal) { return vec3(0.0); }
#endif

vec3 environment_irradiance(vec3 normal);  // of environment_light.glsl or diffuse_light.glsl

// Irradiance on a surface by all but the straight light of the lights. Needs shadows.glsl.
vec3 surrounding_irradiance(IrradianceMap map, vec3 point, vec3 normal) {
#if DIFFUSED
    if (map.size.x > 0.0) { return mapped_irradiance(map, point, normal); }
#endif
    return max(environment_irradiance(normal) * environment_reaching(point, normal) + ground_light(point, normal), 0.0);
}
