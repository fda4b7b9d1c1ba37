// Turns nearest and farthest faces into a path and a count. More than one entry has a gap that this method cannot see:
// such a pixel gets a count that nothing expects, which marks it invalid.

#include "thickness/snapping.glsl"

uniform sampler2D nearest_and_farthest;

layout(location = 0) out vec2 path_and_count;

void main() {
    vec4 faces = texelFetch(nearest_and_farthest, ivec2(gl_FragCoord.xy), 0);
    bool entered = faces.r > -NOTHING;
    bool left = faces.g > -NOTHING;
    if (entered && left) {
        path_and_count = vec2(faces.g + faces.r, faces.a == 2.0 ? count_with_fraction(0.0, 2.0 * faces.b) : UNEXPECTED);
    } else if (left) {  // the eye is inside, and distances count from it
        path_and_count = vec2(faces.g, faces.a == 1.0 ? 1.0 : UNEXPECTED);
    } else {
        path_and_count = vec2(0.0, entered ? UNEXPECTED : 0.0);
    }
}
