// Marks pixels whose light from interfaces needs more samples, and discards the others (see gpu/adaptive.py).
// After one sample, a pixel needs more if the light within 5 x 5 pixels is not linear. After n samples, it needs more if its
// standard error shows, deviation n^(-3/4), and it has fewer samples than the best number, which is in proportion to the power
// 4/5 of the deviation, relative to the root of the light within 3 x 3 pixels. The variance of a sample is that of the pixel's own
// samples and of what is expected from the 3 x 3 pixels, which counts as much as `prior` samples. An isolated pixel needs more whatever
// its samples agree on: it is brighter than all eight around it, or darker, by more than the error that shows and some standard
// errors. Pixels with the edge of an interface take all samples, as every error of their mean shows. MIRROR: the same for the light
// that bodies add to what the ground mirrors, in samples that hit no interface. measures: writes the deviations, and discards edges
// alone. Row 0 is the top row.

#include <constants>
#include <View>
#include "lib/color.glsl"

uniform sampler2D bent_light;      // sum over the samples that hit an interface; alpha: how many of them there are so far
uniform sampler2D bent_spread;     // r: sum of squared luminance; alpha: of the fractions that can be trusted
uniform sampler2D average_light;   // sum over the samples that hit no interface; alpha: how many these are; and what straight rays add
uniform float samples;             // of a pixel
uniform float most;                // that one may have which shows an interface alone
uniform float difference;          // one sample is enough up to this second difference of light nearby, as a fraction of its mean
uniform float much_lost;           // fraction of a pixel's light whose loss makes it invalid whatever other samples find
uniform float error;               // standard error that is as good as none, as a fraction of the light
uniform float wanted;              // samples of a pixel whose deviation is 1
uniform float apart;               // standard errors by which an isolated pixel is off each of the eight around it, at least
uniform float prior;               // samples that the variance expected from the pixels around counts as
uniform float by_edges;            // part of it that is expected from their means
uniform int first;                 // 1: there is one sample so far
uniform int measures;

layout(location = 0) out float unsettled;

// Mean variance of a sample within 3 x 3 pixels, divided by the mean square of their means about a plane, for an edge at a random
// place that is parallel to the sides of pixels. Both means have the weights of main().
const float VARIANCE_TO_UNEVEN = 8.0 / 3.0;

// Largest second difference of the channels of light across a pixel; a neighbor without light counts as the pixel itself.
float bend(ivec2 at, ivec2 step, ivec2 last, vec3 mean) {
    vec4 before = texelFetch(bent_light, clamp(at - step, ivec2(0), last), 0);
    vec4 after = texelFetch(bent_light, clamp(at + step, ivec2(0), last), 0);
    vec3 off = (before.a > 0.0 ? before.rgb / before.a - mean : vec3(0.0)) + (after.a > 0.0 ? after.rgb / after.a - mean : vec3(0.0));
    off = abs(off);
    return max(off.r, max(off.g, off.b));
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy), last = ivec2(frame_size.xy) - 1;
    vec4 own_light = texelFetch(bent_light, here, 0);
    float beside = texelFetch(average_light, here, 0).a, taken = own_light.a;
    float own = MIRROR == 1 ? beside : samples - beside;
    float lost = (MIRROR == 1 ? 0.0 : taken) - texelFetch(bent_spread, here, 0).a;
    bool complete = taken >= (own == samples ? most : own) || lost > much_lost * max(taken, samples / 16.0);
    bool needs_all = taken == 0.0 || (MIRROR == 0 && beside > 0.0);
    float own_level = luminance(own_light.rgb) / taken, own_variance = 0.0, bends = 0.0, lowest = 1e30, highest = -1e30;
    float local = 0.0, weights = 0.0, count = 0.0, variances = 0.0, squares = 0.0;
    vec3 slopes = vec3(0.0);  // of the levels of these pixels: mean, to the right, down
    // A loop with no turns is skipped by software rasterizers; the body of a branch is not.
    for (int y = complete || needs_all ? 2 : -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 at = clamp(here + ivec2(x, y), ivec2(0), last);
            vec4 light = texelFetch(bent_light, at, 0);
            if (light.a == 0.0) { continue; }
            vec3 mean = light.rgb / light.a;
            float level = luminance(mean), weight = float((2 - abs(x)) * (2 - abs(y)));
            for (int axis = 0; axis < 2 * first; ++axis) { bends = max(bends, bend(at, ivec2(1 - axis, axis), last, mean)); }
#if MIRROR
            vec4 all_light = texelFetch(average_light, at, 0);
            local += weight * luminance(all_light.rgb) / all_light.a;
#else
            local += weight * level;
#endif
            weights += weight;
            count += 1.0;
            float off = level - own_level;
            slopes += weight * off * vec3(1.0, x, y);
            squares += weight * off * off;
            if (at != here) { lowest = min(lowest, level); highest = max(highest, level); }
            float variance = max(texelFetch(bent_spread, at, 0).r - light.a * level * level, 0.0) / max(light.a - 1.0, 1.0);
            variances += weight * variance;
            if (at == here) { own_variance = variance; }
        }
    }
    if (complete || (needs_all && measures == 1)) { discard; }
    unsettled = 1.0;
    if (needs_all) { return; }
    local /= weights;
    if (first == 1) {
        if (bends <= difference * local) { discard; }
        return;
    }
    variances /= weights;
    // About a plane, whose weights within 3 x 3 pixels have the sums 16, 8 and 8; pixels without light count as this one.
    float uneven = max(squares - dot(slopes * slopes, vec3(1.0 / 16.0, 1.0 / 8.0, 1.0 / 8.0)), 0.0) / 16.0;
    float before = mix(variances, VARIANCE_TO_UNEVEN * uneven, by_edges);
    float variance = (prior * before + (taken - 1.0) * own_variance) / (prior + taken - 1.0), decrease = pow(taken, 1.5);
    unsettled = sqrt(variance / max(local, 1e-30));
    bool good = variance <= decrease * error * error * local * local;
    float off = count < 9.0 ? 0.0 : max(own_level - highest, lowest - own_level);
    bool isolated = off > error * local && off * off * decrease > apart * apart * variances;
    if (measures == 0 && !isolated && (good || taken >= wanted * pow(unsettled, 0.8))) { discard; }
}
