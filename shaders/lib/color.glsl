// Color encodings (IEC 61966-2-1, ITU-R BT.709). Pure. Inputs: linear Rec.709 or sRGB-encoded channels, exposure in stops.
// Each function is the float32 twin of the same name in translucent/formulas/color.py.

#include <constants>

vec3 srgb_to_linear(vec3 encoded) {
    vec3 a = abs(encoded);
    vec3 curve = pow((a + 0.055) / 1.055, vec3(2.4));
    return sign(encoded) * mix(curve, a / 12.92, lessThanEqual(a, vec3(0.04045)));
}

vec3 linear_to_srgb(vec3 linear) {
    vec3 a = abs(linear);
    vec3 curve = 1.055 * pow(a, vec3(1.0 / 2.4)) - 0.055;
    return sign(linear) * mix(curve, a * 12.92, lessThanEqual(a, vec3(0.0031308)));
}

float luminance(vec3 linear) {
    return dot(linear, LUMINANCE_WEIGHTS);
}

float exposure_scale(float stops) {
    return exp2(stops);
}
