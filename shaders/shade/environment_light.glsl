// Light from the environment, prefiltered. Needs <constants> and <Environment>.

#include "lib/environment.glsl"
#include "shade/light_map.glsl"

uniform sampler2DArray light_levels;  // reflected by surfaces of roughness 1/n, 2/n .. 1
uniform sampler2D light_irradiance;  // on surfaces, by their normal

// Radiance averaged over the reflections of a surface of this roughness; direction: of a mirror's reflection.
vec3 environment_light(vec3 direction, float roughness) {
    vec2 at = equirectangular_uv(direction, light_turn);
    float level = roughness * float(textureSize(light_levels, 0).z);
    float fraction = fract(level);
    float below = floor(level) - 1.0;
    vec3 rough = textureLod(light_levels, vec3(at, below + 1.0), 0.0).rgb;
    vec3 smoother = below < 0.0 ? textureLod(light_map, at, 0.0).rgb : textureLod(light_levels, vec3(at, below), 0.0).rgb;
    return light_scale * (fraction == 0.0 ? smoother : mix(smoother, rough, fraction));
}

// The same of a polished mirror.
vec3 mirrored_environment(vec3 direction) {
    return light_scale * textureLod(light_map, equirectangular_uv(direction, light_turn), 0.0).rgb;
}

vec3 environment_irradiance(vec3 normal) {
    return light_scale * textureLod(light_irradiance, equirectangular_uv(normal, light_turn), 0.0).rgb;
}
