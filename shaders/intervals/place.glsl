// Place and word of the fragment at hand. Needs the inputs of geometry/body.vert.

#include <Body>
#include "intervals/crossing.glsl"
#include "thickness/snapping.glsl"

#if OPAQUE
uniform sampler2D opaque_place;
#endif

in float axial;

// Where the ray has come when it meets this fragment: 0 at the start of the media or of the ray, 1 at their end.
float fragment_place() {
    return max(axial, axial_start) * place_scale + place_start;
}

// By how many places the rasterizer may have misplaced this fragment.
float misplaced_places() {
    return snapping(axial, subpixel) * place_scale;
}

// Where the ray ends.
float last_place() {
#if OPAQUE
    return texelFetch(opaque_place, ivec2(gl_FragCoord.xy), 0).r;
#else
    return NOTHING;
#endif
}

uint fragment_word(float place) {
    // A choice between words: where the side itself becomes a number, softpipe takes every face for a back face.
    uint word = pack_crossing(place, slot, false);
    return gl_FrontFacing ? word : word + 1u;
}
