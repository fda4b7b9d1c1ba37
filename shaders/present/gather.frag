// A sample of a larger picture, put where it is kept: radiance to be summed, and data of the pixel centers.
// Row 0 is the top row.

uniform sampler2D radiance;
uniform sampler2D optical_depth;
uniform sampler2D thickness;
uniform sampler2D flags;
uniform ivec2 origin;

layout(location = 0) out vec4 summed;   // radiance, and of how many samples it is the sum
layout(location = 1) out vec4 depths;   // optical depth, thickness in m
layout(location = 2) out vec4 trust;    // flags

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - origin;
    summed = vec4(texelFetch(radiance, texel, 0).rgb, 1.0);
    depths = vec4(texelFetch(optical_depth, texel, 0).rgb, texelFetch(thickness, texel, 0).r);
    trust = vec4(round(texelFetch(flags, texel, 0).r * 255.0), 0.0, 0.0, 0.0);
}
