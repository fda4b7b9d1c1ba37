// Highlights: lights that microfacets mirror, averaged over the normals and the half vectors within a sample.

#include "lib/bsdf.glsl"
#include "lib/light.glsl"
#include "shade/packed_variance.glsl"

const float EDGE_WIDTH = 16.0 / 35.0;  // integral of (1 - r^2)^3 over r
const float LIKE_GGX = 1.5;            // squared radius over squared alpha of the (1 - r^2)^3 that is as GGX in the middle

float determinant_of(vec3 symmetric) { return max(symmetric.x * symmetric.z - symmetric.y * symmetric.y, 1e-20); }

vec3 turned_matrix(vec3 symmetric, mat2 turn) {
    mat2 found = turn * mat2(symmetric.xy, symmetric.yz) * transpose(turn);
    return vec3(found[0], found[1][1]);
}

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
// sample in the projection of normals along the view ray. excess: by how much the lobe's squared alpha is larger, without more
// light far from its middle: its integral is 1 / (1 + excess).
float distribution_in_sample(vec3 half_vector, vec3 normal, mat3x2 axes, float cos_view, float alpha, vec3 variance, float excess) {
    float squared = alpha * alpha, spread = variance.x + variance.z;
    if (spread == 0.0) {
        float found = ggx_distribution(clamp(dot(half_vector, normal), 0.0, 1.0), alpha);
        if (excess == 0.0) { return found; }
        float part = 1.0 + excess * sqrt(PI * squared * found);
        return found / (part * part);
    }
    vec2 middle = axes * normal;
    // GGX is exact in the plane of the surface, and the average in that of the picture.
    vec2 apart = axes * half_vector - mix(dot(half_vector, normal), 1.0, spread / (2.0 * squared + spread)) * middle;
    vec3 width = projected_alpha(squared, middle, variance), slope = projected_alpha(squared / max(1.0 - squared, 1e-6), middle, variance);
    vec2 turned = vec2(slope.z * apart.x - slope.y * apart.y, slope.x * apart.y - slope.y * apart.x);
    float off = 1.0 + excess + dot(apart, turned) / determinant_of(slope);
    return cos_view * inversesqrt(determinant_of(width)) / (PI * off * off * visible_part(axes * half_vector, variance));
}

// How the half vectors of a light turn within a sample: squared, for a filter of one pixel, in `projection`, turned so that the
// first axis is that of the normal. turn: of view ray and light together, where a mirror shows the light. A half vector h turns by
// (1 - h h^T) / (2 h.v) of it; where it does so fast, it is the normal. cos_facet: h.v.
vec3 half_vector_turn(float turn, float cos_view, float cos_facet, vec3 normals) {
    float across = 0.5 * turn / max(cos_facet, turn), along = cos_view * cos_view * across;
    vec3 squared = vec3(along * along, 0.0, across * across);
    // Beside what `normals` add anyway, (a + b)^2 <= a^2 + (b / a) a^2 + (1 + a / b) b^2, for matrices, too.
    float a = sqrt((normals.x + normals.z) / PIXEL_ALPHA), b = length(vec2(along, across));
    return (1.0 + a / b) * squared + b / (PIXEL_ALPHA * max(a, 1e-10)) * normals;
}

// Microfacets that mirror a light towards the eye, without their reflectance, times the cosine of its light. Where they spread a
// light over less than a sample, one part of them is spread more, and the rest over an ellipse, as (1 - r^2)^3. Far from the middle,
// where GGX has much of its light and a sample averages over little, the highlight is as it is at a point.
float highlight_value(LightSample arriving, vec3 normal, vec3 ray, float cos_view, float alpha, SampleFilter within, out float cos_facet) {
    float least = max(alpha, SMALLEST_HIGHLIGHT), cos_light = dot(normal, arriving.towards);
    mat3x2 axes = projection(ray);
    vec2 middle = axes * normal;
    vec4 disc = arriving.disc;
    float width = sqrt(sqrt(determinant_of(projected_alpha(least * least, middle, within.normals))) / cos_view);
    float turn = within.turn + within.width / arriving.distance_m, larger = 1.0, radius = 0.0;
    vec3 ellipse = vec3(0.0);
    mat2 turned = mat2(1.0);
    if (turn > 0.0) {
        vec2 along = dot(middle, middle) > 0.0 ? normalize(middle) : vec2(1.0, 0.0);
        turned = mat2(along.x, -along.y, along.y, along.x);
        vec3 normals = turned_matrix(within.normals, turned), facets = least * least * vec3(cos_view * cos_view, 0.0, 1.0) + normals;
        vec3 turns = half_vector_turn(turn, cos_view, sqrt(max(0.5 - 0.5 * dot(arriving.towards, ray), 0.0)), normals);
        larger = max(PIXEL_ALPHA * dot(facets, vec3(turns.z, -2.0 * turns.y, turns.x)) / determinant_of(facets), 1.0);
        ellipse = PIXEL_RADIUS * PIXEL_RADIUS * turns + LIKE_GGX * facets;
        radius = 2.0 * sqrt(sqrt(determinant_of(ellipse)));
    }
    if (larger > 1.0) {
        // The ellipse blurs the edge of a disc on both sides: the light of a smaller disc is as much.
        float edge = EDGE_WIDTH * radius;
        disc.w = max(sqrt(max(disc.w * disc.w + edge * edge - 0.25 * radius * radius, 0.0)) - edge, 0.0);
    }
    disc = highlight_disc(arriving.towards, disc, width);
    vec3 from = disc.w == 0.0 ? disc.xyz : nearest_on_disc(disc, reflected_direction(ray, normal));
    vec3 half_vector = normalize(from - ray);
    cos_facet = max(dot(half_vector, from), 0.0);
    float peak = disc_peak(width, disc.w, cos_view);
    float found = peak * distribution_in_sample(half_vector, normal, axes, cos_view, least, within.normals, larger - 1.0);
    vec2 apart = turned * (axes * half_vector - dot(half_vector, normal) * middle);
    if (larger > 1.0 && dot(apart, apart) < ellipse.x + ellipse.z) {
        float rest = 1.0 - peak / (larger * disc_peak(width * sqrt(larger), disc.w, cos_view));
        float off = dot(apart * apart, ellipse.zx) - 2.0 * apart.x * apart.y * ellipse.y, area = determinant_of(ellipse);
        float inside = max(1.0 - off / area, 0.0), wide = disc.w / radius;
        found += cos_view * rest * inside * inside * inside * 4.0 * inversesqrt(area) / (PI * (1.0 + wide * (8.0 * EDGE_WIDTH + 4.0 * wide)));
    }
    return found * ggx_visibility(cos_light, cos_view, least) * cos_light;
}
