// Signed depth of bodies without holes and of one medium, or with TWO_MEDIA of two, for maps of shadows. See
// signed_depth.frag.
// PROJECTED_DEPTH: what is behind an opaque surface fails the depth test. What was counted then does not balance, and the
// lookup ends it at the surface: the sum of min(reached, end) is the sum of reached where that is less, less the end for
// each entry that is counted and no exit. So counted lengths are from the center, and not from each body's anchor.

#include "geometry/of_body.glsl"
#if OPAQUE && !PROJECTED_DEPTH
#include "intervals/last_axial.glsl"
#endif

in float axial;

layout(location = 0) out vec2 path_and_count;  // or the paths in two media: of other slots it has none

void main() {
    float side = gl_FrontFacing ? -1.0 : 1.0;
    float reached = axial;  // maps look at all of the scene from outside
#if PROJECTED_DEPTH
    path_and_count = side * vec2(reached * axial_depth_scale + axial_depth_start, 1.0);
#else
#if OPAQUE
    reached = min(reached, last_axial());
#endif
#if TWO_MEDIA
    path_and_count = side * reached * vec2(equal(ivec2(slot_of_body), ivec2(0, 1)));
#else
    path_and_count = vec2(side * reached, 0.0);
#endif
#endif
}
