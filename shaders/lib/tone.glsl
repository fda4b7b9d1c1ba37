// Tone curves: from linear radiance to linear colors that a display can show, 0 to 1; encode them as sRGB afterwards.
// Khronos PBR Neutral Tone Mapper (specification 2024); AgX (Sobotka 2022), base look. Pure. Rec.709.
// Each function is the float32 twin of the same name in translucent/formulas/tone.py, which explains the numbers.

#include <constants>

vec3 tone_none(vec3 linear) {
    return clamp(linear, 0.0, 1.0);
}

// Base colors up to 0.8 as they are lit, less what a dielectric reflects; highlights to white.
vec3 tone_neutral(vec3 linear) {
    vec3 color = max(linear, 0.0);
    float x = min(color.r, min(color.g, color.b));
    color -= x < 2.0 * NEUTRAL_F90 ? x - x * x / (4.0 * NEUTRAL_F90) : NEUTRAL_F90;
    float peak = max(color.r, max(color.g, color.b));
    if (peak <= NEUTRAL_START) {
        return color;
    }
    float compressed = 1.0 - (1.0 - NEUTRAL_START) * (1.0 - NEUTRAL_START) / (peak + 1.0 - 2.0 * NEUTRAL_START);
    float kept = 1.0 / (NEUTRAL_DESATURATION * (peak - compressed) + 1.0);
    return mix(vec3(compressed), color * (compressed / peak), kept);
}

// From 0 at 0 to 1 at 1: middle gray becomes 1/2, and the slope there is AGX_SLOPE.
float agx_sigmoid(float share) {
    float pivot = -AGX_LOW / (AGX_HIGH - AGX_LOW);
    float x = share - pivot;
    float power = x < 0.0 ? AGX_TOE : AGX_SHOULDER;
    float reach = x < 0.0 ? pivot : 1.0 - pivot;
    float bend = (pow(2.0 * AGX_SLOPE * reach, power) - 1.0) * pow(abs(x) / reach, power);
    return 0.5 + AGX_SLOPE * x * pow(1.0 + bend, -1.0 / power);
}

// 16.5 stops, in a gamut narrowed towards gray; bright colors fade to white.
vec3 tone_agx(vec3 linear) {
    vec3 color = max(linear, 0.0);
    float own = 1.0 - dot(AGX_MIX, vec3(1.0));
    vec3 narrowed = own * color + dot(AGX_MIX, color);
    vec3 stops = log2(clamp(narrowed / AGX_MIDDLE_GRAY, exp2(AGX_LOW), exp2(AGX_HIGH)));
    vec3 fractions = (stops - AGX_LOW) / (AGX_HIGH - AGX_LOW);
    vec3 encoded = vec3(agx_sigmoid(fractions.r), agx_sigmoid(fractions.g), agx_sigmoid(fractions.b));
    vec3 widened = (encoded - dot(AGX_MIX, encoded)) / own;
    return pow(clamp(widened, 0.0, 1.0), vec3(AGX_DISPLAY));
}
