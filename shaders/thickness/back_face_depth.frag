// Nearest front face and farthest back face: red and green keep their maximum, alpha counts the faces.

#include <constants>
#include <Body>
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif

in float axial;

layout(location = 0) out vec4 nearest_and_farthest;

void main() {
    float reached = max(axial, axial_start);
#if OPAQUE
    reached = min(reached, last_axial());
#endif
    nearest_and_farthest = gl_FrontFacing ? vec4(-reached, -NOTHING, 0.0, 1.0) : vec4(-NOTHING, reached, 0.0, 1.0);
}
