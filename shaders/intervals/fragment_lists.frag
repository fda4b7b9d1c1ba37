// A-buffer (Yang et al. 2010): each fragment goes to the head of its pixel's list. Nodes beyond the end of the buffer are
// counted, so that the host can draw again with a larger one.

#include <View>
#include "intervals/place.glsl"
#include "intervals/lists.glsl"

void main() {
    float place = fragment_place();
    if (place > last_place()) { return; }
    uint node = atomicAdd(node_count, 1u);
    if (node < uint(nodes.length())) {
        uint pixel = pixel_index(gl_FragCoord.xy, frame_size.x);
        nodes[node] = uvec2(fragment_word(place), atomicExchange(heads[pixel], node + 1u));
    }
}
