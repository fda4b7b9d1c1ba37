// Highlights: lights that microfacets mirror, averaged over the normals within a sample. variance: of those, see normal_variance.glsl.

#include "lib/bsdf.glsl"
#include "lib/light.glsl"
#include "shade/packed_variance.glsl"

float determinant_of(vec3 symmetric) { return max(symmetric.x * symmetric.z - symmetric.y * symmetric.y, 1e-20); }

// Squared alpha of microfacets around a normal, projected along the view ray. normal: projected.
vec3 projected_alpha(float squared, vec2 normal, vec3 variance) {
    return squared * vec3(1.0 - normal.x * normal.x, -normal.x * normal.y, 1.0 - normal.y * normal.y) + variance;
}

// Fraction of the average over a sample that is visible and lit around a half vector that is projected to a point: between the
// silhouette and the terminator of a ball, whose normals are evenly spread in the projection.
float visible_part(vec2 half_vector, vec3 variance) {
    float aside = min(length(half_vector), 1.0);
    vec2 along = half_vector / max(aside, 1e-6);
    float width = variance.x * along.x * along.x + 2.0 * variance.y * along.x * along.y + variance.z * along.y * along.y;
    vec2 bounds = (1.0 - aside) * vec2(1.0, 1.0 + 2.0 * aside);
    vec2 within = bounds * inversesqrt(max(width + bounds * bounds, 1e-30));
    return max(0.5 * (within.x + within.y), LEAST_VISIBLE);
}

// Density of microfacets (GGX) around a half vector. Those that the surface shows in an area of the picture are averaged over the
// sample in the projection of normals along the view ray.
float distribution_in_sample(vec3 half_vector, vec3 normal, vec3 ray, float cos_view, float alpha, vec3 variance) {
    float squared = alpha * alpha, spread = variance.x + variance.z;
    if (spread == 0.0) { return ggx_distribution(clamp(dot(half_vector, normal), 0.0, 1.0), alpha); }
    mat3x2 axes = projection(ray);
    vec2 middle = axes * normal;
    // GGX is exact in the plane of the surface, and the average in that of the picture.
    vec2 apart = axes * half_vector - mix(dot(half_vector, normal), 1.0, spread / (2.0 * squared + spread)) * middle;
    vec3 width = projected_alpha(squared, middle, variance), slope = projected_alpha(squared / max(1.0 - squared, 1e-6), middle, variance);
    vec2 turned = vec2(slope.z * apart.x - slope.y * apart.y, slope.x * apart.y - slope.y * apart.x);
    float off = 1.0 + dot(apart, turned) / determinant_of(slope);
    return cos_view * inversesqrt(determinant_of(width)) / (PI * off * off * visible_part(axes * half_vector, variance));
}

// Microfacets that mirror a light towards the eye, without their reflectance, times the cosine of its light.
float highlight_value(LightSample arriving, vec3 normal, vec3 ray, float cos_view, float alpha, vec3 variance, out float cos_facet) {
    float least = max(alpha, SMALLEST_HIGHLIGHT), cos_light = dot(normal, arriving.towards);
    float width = sqrt(sqrt(determinant_of(projected_alpha(least * least, projection(ray) * normal, variance))) / cos_view);
    vec4 from = highlight_from(arriving.towards, arriving.disc, reflected_direction(ray, normal), width, cos_view);
    vec3 half_vector = normalize(from.xyz - ray);
    cos_facet = max(dot(half_vector, from.xyz), 0.0);
    return distribution_in_sample(half_vector, normal, ray, cos_view, least, variance) * ggx_visibility(cos_light, cos_view, least)
        * cos_light * from.w;
}
