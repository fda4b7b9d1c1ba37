// Lights: the radiance that they send to a point, before anything is between. Pure. Positions count from one origin, in metres;
// directions are unit vectors. Each function of numbers is the float32 twin of the same name in translucent/formulas/light.py.

#include <constants>

struct Light {
    vec4 position;  // w = 1: where it is; w = 0: infinitely far away, the direction to it
    vec3 power;     // radiant intensity in W/sr; at infinity irradiance on what faces it, in W/m^2
    vec4 cone;      // in which it shines, as cone_attenuation takes it
    float radius;   // of its part of that sphere, over which shadows are filtered, in metres
    vec4 disc;      // vector to the center of the sphere that it is a part of, and its radius, in metres; 0 for none
};

// Light that arrives at a point.
struct LightSample {
    vec3 towards;      // unit vector from the point to the light
    float distance_m;  // to the light
    vec3 irradiance;   // on a surface that faces it
    vec4 disc;         // unit vector to the middle of the disc that highlights show; w: its radius over its distance, or 0
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

// Point in a sphere of radius 1 that looks like an even disc from everywhere, given three random numbers: the projection of a
// point on the sphere in four dimensions.
vec3 sphere_point(vec3 shares) {
    vec2 angles = 2.0 * PI * shares.yz;
    float across = sqrt(shares.x);
    return vec3(across * cos(angles.x), across * sin(angles.x), sqrt(1.0 - shares.x) * cos(angles.y));
}

// Where a disc is nearest to a direction: all of its light in a highlight comes as if from there (Karis 2013, "Real shading in
// Unreal Engine 4"). disc: as in LightSample.
vec3 nearest_on_disc(vec4 disc, vec3 direction) {
    vec3 aside = max(dot(disc.xyz, direction), 0.0) * direction - disc.xyz;
    return normalize(disc.xyz + aside * min(disc.w / max(length(aside), 1e-9), 1.0));
}

// Fraction of a highlight's peak that is left when it is spread over a disc, of a radius over its distance: that of the
// distribution of microfacets (GGX) around the half vectors that mirror the disc, so that no light comes or goes.
float disc_peak(float alpha, float radius, float cos_view) {
    float middle = 0.5 * radius / sqrt(cos_view);
    return alpha * alpha / (alpha * alpha + middle * (0.5 * PI * alpha + middle));
}

// Disc of a light as microfacets mirror it: all of it if they are polished; if they are rough, the point where the light is, one
// of several in the disc.
vec4 highlight_disc(vec3 towards, vec4 disc, float alpha) {
    if (disc.w == 0.0) { return vec4(towards, 0.0); }
    float rough = clamp(8.0 * alpha / disc.w - 1.0, 0.0, 1.0);
    return vec4(normalize(mix(disc.xyz, towards, rough)), (1.0 - rough) * disc.w);
}

// Sample a light from a point. Divided by the distance twice: no square overflows.
LightSample light_sample(Light light, vec3 point) {
    vec3 offset = light.position.xyz - light.position.w * point;
    float distance_m = max(length(offset), 1e-18);
    vec3 towards = offset / distance_m;
    if (light.position.w == 0.0) { return LightSample(towards, NOTHING, light.power, vec4(0.0)); }
    vec3 irradiance = light.power * cone_attenuation(-towards, light.cone) / distance_m / distance_m;
    vec4 disc = vec4(0.0);
    if (light.disc.w > 0.0) {
        vec3 to_disc = offset + light.disc.xyz;
        float away = max(length(to_disc), 1e-18);
        disc = vec4(to_disc / away, min(light.disc.w / away, 0.9));
    }
    return LightSample(towards, distance_m, irradiance, disc);
}
