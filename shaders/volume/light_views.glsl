// What lights see: for each texel of each view from a light, the crossings of its ray in order, how their axial depths change
// across the texel, and what is behind each. So the optical depth from the light to any point is a sum over the crossings
// before it, moved along their faces to the very ray of the point.

#include <constants>
#include <Lights>
#include <Scatter>
#include "intervals/crossing.glsl"

layout(std430, binding = LIGHT_HEADS_BINDING) buffer LightHeads { uint light_heads[]; };    // links, view after view
layout(std430, binding = LIGHT_NODES_BINDING) buffer LightNodes { uvec4 light_nodes[]; };   // word, link to the next, slope of the axial depth
#if VARIES
layout(std430, binding = LIGHT_MEDIA_BINDING) buffer LightMedia { uvec4 light_media[]; };   // weights of the slots, metres from axial depth 0 to 1
#else
layout(std430, binding = LIGHT_MEDIA_BINDING) buffer LightMedia { vec4 light_media[]; };    // extinction behind, metres from axial depth 0 to 1
#endif
layout(std430, binding = LIGHT_ENDS_BINDING) buffer LightEnds { float light_ends[]; };     // axial depth where an opaque surface ends each ray

// Where the views of a light are: their texels begin at first, and each has size x size of them.
struct LightCells {
    uint first;
    int size;
};

uint light_cell(LightCells cells, ivec2 texel) {
    ivec2 held = clamp(texel, ivec2(0), ivec2(cells.size - 1));
    return cells.first + uint(held.y * cells.size + held.x);
}

// A light's ray through a point, by axial depth.
struct LightRay {
    vec3 point;
    float axial_depth;  // of the point
    vec3 advance;       // in metres, from axial depth 0 to 1
    float metres;       // its length
};

vec3 point_at(LightRay ray, float axial_depth) {
    return ray.point + (axial_depth - ray.axial_depth) * ray.advance;
}

// Optical depth on a light's ray to a point.
struct LightDepth {
    vec3 depth;
    vec3 ahead;      // of it, that of scattering in media whose scattering ahead is followed
    vec3 behind;     // the same times the metres from there to the point
    float steepest;  // of the crossings before, in axial depth per texel
    float visible;   // 0 where an opaque surface is in between
};

// Adds a part of a light's ray behind a node.
void add_part(inout LightDepth sum, uint link, LightRay ray, float from, float to) {
#if VARIES
    uvec4 words = light_media[link - 1u];
    vec3 extinction = vec3(0.0);
#if SCATTERS_AGAIN
    vec3 scattering = vec3(0.0);
#endif
    for (int slot = 0; slot < SLOTS; ++slot) {
        uint count = words[slot / TURNS_PER_WORD] >> uint(TURNS_BITS * (slot % TURNS_PER_WORD));
        float weight = float(count & ((1u << TURNS_BITS) - 1u));
        if (weight > 0.0 && slot_varies(slot)) {
            vec3 start = position_in_box(slot, point_at(ray, from));
            weight *= mean_density(slot, start, position_in_box(slot, point_at(ray, to)));
        }
        bool stops = (stopping_slots >> slot & 1) != 0;
        extinction += weight * (stops ? vec3(stopping_extinction) : slot_extinction[slot].rgb);
#if SCATTERS_AGAIN
        if (scattered_ahead[slot].x > 0.0) { scattering += weight * slot_scattering[slot].rgb; }
#endif
    }
    sum.depth += extinction * ((to - from) * ray.metres);
#if SCATTERS_AGAIN
    sum.ahead += scattering * ((to - from) * ray.metres);
    sum.behind += scattering * ((to - from) * (ray.axial_depth - 0.5 * (from + to)) * ray.metres * ray.metres);
#endif
#else
    sum.depth += light_media[link - 1u].rgb * ((to - from) * ray.metres);
#endif
}

