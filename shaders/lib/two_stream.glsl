// Light that a layer scatters any number of times, as one diffuse stream forwards and one backwards. Pure. Depths are
// without unit: coefficients K and S in 1/m times the thickness of the layer. Each function is the float32 twin of the
// same name in translucent/formulas/two_stream.py, where the sources are cited: Schuster 1905; Kubelka & Munk 1931; Gate 1974;
// Saunderson 1942.

#include <constants>
#include "lib/optics.glsl"

// K in 1/m: diffuse light travels twice as far as the layer is thick.
vec3 two_stream_absorption(vec3 absorption) {
    return 2.0 * absorption;
}

// S in 1/m.
vec3 two_stream_scattering(vec3 scattering, float anisotropy) {
    return 0.75 * (1.0 - anisotropy) * scattering;
}

// gamma d = sqrt(K (K + 2 S)) d; as two roots, so that no product overflows.
vec3 two_stream_depth(vec3 absorption_depth, vec3 scattering_depth) {
    return sqrt(absorption_depth) * sqrt(absorption_depth + 2.0 * scattering_depth);
}

// The common denominator of both fractions: ((K + S) sinh(gamma d) / gamma + cosh(gamma d)) exp(-gamma d), without overflow.
vec3 two_stream_denominator(vec3 absorption_depth, vec3 scattering_depth) {
    vec3 round_trip = 2.0 * two_stream_depth(absorption_depth, scattering_depth);
    return (absorption_depth + scattering_depth) * mean_transmittance(round_trip) + 0.5 * (1.0 + transmittance(round_trip));
}

vec3 two_stream_reflectance(vec3 absorption_depth, vec3 scattering_depth) {
    vec3 round_trip = 2.0 * two_stream_depth(absorption_depth, scattering_depth);
    return scattering_depth * mean_transmittance(round_trip) / two_stream_denominator(absorption_depth, scattering_depth);
}

vec3 two_stream_transmittance(vec3 absorption_depth, vec3 scattering_depth) {
    vec3 depth = two_stream_depth(absorption_depth, scattering_depth);
    return transmittance(depth) / two_stream_denominator(absorption_depth, scattering_depth);
}

// Without the light that turned around once: S / (2 (K + S)) (1 - exp(-2 (K + S) d)).
vec3 multiple_reflectance(vec3 absorption_depth, vec3 scattering_depth) {
    vec3 once = scattering_depth * mean_transmittance(2.0 * (absorption_depth + scattering_depth));
    return max(two_stream_reflectance(absorption_depth, scattering_depth) - once, vec3(0.0));
}

// A layer between two interfaces that mirror the fraction r of diffuse light from inside, any number of times.
vec3 mirrored_reflectance(vec3 reflectance, vec3 transmittance, float mirrored) {
    vec3 alike = 1.0 - mirrored * (reflectance + transmittance);
    vec3 opposite = 1.0 - mirrored * (reflectance - transmittance);
    vec3 turned = reflectance * (1.0 - mirrored * reflectance) + mirrored * transmittance * transmittance;
    return (1.0 - mirrored) * turned / (alike * opposite);
}

vec3 mirrored_transmittance(vec3 reflectance, vec3 transmittance, float mirrored) {
    vec3 alike = 1.0 - mirrored * (reflectance + transmittance);
    vec3 opposite = 1.0 - mirrored * (reflectance - transmittance);
    return (1.0 - mirrored) * transmittance / (alike * opposite);
}
