// Nearest front face and farthest back face: red and green keep their maximum, as blue does of how far the rasterizer may
// misplace a face; alpha counts the faces.

#include <constants>
#include "geometry/of_body.glsl"
#include "thickness/snapping.glsl"
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif

in float axial;

layout(location = 0) out vec4 nearest_and_farthest;

void main() {
    float misplaced = snapping(axial, snapping_share);
    float reached = max(axial, axial_start);
#if OPAQUE
    reached = min(reached, last_axial());
#endif
    float count = 1.0 + count_offset;
    nearest_and_farthest = gl_FrontFacing
        ? vec4(-reached, -NOTHING, misplaced, count)
        : vec4(-NOTHING, reached, misplaced, count);
}
