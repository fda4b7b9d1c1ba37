// A-buffer (Yang et al. 2010): each fragment goes to the head of its pixel's list. Nodes beyond the end of the buffer are
// counted, so that the host can draw again with a larger one.

#include <View>
#include "intervals/fragment_crossing.glsl"
#include "intervals/lists.glsl"

uniform int cell_offset;  // of the first pixel's head

#if !GRADIENT
layout(location = 0) out float misplaced;  // maximum blending keeps that of the steepest face
#endif

void main() {
    float axial_depth = fragment_axial_depth();
#if GRADIENT
    vec2 slope = vec2(dFdx(axial_depth), dFdy(axial_depth));
#else
    misplaced = misplaced_axial_depth();
#endif
    if (!is_kept(axial_depth)) { discard; }
    uint node = atomicAdd(node_count, 1u);
    if (node < uint(nodes.length())) {
        uint pixel = uint(cell_offset) + pixel_index(gl_FragCoord.xy, frame_size.x);
        uvec2 entry = uvec2(fragment_word(axial_depth), atomicExchange(heads[pixel], node + 1u));
#if GRADIENT
        nodes[node] = uvec4(entry, floatBitsToUint(slope));
#else
        nodes[node] = entry;
#endif
    }
}
