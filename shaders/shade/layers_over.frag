// Layers over the picture of all else, by blending: RADIANCE: their light, and as alpha the fraction of the picture that
// they leave; SHARE: that fraction; DEPTH: minus its logarithm; SUM: what there is now, to be averaged over samples.
// Row 0 of the output is the top row.

#if !(RADIANCE || SHARE || DEPTH || SUM)
#error one of RADIANCE, SHARE, DEPTH and SUM is 1
#endif

#include <constants>
#include <View>

#if RADIANCE || SHARE || DEPTH
uniform sampler2D layers_in_front;
uniform sampler2D layers_behind;
#endif
#if RADIANCE || SUM
uniform sampler2D straight_transmittance;
#endif
#if SUM
uniform sampler2D shaded_radiance;
uniform sampler2D shaded_transmittance;  // alpha: fraction of the light that can be trusted
#endif

layout(location = 0) out vec4 first;
#if SUM
layout(location = 1) out vec4 second;
#endif

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
#if SUM
    first = texelFetch(shaded_radiance, here, 0);
    second = vec4(texelFetch(straight_transmittance, here, 0).rgb, texelFetch(shaded_transmittance, here, 0).a);
#else
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    vec4 in_front = texelFetch(layers_in_front, texel, 0);
    vec4 behind = texelFetch(layers_behind, texel, 0);
    float left = (1.0 - in_front.a) * (1.0 - behind.a);
#if RADIANCE
    vec3 dimmed = texelFetch(straight_transmittance, here, 0).rgb * behind.rgb;
    first = vec4(in_front.rgb + (1.0 - in_front.a) * dimmed, left);
#elif DEPTH
    first = vec4(vec3(left < 1.0 ? -log(max(left, 1e-37)) : 0.0), 0.0);
#else
    first = vec4(0.0, 0.0, 0.0, left);
#endif
#endif
}
