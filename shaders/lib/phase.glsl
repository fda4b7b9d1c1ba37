// Phase functions: how a medium spreads the light that it scatters. Pure. Inputs: cos_scatter, the cosine between the directions
// of travel before and after an event, 1 straight on; phase: the four parameters of a phase function, which is a mixture: x: g of
// Henyey and Greenstein, the mean cosine, -1 < g < 1; y, z: g and alpha of Draine; w: the fraction of the light that the latter scatters.
// Each function is the float32 twin of the same name in translucent/formulas/phase.py, where the sources are cited: Henyey &
// Greenstein 1941; Witt 1977; Draine 2003; Jendersie & d'Eon 2023; Goudsmit & Saunderson 1940.

#include <constants>

const int AHEAD_EVENTS = 16;  // in sums: later ones leave Legendre moments of order 3 and more small, unless g > 0.98
const float LEAST_POWER = 0.15;  // of g: after as many events these moments are not seen
const int DRAINE_STEPS = 24;  // of Newton's method, or halvings of its bracket

// In 1/sr. Turned around for g < 0, the base does not cancel.
float henyey_greenstein(float cos_scatter, float anisotropy) {
    float g = abs(anisotropy);
    float cos_turned = anisotropy < 0.0 ? -cos_scatter : cos_scatter;
    float base = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cos_turned);
    return (1.0 - g) * (1.0 + g) / (4.0 * PI * base * sqrt(base));
}

// Cosine of the angle by which light is deflected, at random: share is a random number, 0 to 1.
float henyey_greenstein_cosine(float share, float anisotropy) {
    float g = anisotropy;
    float a = 2.0 * share - 1.0;
    float root = (1.0 - g) * (1.0 + g) / (1.0 + g * a);
    return clamp(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0);
}

// In 1/sr: Henyey and Greenstein's times 1 + alpha cos^2, normalised.
float draine(float cos_scatter, float anisotropy, float alpha) {
    float squares = (1.0 + 2.0 * anisotropy * anisotropy) / 3.0;  // mean of cos^2 by Henyey and Greenstein
    return henyey_greenstein(cos_scatter, anisotropy) * (1.0 + alpha * cos_scatter * cos_scatter) / (1.0 + alpha * squares);
}

// Cosine of the angle by which light is deflected, at random. The distribution of Draine is that of Henyey and Greenstein times
// 1 + alpha cos^2: its integral over their numbers t is a polynomial over powers of q = 1 - g + 2 g t, divided by such powers. It is
// solved for t by Newton's method in a bracket.
float draine_cosine(float share, float anisotropy, float alpha) {
    float g = anisotropy;
    float integral = share * (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0);
    float low = 0.0, high = 1.0, t = share;
    for (int i = 0; i < DRAINE_STEPS; ++i) {
        float q = 1.0 - g + 2.0 * g * t;
        float middle = (t * (1.0 + g * g) - (1.0 - g)) / q;
        float squares = middle * middle + t * t * (1.0 - g) * (1.0 + g) * (1.0 + g) * (1.0 + g) * (1.0 + g) / (3.0 * q * q * q);
        float beyond = t * (1.0 + alpha * squares) - integral;
        low = beyond > 0.0 ? low : t;
        high = beyond > 0.0 ? t : high;
        float cosine = henyey_greenstein_cosine(t, g);
        float next = t - beyond / (1.0 + alpha * cosine * cosine);
        t = next >= low && next <= high ? next : 0.5 * (low + high);
    }
    return henyey_greenstein_cosine(t, g);
}

// Evaluate a phase function, in 1/sr.
float phase_value(vec4 phase, float cos_scatter) {
    float value = (1.0 - phase.w) * henyey_greenstein(cos_scatter, phase.x);
    return phase.w == 0.0 ? value : value + phase.w * draine(cos_scatter, phase.y, phase.z);
}

// Phase function of light that was scattered ahead before on its path from a light, times the probability that it was. In
// 1/sr. anisotropy: g, 0 to 1. By Legendre moments (2 l + 1) / 4 pi g^l (e^(-(1 - g^l) depth) - e^-depth), where those up to order
// 2 decay by 1 - straight instead: they are in closed form, the rest by number of events n, a Poisson number,
// after which the phase function is that of g^(n + 1). depth: of scattering alone. lever: mean fraction of the way from the light at
// which it is; as much of each deflection is seen, so before g^lever takes the place of g.
vec3 phase_after_scattering(float cos_scatter, float anisotropy, float straight, vec3 depth, float lever) {
    float g = anisotropy;
    float before = pow(g, lever);
    float second = 1.5 * cos_scatter * cos_scatter - 0.5;
    vec3 none = exp(-depth);
    vec3 sum = (1.0 + g * (3.0 * cos_scatter + 5.0 * g * second)) * (exp((straight - 1.0) * depth) - none);
    vec3 probability = none;
    float power = g;
    for (int n = 1; n <= AHEAD_EVENTS; ++n) {
        probability *= depth / float(n);
        power *= before;
        if (power < LEAST_POWER) { break; }
        float base = (1.0 - power) * (1.0 - power) + 2.0 * power * (1.0 - cos_scatter);
        float beyond = (1.0 - power * power) / (base * sqrt(base)) - 1.0 - power * (3.0 * cos_scatter + 5.0 * power * second);
        sum += probability * beyond;
    }
    return sum / (4.0 * PI);
}

// Sample it: a cosine distributed by it, for a random number.
float phase_cosine(vec4 phase, float share) {
    if (phase.w > 0.0 && share <= phase.w) { return draine_cosine(share / phase.w, phase.y, phase.z); }
    return henyey_greenstein_cosine((share - phase.w) / (1.0 - phase.w), phase.x);
}
