// k-buffer (Bavoil et al. 2007): the k nearest crossings of each pixel, in order. A crossing takes the first slot whose
// word is greater, and passes on what was there; atomic minima keep every word, whatever else is drawn meanwhile.

#include <View>
#include "intervals/fragment_crossing.glsl"
#include "intervals/k_slots.glsl"

layout(location = 0) out float misplaced;  // maximum blending keeps that of the steepest face

void main() {
    float axial_depth = fragment_axial_depth();
    misplaced = misplaced_axial_depth();
    if (!is_kept(axial_depth)) { discard; }
    uint base = k_base(gl_FragCoord.xy, frame_size.x);
    atomicAdd(words[base], 1u);
    uint word = fragment_word(axial_depth);
    for (uint i = 1u; i <= uint(k); ++i) {
        uint former = atomicMin(words[base + i], word);
        if (former == NO_CROSSING) { break; }
        word = max(word, former);
    }
}
