// Lights: the radiance that they send to a point, before anything is between. Pure. Positions count from one origin, in metres;
// directions are unit vectors. Each function of numbers is the float32 twin of the same name in translucent/formulas/light.py.

#include <constants>

struct Light {
    vec4 position;  // w = 1: where it is; w = 0: infinitely far away, the direction to it
    vec3 power;     // radiant intensity in W/sr; at infinity irradiance on what faces it, in W/m^2
    vec4 cone;      // in which it shines, as cone_attenuation takes it
};

// Light that arrives at a point.
struct LightSample {
    vec3 towards;      // unit vector from the point to the light
    float distance_m;  // to the light
    vec3 irradiance;   // on a surface that faces it
};

// Share of a light's intensity in the direction of travel (KHR_lights_punctual): the square of
// (cos - cos_outer) / (cos_inner - cos_outer), within 0 to 1. cone: the light's direction times k, with
// k^2 = 1 / (2 (cos_inner - cos_outer)); w: (1 - cos_outer) / (cos_inner - cos_outer). (0, 0, 0, 1): alike in all
// directions. By chords, 1 - cos = |a - b|^2 / 2, whose float32 is good for narrow cones, too.
float cone_attenuation(vec3 travel, vec4 cone) {
    vec3 apart = length(cone.xyz) * travel - cone.xyz;
    float level = clamp(cone.w - dot(apart, apart), 0.0, 1.0);
    return level * level;
}

// Sample a light from a point. Divided by the distance twice: no square overflows.
LightSample light_sample(Light light, vec3 point) {
    vec3 way = light.position.xyz - light.position.w * point;
    float distance_m = max(length(way), 1e-18);
    vec3 towards = way / distance_m;
    if (light.position.w == 0.0) { return LightSample(towards, NOTHING, light.power); }
    return LightSample(towards, distance_m, light.power * cone_attenuation(-towards, light.cone) / distance_m / distance_m);
}
