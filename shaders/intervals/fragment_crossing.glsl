// The fragment at hand as a crossing: its axial depth, and its word. Needs the inputs of geometry/body.vert.

#include "geometry/of_body.glsl"
#include "intervals/crossing.glsl"
#include "thickness/snapping.glsl"

#if OPAQUE
uniform sampler2D opaque_axial_depth;
#endif

in float axial;

// Axial depth: 0 at the start of the media or of the ray, 1 at the end of the media.
float fragment_axial_depth() {
    return max(axial, axial_start) * axial_depth_scale + axial_depth_start;
}

// By how much axial depth the rasterizer may have misplaced this fragment.
float misplaced_axial_depth() {
    return snapping(axial, subpixel) * axial_depth_scale;
}

// Where the ray ends.
float last_axial_depth() {
#if OPAQUE
    return texelFetch(opaque_axial_depth, ivec2(gl_FragCoord.xy), 0).r;
#else
    return NOTHING;
#endif
}

uint fragment_word(float axial_depth) {
    // A choice between words: where the side itself becomes a number, softpipe takes every face for a back face.
    uint word = pack_crossing(axial_depth, slot_of_body, false);
    return gl_FrontFacing ? word : word + 1u;
}
