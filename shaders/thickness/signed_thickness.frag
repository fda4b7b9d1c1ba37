// From the sums of signed_depth.frag to metres, with what they can be trusted for: the pass that an engine needs after it.
// Rows are as in the sums; transmittance.frag does the same for pictures, and goes on to light.

#include <View>
#include <Shade>
#include "lib/ray.glsl"
#include "thickness/balance.glsl"

uniform sampler2D accumulated;
#if SPECTRAL
uniform sampler2D accumulated_path;
#endif

layout(location = 0) out vec4 out_path;  // metres inside bodies, signed count, 1 if valid, 1 if covered
#if SPECTRAL
layout(location = 1) out vec4 out_optical_depth;
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    float advance = length(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
#if SPECTRAL
    vec4 sum = texelFetch(accumulated, texel, 0);
    float thickness = texelFetch(accumulated_path, texel, 0).r * advance;
    float counts = sum.a;
#else
    vec2 sum = texelFetch(accumulated, texel, 0).rg;
    float thickness = sum.r * advance;
    float counts = sum.g;
#endif
    bool valid = is_balanced(counts) && is_length(thickness, misplaced_length(counts, advance));
    bool covered = thickness > coverage_floor || !valid;
    out_path = vec4(valid ? max(thickness, 0.0) : 0.0, whole_count(counts), valid ? 1.0 : 0.0, covered ? 1.0 : 0.0);
#if SPECTRAL
    out_optical_depth = vec4(valid ? max(sum.rgb * advance, vec3(0.0)) : vec3(0.0), 1.0);
#endif
}
