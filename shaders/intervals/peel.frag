// Depth peeling (Everitt 2001), from both ends at once (Bavoil & Myers 2008). Of the crossings strictly between those
// that the previous pass found, minimum blending keeps the nearest (red) and, reversed, the farthest (green). Faces that
// are alike have one word: alpha counts how many there were of the previous pass's two. The first pass has no previous
// one; its alpha counts all crossings, and the excess of exits over entries for a body whose surface the eye is on; its
// blue keeps how far the rasterizer may have misplaced the steepest face, negative since the minimum is kept.

#include "intervals/fragment_crossing.glsl"

#if !FIRST
uniform sampler2D previous;
#endif

layout(location = 0) out vec4 found;

void main() {
    // What an opaque surface hides is moved onto it: all walks pass all crossings, and there they pass them in no time.
    uint word = fragment_word(min(fragment_axial_depth(), last_axial_depth()));
    float near = sortable(word);
    float far = sortable(reversed_word(word));
#if FIRST
    float excess = starts_unknown == 0 ? 0.0 : gl_FrontFacing ? -1.0 : 1.0;
    found = vec4(near, far, -misplaced_axial_depth(), 1.0 + PEEL_UNIT * excess);
#else
    vec2 peeled = texelFetch(previous, ivec2(gl_FragCoord.xy), 0).rg;
    bool between = true;
    float alike = 0.0;
#if NEAR
    between = between && near > peeled.r;
    alike += near == peeled.r ? 1.0 : 0.0;
#endif
#if FAR
    between = between && far > peeled.g;
    alike += far == peeled.g ? PEEL_UNIT : 0.0;
#endif
    if (!between && alike == 0.0) { discard; }
    found = vec4(between ? near : NOTHING, between ? far : NOTHING, NOTHING, alike);
#endif
}
