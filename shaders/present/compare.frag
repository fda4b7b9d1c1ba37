// What the previewer shows: a picture or a quantity, and right of a split the same of another frame, or their
// difference. The second frame may be smaller; its pixels are then as large as they are.

#include "present/develop.glsl"
#include <constants>

uniform sampler2D light_a;
uniform sampler2D depths_a;
uniform sampler2D trust_a;
uniform sampler2D light_b;
uniform sampler2D depths_b;
uniform sampler2D trust_b;
uniform sampler2D false_colors;
uniform int mode;            // 0 picture, 1 thickness, 2 transmittance, 3 validity
uniform int right_side;      // 0 the same frame, 1 the second, 2 the first minus the second
uniform float split;         // pixels from the left
uniform float thickest;      // thickness of the last false color, in m
uniform float worst;         // largest difference of thickness with a color of its own, in m
uniform float stops;
uniform int tone;
uniform vec3 empty_color;    // sRGB: no medium
uniform vec3 seen_color;     // valid
uniform vec3 wrong_color;    // not valid

layout(location = 0) out vec4 encoded;

bool has(vec4 trust, float flag) {
    return mod(floor(trust.r / flag), 2.0) == 1.0;
}

vec3 shown(vec4 light, vec4 depths, vec4 trust) {
    bool covered = has(trust, FLAG_COVERED), valid = has(trust, FLAG_VALID);
    if (mode == 1) {
        if (!valid) {
            return wrong_color;
        }
        float place = clamp(depths.a / thickest, 0.0, 1.0) * 255.0;
        return covered ? texelFetch(false_colors, ivec2(round(place), 0), 0).rgb : empty_color;
    }
    if (mode == 2) {
        return linear_to_srgb(exp(-min(depths.rgb, 80.0)));
    }
    vec3 picture = develop(light.rgb / max(light.a, 1.0), stops, tone);
    if (mode == 3) {
        vec3 dimmed = vec3(0.35 * luminance(picture));
        return valid ? (covered ? mix(dimmed, seen_color, 0.6) : dimmed) : wrong_color;
    }
    return picture;
}

// Blue where the first is thinner, red where it is thicker; orange where one of them cannot be trusted.
vec3 difference(vec4 depths, vec4 trust, vec4 other_depths, vec4 other_trust) {
    if (!has(trust, FLAG_VALID) || !has(other_trust, FLAG_VALID)) {
        return wrong_color;
    }
    if (!has(trust, FLAG_COVERED) && !has(other_trust, FLAG_COVERED)) {
        return empty_color;
    }
    float share = clamp((depths.a - other_depths.a) / worst, -1.0, 1.0);
    vec3 end = share < 0.0 ? vec3(0.13, 0.40, 0.80) : vec3(0.80, 0.15, 0.18);
    return mix(vec3(0.95), end, sqrt(abs(share)));
}

void main() {
    ivec2 size = textureSize(light_a, 0);
    ivec2 pixel = ivec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y);
    vec4 light = texelFetch(light_a, pixel, 0), depths = texelFetch(depths_a, pixel, 0);
    vec4 trust = texelFetch(trust_a, pixel, 0);
    vec3 color = shown(light, depths, trust);
    if (right_side != 0 && gl_FragCoord.x > split) {
        ivec2 there = ivec2((vec2(pixel) + 0.5) / vec2(size) * vec2(textureSize(light_b, 0)));
        vec4 other = texelFetch(depths_b, there, 0), other_trust = texelFetch(trust_b, there, 0);
        color = right_side == 2 ? difference(depths, trust, other, other_trust)
                                : shown(texelFetch(light_b, there, 0), other, other_trust);
    }
    encoded = vec4(color, 1.0);
}
