// A linear picture on a display: exposure, clamp, sRGB. The picture's row 0 is its top row.

#include "lib/color.glsl"

uniform sampler2D picture;
uniform float stops;

layout(location = 0) out vec4 encoded;

void main() {
    ivec2 size = textureSize(picture, 0);
    vec3 linear = texelFetch(picture, ivec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y), 0).rgb;
    encoded = vec4(linear_to_srgb(clamp(linear * exposure_scale(stops), 0.0, 1.0)), 1.0);
}
