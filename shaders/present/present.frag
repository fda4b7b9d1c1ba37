// A linear picture on a display: exposure, tone curve (TONE counts those in translucent.formulas.tone.TONES), sRGB. The picture's row 0 is its top row.

#include "present/develop.glsl"

uniform sampler2D picture;
uniform float stops;

layout(location = 0) out vec4 encoded;

void main() {
    ivec2 size = textureSize(picture, 0);
    vec3 radiance = texelFetch(picture, ivec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y), 0).rgb;
    encoded = vec4(develop(radiance, stops), 1.0);
}
