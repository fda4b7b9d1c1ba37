// What boundaries between media do with light. Pure: needs only <constants> and the library. Directions are unit vectors
// of travel; a normal looks to the side that the light comes from; ior is that of the other side relative to this one.
// Each function is the float32 twin of the same name in translucent/formulas/interface.py, where the sources are cited: Snell;
// Stokes 1862; Walter et al. 2007; Heitz 2014 and 2018; KHR_materials_dispersion. fresnel_dielectric is in optics.glsl.

#include <constants>
#include "lib/optics.glsl"

vec3 reflected_direction(vec3 direction, vec3 normal) {
    return direction - 2.0 * dot(direction, normal) * normal;
}

// Zero under total internal reflection.
vec3 refracted_direction(vec3 direction, vec3 normal, float ior) {
    float cos_incident = -dot(direction, normal);
    float ior_squared_minus_1 = (ior - 1.0) * (ior + 1.0);
    float k = ior_squared_minus_1 + cos_incident * cos_incident;
    if (ior_squared_minus_1 == 0.0) { return direction; }
    if (k <= 0.0) { return vec3(0.0); }
    // cos - sqrt(k), multiplied out, so that nothing cancels where ior is near 1.
    return (direction - ior_squared_minus_1 / (cos_incident + sqrt(k)) * normal) / ior;
}

// Indices for red, green and blue; dispersion is 20 / Abbe number. None is below 1.
vec3 channel_iors(float ior, float dispersion) {
    float half_spread = 0.025 * (ior - 1.0) * dispersion;
    return vec3(max(ior - half_spread, 1.0), ior, ior + half_spread);
}

// Density of microfacet normals in 1/sr, alpha = roughness^2 > 0. 1 - cos^2 as a product, so that a smooth surface keeps
// its digits.
float ggx_distribution(float cos_half, float alpha) {
    float base = (1.0 - cos_half) * (1.0 + cos_half) + alpha * alpha * cos_half * cos_half;
    return alpha / base * (alpha / base) / PI;
}

// Masking and shadowing, height-correlated, divided by 4 cos_light cos_view.
float ggx_visibility(float cos_light, float cos_view, float alpha) {
    float slope = alpha * alpha;
    float light = cos_view * sqrt(cos_light * cos_light + slope * (1.0 - cos_light) * (1.0 + cos_light));
    float view = cos_light * sqrt(cos_view * cos_view + slope * (1.0 - cos_view) * (1.0 + cos_view));
    return light + view > 0.0 ? 0.5 / (light + view) : 0.0;
}

// Smith's Lambda of GGX: 1 / (1 + Lambda) of the microfacets are visible from a direction.
float smith_lambda(float cosine, float alpha) {
    float up = max(cosine, 1e-6);
    float slope = alpha * alpha * (1.0 - up) * (1.0 + up);
    return 0.5 * slope / (up * (sqrt(up * up + slope) + up));
}

// Normal of a microfacet that is visible from a direction, at random: towards and the result in a frame whose z axis is the
// normal of the surface, shares (0 to 1) are the random numbers.
vec3 ggx_visible_normal(vec3 towards, float alpha, vec2 shares) {
    vec3 stretched = normalize(vec3(alpha * towards.xy, max(towards.z, 1e-6)));
    float across = length(stretched.xy);
    vec3 first = across > 1e-6 ? vec3(-stretched.y, stretched.x, 0.0) / across : vec3(1.0, 0.0, 0.0);
    vec3 second = cross(stretched, first);
    float radius = sqrt(shares.x);
    float x = radius * cos(2.0 * PI * shares.y);
    float blend = 0.5 * (1.0 + stretched.z);
    float y = mix(sqrt(max(1.0 - x * x, 0.0)), radius * sin(2.0 * PI * shares.y), blend);
    vec3 normal = x * first + y * second + sqrt(max(1.0 - x * x - y * y, 0.0)) * stretched;
    return normalize(vec3(alpha * normal.xy, max(normal.z, 1e-6)));
}

// Thin wall of two parallel boundaries, all reflections between them added up; optical_depth is that of one passage.
vec3 slab_transmittance(float reflectance, vec3 optical_depth) {
    vec3 passage = transmittance(optical_depth);
    if (reflectance >= 1.0) { return vec3(0.0); }
    // 1 - r a as (1 - r) + r (1 - a), so that nothing cancels near grazing.
    vec3 kept = (1.0 - reflectance) + reflectance * opacity(optical_depth);
    return (1.0 - reflectance) / kept * ((1.0 - reflectance) / (1.0 + reflectance * passage)) * passage;
}

vec3 slab_reflectance(float reflectance, vec3 optical_depth) {
    return reflectance * (1.0 + transmittance(optical_depth) * slab_transmittance(reflectance, optical_depth));
}
