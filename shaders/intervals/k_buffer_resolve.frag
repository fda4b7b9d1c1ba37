// Walks along the crossings that the k-buffer has kept.

#include <View>
#include "intervals/k_slots.glsl"
#include "intervals/resolve.glsl"

uniform sampler2D steepest;

void main() {
    uint base = k_base(gl_FragCoord.xy, frame_size.x);
    uint counted = words[base];
    uint kept = min(counted, uint(k));
    int excess[SLOTS];
    for (int slot = 0; slot < SLOTS; ++slot) { excess[slot] = 0; }
    for (uint i = 1u; i <= kept; ++i) {
        uint word = words[base + i];
        for (int slot = 0; slot < SLOTS; ++slot) {
            excess[slot] += slot == crossing_slot(word) ? (crossing_leaves(word) ? 1 : -1) : 0;
        }
    }
    float advance = ray_advance();
    float metres_per_step = metres_of_a_step(advance);
    Walk walk = walk_from_start(excess, misplaced_metres(texelFetch(steepest, ivec2(gl_FragCoord.xy), 0).r, advance));
    for (uint i = 1u; i <= kept; ++i) {
        cross_surface(walk, words[base + i], 1, false, metres_per_step);
#if INTERFACES
        note_exit(walk, words[base + i]);
#endif
    }
    end_walk(walk, metres_per_step, float(counted), float(kept));
}
