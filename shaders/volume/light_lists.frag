// Sorts the crossings on the ray of each texel of a view from a light, and notes what is behind each.

#if GRADIENT < 1
#error nodes keep a gradient: GRADIENT is 1
#endif
#if SCATTER > 0
#error it makes what SCATTER reads: SCATTER is 0
#endif

#include <constants>
#include <View>
#include "intervals/lists.glsl"
#include "intervals/sort_list.glsl"
#include "intervals/walk.glsl"
#include "lib/ray.glsl"

#if VARIES
#define MEDIUM uvec4
#else
#define MEDIUM vec4
#endif
layout(std430, binding = LIGHT_MEDIA_BINDING) buffer LightMedia { MEDIUM light_media[]; };
layout(std430, binding = LIGHT_ENDS_BINDING) buffer LightEnds { float light_ends[]; };

#if OPAQUE
uniform sampler2D opaque_axial_depth;
#endif

uniform int cell_offset;

// Extinction behind a node, and metres from axial depth 0 to 1. Where it varies, how often each medium is there.
MEDIUM behind(Walk walk, float metres_per_axial_depth) {
#if VARIES
    uvec4 words = uvec4(0u, 0u, 0u, floatBitsToUint(metres_per_axial_depth));
    for (int slot = 0; slot < SLOTS; ++slot) {
        uint weight = min(uint(slot_weight(walk.winding, slot)), (1u << TURNS_BITS) - 1u);
        words[slot / TURNS_PER_WORD] |= weight << uint(TURNS_BITS * (slot % TURNS_PER_WORD));
    }
    return words;
#else
    return vec4(contents(walk.winding).extinction, metres_per_axial_depth);
#endif
}

void main() {
    uint cell = uint(cell_offset) + pixel_index(gl_FragCoord.xy, frame_size.x);
    int excess[SLOTS];
    uint list = sort_list(heads[cell], excess);
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    float advance = length(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    float metres_per_axial_depth = media_length * advance;
    Walk walk = walk_from_start(excess, 0.0);
    heads[cell] = list;
    if (contents(walk.winding).count > 0.0) {
        // The light is inside: a crossing at the start says so.
        uint node = atomicAdd(node_count, 1u);
        nodes[node] = uvec4(0u, list, 0u, 0u);
        light_media[node] = behind(walk, metres_per_axial_depth);
        heads[cell] = node + 1u;
    }
    for (uint link = list; link != END_OF_LIST; link = next_link(link)) {
        cross_surface(walk, word_at(link), 1, false, metres_per_axial_depth / float(axial_steps()));
        light_media[link - 1u] = behind(walk, metres_per_axial_depth);
    }
#if OPAQUE
    light_ends[cell] = texelFetch(opaque_axial_depth, ivec2(gl_FragCoord.xy), 0).r;
#endif
}
