// A sample of some pixels of a larger picture. One of `stride` x `stride` pixels has its center where a pixel of the
// sample has it; the `block` x `block` pixels from there on show it until they get their own. Row 0 is the top row.

uniform sampler2D radiance;
uniform sampler2D optical_depth;
uniform sampler2D thickness;
uniform sampler2D flags;
uniform ivec2 phase;
uniform int stride;
uniform int block;

layout(location = 0) out vec4 summed;   // radiance, and of how many samples it is the sum
layout(location = 1) out vec4 depths;   // optical depth, thickness in m
layout(location = 2) out vec4 trust;    // flags

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 within = pixel % stride - phase;
    if (within.x < 0 || within.y < 0 || within.x >= block || within.y >= block) {
        discard;
    }
    ivec2 texel = pixel / stride;
    summed = vec4(texelFetch(radiance, texel, 0).rgb, 1.0);
    depths = vec4(texelFetch(optical_depth, texel, 0).rgb, texelFetch(thickness, texel, 0).r);
    trust = vec4(round(texelFetch(flags, texel, 0).r * 255.0), 0.0, 0.0, 0.0);
}
