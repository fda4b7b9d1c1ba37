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

// Where a list keeps a crossing at this axial depth; false where it needs none, since an opaque surface hides it. Of a body that
// may be open before that surface, what is hidden decides whether the ray has rightly come to be in it: it is kept, moved onto it.
bool is_kept(inout float axial_depth) {
#if OPAQUE
    float last = last_axial_depth();
    if (axial_depth <= last) { return true; }
    axial_depth = last;
    return last >= slot_scattering[slot_of_body].w;
#else
    return true;
#endif
}

uint fragment_word(float axial_depth) {
    // A choice between words: where the side itself becomes a number, softpipe takes every face for a back face.
    uint word = pack_crossing(axial_depth, slot_of_body, false);
    return gl_FrontFacing ? word : word + 1u;
}
