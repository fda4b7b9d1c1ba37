// Pixels whose light from interfaces needs more samples; the others are discarded. After one sample those are whose light differs
// within 5 x 5 pixels. After several, a pixel needs samples in proportion to the power 2/3 of its standard deviation, as that takes
// most off the error of the picture for its time (Neyman 1934); the deviation is the mean within 3 x 3 pixels, and relative to the
// root of the light there. Pixels with the edge of an interface take all samples, as every error of their mean shows. MIRROR: likewise
// for the light that bodies add to what the ground mirrors, in samples that hit no interface. measures: writes deviations, and
// discards nothing that differs but edges. Row 0 is the top row.

#include <constants>
#include <View>
#include "lib/color.glsl"

uniform sampler2D bent_light;      // sum over the samples that hit an interface; alpha: how many of them there are so far
uniform sampler2D bent_spread;     // r: sum of squared luminance; alpha: of the fractions that can be trusted
uniform sampler2D average_light;   // sum over the samples that hit no interface; alpha: how many these are
uniform float samples;             // of a pixel
uniform float most;                // that one may have which shows an interface alone
uniform float contrast;            // largest range of light near a pixel that one sample is enough for, as a fraction of its mean
uniform float much_lost;           // fraction of a pixel's light whose loss makes it invalid whatever other samples find
uniform float error;               // standard error that is as good as none, as a fraction of the light
uniform float wanted;              // samples of a pixel whose deviation is 1
uniform int first;                 // 1: there is one sample so far
uniform int measures;

layout(location = 0) out float unsettled;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy), last = ivec2(frame_size.xy) - 1;
    float beside = texelFetch(average_light, here, 0).a, taken = texelFetch(bent_light, here, 0).a;
    float own = MIRROR == 1 ? beside : samples - beside;
    if (taken >= (own == samples ? most : own)) { discard; }
    float lost = (MIRROR == 1 ? 0.0 : taken) - texelFetch(bent_spread, here, 0).a;
    if (lost > much_lost * max(taken, samples / 16.0)) { discard; }
    unsettled = 1.0;
    if (taken == 0.0 || (MIRROR == 0 && beside > 0.0)) {
        if (measures == 1) { discard; }
        return;
    }
    int reach = first == 1 ? 2 : 1;
    vec3 low = vec3(NOTHING), high = vec3(0.0);
    float sum = 0.0, count = 0.0, squares = 0.0;
    for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) {
            ivec2 at = clamp(here + ivec2(x, y), ivec2(0), last);
            vec4 light = texelFetch(bent_light, at, 0);
            if (light.a == 0.0) { continue; }
            vec3 mean = light.rgb / light.a;
            low = min(low, mean);
            high = max(high, mean);
            float level = luminance(mean);
#if MIRROR
            vec4 all_light = texelFetch(average_light, at, 0);
            sum += luminance(all_light.rgb) / all_light.a;
#else
            sum += level;
#endif
            count += 1.0;
            if (light.a > 1.0) { squares += max(texelFetch(bent_spread, at, 0).r - light.a * level * level, 0.0) / (light.a - 1.0); }
        }
    }
    vec3 range = high - low;
    if (first == 1) {
        if (max(range.r, max(range.g, range.b)) <= contrast * sum / count) { discard; }
        return;
    }
    unsettled = sqrt(squares / max(sum, 1e-30));
    bool good = squares * count <= taken * error * error * sum * sum;
    if (measures == 0 && (good || taken >= wanted * pow(unsettled, 2.0 / 3.0))) { discard; }
}