// Optical depth to the point of a ray, by the crossings of a texel, moved along their faces to this very ray. offset: of
// the point from the texel's center.
LightDepth texel_light_depth(uint cell, vec2 offset, LightRay ray) {
    LightDepth sum = LightDepth(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 1.0);
    float last = 0.0;
    uint behind = 0u;
    uint link = light_heads[cell];
    bool before = true;
    while (before) {
        float moved = ray.axial_depth;
        uint next = 0u;
        before = link != 0u;
        if (before) {
            uvec4 node = light_nodes[link - 1u];
            vec2 slope = uintBitsToFloat(node.zw);
            moved = float(crossing_step(node.x)) / float(axial_steps()) + dot(slope, offset);
            sum.steepest = max(sum.steepest, max(abs(slope.x), abs(slope.y)));
            before = moved <= ray.axial_depth;
            next = node.y;
        }
        moved = max(min(moved, ray.axial_depth), last);
        if (behind != 0u && moved > last) { add_part(sum, behind, ray, last, moved); }
        last = moved;
        behind = link;
        link = next;
    }
    return sum;
}

// Which of the six views of a cube looks at a point, given from the light.
int cube_face(vec3 from_light) {
    vec3 size = abs(from_light);
    int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    return 2 * axis + (from_light[axis] < 0.0 ? 1 : 0);
}

// Optical depth from a light to a point within a body, given from the center of the media. The texel around the point decides it. Only next to a silhouette, where faces curve away within a texel,
// the four texels around the point do, the more so the less steep their faces are.
LightDepth light_depth(int light, vec3 point) {
    vec4 source = light_position[light];
    vec4 views = scatter_light_views[light];  // number of the first, how many, texels along a side, first texel
    int face = int(abs(views.y)) == 1 ? 0 : cube_face(point - source.xyz);
    int view = int(views.x) + face;
    LightCells cells = LightCells(uint(views.w) + uint(face * int(views.z) * int(views.z)), int(views.z));
    vec4 here = vec4(point, 1.0);
    float w = dot(scatter_views[4 * view + 2], here);
    vec2 ndc = vec2(dot(scatter_views[4 * view], here), dot(scatter_views[4 * view + 1], here)) / w;
    float axial_depth = dot(scatter_views[4 * view + 3], here);
    vec2 position = (0.5 * ndc + 0.5) * views.z;
    ivec2 texel = ivec2(floor(position));
    vec2 offset = position - floor(position) - 0.5;
    uint cell = light_cell(cells, texel);
#if SHADOWS
    if (axial_depth > light_ends[cell] + 1.5 / views.z) { return LightDepth(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0); }
#endif
    vec3 travel = source.w == 0.0 ? -source.xyz : point - source.xyz;
    vec3 advance = travel / max(dot(scatter_views[4 * view + 3].xyz, travel), 1e-30);
    LightRay ray = LightRay(point, axial_depth, advance, length(advance));
    LightDepth found = texel_light_depth(cell, offset, ray);
    if (light_heads[cell] != 0u && found.steepest < STEEP_IN_LIGHT_VIEW) { return found; }
    LightDepth sum = LightDepth(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 1.0);
    float total = 0.0;
    ivec2 corner = texel - ivec2(lessThan(offset, vec2(0.0)));
    vec2 fraction = offset + vec2(texel - corner);
    for (int i = 0; i < 4; ++i) {
        ivec2 aside = ivec2(i & 1, i >> 1);
        uint other = light_cell(cells, corner + aside);
        if (light_heads[other] == 0u) { continue; }
        found = texel_light_depth(other, fraction - vec2(aside), ray);
        vec2 weights = mix(1.0 - fraction, fraction, vec2(aside));
        float weight = (weights.x * weights.y + 1e-4) / (found.steepest * found.steepest + 1e-9);
        sum.depth += weight * found.depth;
        sum.ahead += weight * found.ahead;
        sum.behind += weight * found.behind;
        total += weight;
    }
    sum.depth /= max(total, 1e-30);
    sum.ahead /= max(total, 1e-30);
    sum.behind /= max(total, 1e-30);
    return sum;
}
