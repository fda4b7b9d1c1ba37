// Begins a pass of depth peeling: nothing is found yet, blue keeps how many faces are left, and depth keeps the pass out
// of pixels in which everything is known.

#include <constants>
#include "intervals/crossing.glsl"
#include "intervals/peel_faces.glsl"

uniform sampler2D previous;

layout(location = 0) out vec4 nothing;

void main() {
    vec4 found = texelFetch(previous, ivec2(gl_FragCoord.xy), 0);
    vec2 counted = counted_faces(found.a);
#if FIRST
    float left = counted.x;  // the first pass counts all
#else
    float left = found.b - counted.x - counted.y;
#endif
    nothing = vec4(NOTHING, NOTHING, left, 0.0);
    gl_FragDepth = is_end(found.rg, left) ? 0.0 : 1.0;
}
