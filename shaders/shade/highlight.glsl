// Highlights: lights that microfacets mirror, averaged over the normals and the half vectors within a sample.

#include "lib/bsdf.glsl"
#include "lib/light.glsl"
#include "shade/packed_variance.glsl"

const float MOST_VARIANCE = 0.18;  // that a filter adds to squared alpha

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

// Squared alpha of the half vectors of a light within a sample. These turn by (1 - h h^T) / (2 h.v) of what the view ray and the
// direction to the light do together, t + w / d where a mirror shows the light; there, h is the normal, and farther off it makes no
// difference. What the disc of the light and the microfacets spread is left out, as that needs no filter. middle: normal, projected.
vec3 half_vector_variance(LightSample arriving, vec2 middle, vec3 ray, float cos_view, float cos_light, float alpha, SampleFilter within) {
    float turn = within.turn + within.width / (arriving.distance_m * max(cos_light / cos_view, 1.0)), disc = min(arriving.disc.w, turn);
    float squared = cos_view * cos_view, facet = 0.5 - 0.5 * dot(arriving.towards, ray);
    // In the plane of the surface it is as much across the ray, and `squared` of it along.
    float spread = max(0.25 * (turn - disc) * (turn + disc) / max(facet, 1e-6) - alpha * alpha / (1.0 + squared), 0.0);
    return spread * (vec3(1.0, 0.0, 1.0) - (1.0 + squared) * vec3(middle.x * middle, middle.y * middle.y));
}

// Density of microfacets (GGX) around a half vector, averaged over a sample in the projection of normals along the view ray.
// normals: squared alpha of the normals within it; variance: with that of half vectors.
float distribution_in_sample(vec3 half_vector, vec3 normal, mat3x2 axes, float cos_view, float alpha, vec3 normals, vec3 variance) {
    if (variance.x + variance.z == 0.0) { return ggx_distribution(clamp(dot(half_vector, normal), 0.0, 1.0), alpha); }
    float squared = alpha * alpha, spread = normals.x + normals.z;
    vec2 middle = axes * normal;
    // GGX is exact in the plane of the surface, and the average over normals in that of the picture.
    vec2 apart = axes * half_vector - mix(dot(half_vector, normal), 1.0, spread / (2.0 * squared + spread)) * middle;
    vec3 width = projected_alpha(squared, middle, variance), slope = projected_alpha(squared / max(1.0 - squared, 1e-6), middle, variance);
    vec2 turned = vec2(slope.z * apart.x - slope.y * apart.y, slope.x * apart.y - slope.y * apart.x);
    float off = 1.0 + dot(apart, turned) / determinant_of(slope);
    return cos_view * inversesqrt(determinant_of(width)) / (PI * off * off * visible_part(axes * half_vector, normals));
}

// Microfacets that mirror a light towards the eye, without their reflectance, times the cosine of its light.
float highlight_value(LightSample arriving, vec3 normal, vec3 ray, float cos_view, float alpha, SampleFilter within, out float cos_facet) {
    float least = max(alpha, SMALLEST_HIGHLIGHT), cos_light = dot(normal, arriving.towards);
    mat3x2 axes = projection(ray);
    vec3 normals = within.normals, variance = half_vector_variance(arriving, axes * normal, ray, cos_view, cos_light, least, within);
    // At most, both turn in the same direction: (a + b)^2 <= (1 + b / a) a^2 + (1 + a / b) b^2, for matrices, too.
    float spread = sqrt(normals.x + normals.z), turned = sqrt(variance.x + variance.z);
    normals *= 1.0 + turned / max(spread, 1e-10);
    variance = normals + (1.0 + spread / max(turned, 1e-10)) * variance;
    float bound = min(1.0, MOST_VARIANCE / max(variance.x + variance.z, 1e-30));
    normals *= bound;
    variance *= bound;
    float width = sqrt(sqrt(determinant_of(projected_alpha(least * least, axes * normal, variance))) / cos_view);
    vec4 from = highlight_from(arriving.towards, arriving.disc, reflected_direction(ray, normal), width, cos_view);
    vec3 half_vector = normalize(from.xyz - ray);
    cos_facet = max(dot(half_vector, from.xyz), 0.0);
    return distribution_in_sample(half_vector, normal, axes, cos_view, least, normals, variance) * ggx_visibility(cos_light, cos_view, least)
        * cos_light * from.w;
}
