// Phase functions: how a medium spreads the light that it scatters. Pure. Inputs: cos_scatter, the cosine between the directions
// of travel before and after an event, 1 straight on; phase: the four parameters of a phase function, x: g of Henyey and Greenstein,
// the mean cosine, -1 < g < 1. Each function is the float32 twin of the same name in translucent/formulas/phase.py, where the
// sources are cited: Henyey & Greenstein 1941; Witt 1977.

#include <constants>

// In 1/sr. Turned around for g < 0, the base does not cancel.
float henyey_greenstein(float cos_scatter, float anisotropy) {
    float g = abs(anisotropy);
    float cos_turned = anisotropy < 0.0 ? -cos_scatter : cos_scatter;
    float base = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cos_turned);
    return (1.0 - g) * (1.0 + g) / (4.0 * PI * base * sqrt(base));
}

// Cosine of the angle that light turns by, at random: share is a random number, 0 to 1.
float henyey_greenstein_cosine(float share, float anisotropy) {
    float g = anisotropy;
    float a = 2.0 * share - 1.0;
    float root = (1.0 - g) * (1.0 + g) / (1.0 + g * a);
    return clamp(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0);
}

// Evaluate a phase function, in 1/sr.
float phase_value(vec4 phase, float cos_scatter) {
    return henyey_greenstein(cos_scatter, phase.x);
}

// Sample it: a cosine distributed by it, for a random number.
float phase_cosine(vec4 phase, float share) {
    return henyey_greenstein_cosine(share, phase.x);
}
