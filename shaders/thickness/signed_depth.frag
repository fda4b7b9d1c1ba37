// Signed depth (Baker & Boyd 2001): exits count up, entries count down, in any order, added up by blending.
// The sum is the path inside the body; a count that does not balance betrays a hole or a flipped face.

#include "geometry/of_body.glsl"
#include "thickness/snapping.glsl"
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif

in float axial;

#if SPECTRAL
layout(location = 0) out vec4 optical_depth_and_count;  // per metre of ray advance
layout(location = 1) out float path;
#else
layout(location = 0) out vec2 path_and_count;
#endif

void main() {
    float side = gl_FrontFacing ? -1.0 : 1.0;
    float count = count_with_fraction(side * count_weight + count_offset, snapping(axial, snapping_share));
    float reached = max(axial, axial_start);
#if OPAQUE
    reached = min(reached, last_axial());
#endif
    float signed_path = side * reached;
#if SPECTRAL
    optical_depth_and_count = vec4(signed_path * extinction.rgb, count);
    path = signed_path;
#else
    path_and_count = vec2(signed_path, count);
#endif
}
