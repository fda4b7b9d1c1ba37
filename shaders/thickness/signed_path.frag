// Signed depth of bodies without holes that share one medium: the path alone, for maps of shadows. See signed_depth.frag.

#include <Body>
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif

in float axial;

layout(location = 0) out float path;

void main() {
    float reached = max(axial, axial_start);
#if OPAQUE
    reached = min(reached, last_axial());
#endif
    path = gl_FrontFacing ? -reached : reached;
}
