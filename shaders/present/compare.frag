// What the previewer shows: a picture or a quantity, and right of a split the same of another frame, or their
// difference. A frame is kept as stride x stride smaller ones, each of every so many pixels; a neighbor
// shows in place of a pixel that is not drawn yet. The second frame may be smaller; its pixels are then as large as they are.
// MODE: 0 picture, 1 thickness, 2 transmittance, 3 validity. RIGHT: 0 the same frame, 1 the second, 2 the first minus
// the second.

#include "present/develop.glsl"
#include <constants>

uniform sampler2D light_a;
uniform sampler2D depths_a;
uniform sampler2D trust_a;
uniform sampler2D light_b;
uniform sampler2D depths_b;
uniform sampler2D trust_b;
uniform sampler2D false_colors;
uniform int shift_a;         // the stride as a power of 2
uniform int shift_b;
uniform ivec4 known_a[64];   // which of the smaller frames stands in for each one: column + stride * row, in fours
uniform ivec4 known_b[64];
uniform float split;         // pixels from the left
uniform float thickest;      // thickness of the last false color, in m
uniform float worst;         // largest difference of thickness with a color of its own, in m
uniform float stops;
uniform vec3 empty_color;    // sRGB: no medium
uniform vec3 valid_color;     // valid
uniform vec3 wrong_color;    // not valid

layout(location = 0) out vec4 encoded;

bool has(vec4 trust, float flag) {
    return mod(floor(trust.r / flag), 2.0) == 1.0;
}

// Of summed light with the number of its samples, which some modes do not read.
vec3 view_color(vec4 summed, vec4 depths, vec4 trust) {
    bool covered = has(trust, FLAG_COVERED), valid = has(trust, FLAG_VALID);
#if MODE == 1
    float fraction = clamp(depths.a / thickest, 0.0, 1.0) * 255.0;
    vec3 color = covered ? texelFetch(false_colors, ivec2(round(fraction), 0), 0).rgb : empty_color;
    return valid ? color : wrong_color;
#elif MODE == 2
    return linear_to_srgb(exp(-min(depths.rgb, 80.0)));
#else
    vec3 picture = develop(summed.rgb / max(summed.a, 1.0), stops);
#if MODE == 3
    vec3 dimmed = vec3(0.35 * luminance(picture));
    return valid ? (covered ? mix(dimmed, valid_color, 0.6) : dimmed) : wrong_color;
#else
    return picture;
#endif
#endif
}

// Blue where the first is thinner, red where it is thicker; orange where one of them cannot be trusted.
vec3 difference(vec4 depths, vec4 trust, vec4 other_depths, vec4 other_trust) {
    if (!has(trust, FLAG_VALID) || !has(other_trust, FLAG_VALID)) {
        return wrong_color;
    }
    if (!has(trust, FLAG_COVERED) && !has(other_trust, FLAG_COVERED)) {
        return empty_color;
    }
    float fraction = clamp((depths.a - other_depths.a) / worst, -1.0, 1.0);
    vec3 end = fraction < 0.0 ? vec3(0.13, 0.40, 0.80) : vec3(0.80, 0.15, 0.18);
    return mix(vec3(0.95), end, sqrt(abs(fraction)));
}

ivec2 kept(ivec2 pixel, ivec2 size, int shift, int known) {
    return ivec2(known & ((1 << shift) - 1), known >> shift) * (size >> shift) + (pixel >> shift);
}

int within(ivec2 pixel, int shift) {
    ivec2 phase = pixel & ((1 << shift) - 1);
    return phase.x + (phase.y << shift);
}

void main() {
    ivec2 size = textureSize(light_a, 0);
    ivec2 pixel = ivec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y);
    int phase = within(pixel, shift_a);
    ivec2 here = kept(pixel, size, shift_a, known_a[phase >> 2][phase & 3]);
    vec4 depths = texelFetch(depths_a, here, 0), trust = texelFetch(trust_a, here, 0);
#if RIGHT != 0
    if (gl_FragCoord.x > split) {
        ivec2 other_size = textureSize(light_b, 0);
        ivec2 there = ivec2((vec2(pixel) + 0.5) / vec2(size) * vec2(other_size));
        int other_phase = within(there, shift_b);
        there = kept(there, other_size, shift_b, known_b[other_phase >> 2][other_phase & 3]);
        vec4 other = texelFetch(depths_b, there, 0), other_trust = texelFetch(trust_b, there, 0);
#if RIGHT == 2
        encoded = vec4(difference(depths, trust, other, other_trust), 1.0);
#else
        encoded = vec4(view_color(texelFetch(light_b, there, 0), other, other_trust), 1.0);
#endif
        return;
    }
#endif
    encoded = vec4(view_color(texelFetch(light_a, here, 0), depths, trust), 1.0);
}
