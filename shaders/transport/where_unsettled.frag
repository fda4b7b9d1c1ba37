// Depth that lets rays be traced where an interface is visible in a pixel that needs more samples, and nowhere else; adds nothing to
// sums. MIRROR: where none is visible, for rays that the ground mirrors. Row 0 is the top row.

#include <constants>
#include <View>

uniform sampler2D entered;
uniform sampler2D unsettled;

layout(location = 0) out vec4 light;
layout(location = 1) out vec4 spread;

void main() {
    float front = texelFetch(entered, ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y), 0).w;
#if MIRROR
    bool requested = front >= NOTHING;
#else
    bool requested = front < NOTHING;
#endif
    gl_FragDepth = requested && texelFetch(unsettled, ivec2(gl_FragCoord.xy), 0).r > 0.0 ? 1.0 : 0.0;
    light = vec4(0.0);
    spread = vec4(0.0);
}
