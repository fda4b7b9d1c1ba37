// Light that leaves a body in which it diffuses. Pure. Fluence and flux in W/m^2 for radiance in W/(m^2 sr). Each function is
// the float32 twin of the same name in translucent/formulas/diffusion.py, where it is derived.

#include <constants>
#include "lib/optics.glsl"
#include "lib/phase.glsl"

// Radiance times 4 pi, inside a body below its surface and towards it, of light that has been scattered: fluence phi at the
// surface, flux E that enters there times the albedo w, conductance c of the interface, mean cosine m of entering light inside.
vec3 emergent_radiance(vec3 fluence, vec3 entering, vec3 albedo, float conductance, float mean_cosine, float cosine) {
    vec3 d = (2.0 - albedo) / 3.0;
    vec3 k = sqrt((1.0 - albedo) / d);
    vec3 slant = 1.0 + k * mean_cosine;
    vec3 own = min(entering / (slant * (conductance + k * d)), fluence);
    vec3 once = entering / (cosine + mean_cosine);
    vec3 gathered = (own + once * (mean_cosine * cosine) / (d * slant)) / (1.0 + k * cosine);
    vec3 rising = 1.0 + conductance * cosine / d + k * k * cosine * cosine;
    return once + albedo * (gathered + (fluence - own) * rising);
}

// Radiance by first events at an angle, over that by as many events that scatter to all sides alike, less 1. scale: albedo of single
// scattering over the reduced one.
vec3 first_events_excess(vec4 phase, vec3 scale, float cos_scatter) {
    return 4.0 * PI * phase_value(phase, cos_scatter) * scale - 1.0;
}

// The same, mean over azimuths: light that enters with a cosine of `down` with the normal, and leaves with one of `up`.
vec3 mean_first_events_excess(vec4 phase, vec3 scale, float down, float up) {
    float level = sqrt(max((1.0 - down * down) * (1.0 - up * up), 0.0));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < AZIMUTHS; ++i) {
        float azimuth = PI * (float(i) + 0.5) / float(AZIMUTHS);
        sum += first_events_excess(phase, scale, level * cos(azimuth) - down * up);
    }
    return sum / float(AZIMUTHS);
}

// Mean distance of the last scattering event from where a ray leaves a body, as a fraction of its path with an optical depth.
float last_event_fraction(float optical_depth) {
    float depth = max(optical_depth, LEAST_EVENT_DEPTH);
    return 1.0 / depth + 1.0 - 1.0 / opacity(vec3(depth)).x;
}

// Fraction of light on a path out of a body, at a cosine with the normal, that is still inside after an event ahead.
float staying_fraction(float cosine, float anisotropy) {
    return min(cosine / sqrt(max(2.0 / 3.0 * (1.0 - anisotropy), 1e-30)), 1.0);
}

// Radiance times 4 pi of directed light with unit irradiance, behind a path on which it has been scattered ahead alone: diffusion
// counts it as unscattered. depth: optical depth of its path; ahead: fraction of the extinction by such events; staying: fraction
// of the light by two or more that counts.
vec3 scattered_ahead(vec3 depth, vec3 ahead, float anisotropy, float cos_scatter, float staying) {
    float second = 1.5 * cos_scatter * cos_scatter - 0.5;
    vec3 none = exp(-depth);
    vec3 sum = (1.0 + 3.0 * cos_scatter) * (exp((ahead - 1.0) * depth) - none);
    sum += 5.0 * second * (exp((anisotropy * ahead - 1.0) * depth) - none);
    vec3 probability = none;
    float power = 1.0;
    for (int n = 1; n <= AHEAD_EVENTS; ++n) {
        probability *= ahead * depth / (anisotropy * float(n));
        power *= anisotropy;
        if (power < LEAST_POWER) { break; }
        float beyond = 4.0 * PI * henyey_greenstein(cos_scatter, power) - 1.0 - power * (3.0 * cos_scatter + 5.0 * power * second);
        sum += probability * beyond;
    }
    vec3 once = none * ahead * depth * ((4.0 * PI * henyey_greenstein(cos_scatter, anisotropy) - (1.0 - anisotropy)) / anisotropy);
    return max(mix(once, sum, staying), vec3(0.0));
}

// Fraction of forward-scattered light that an interface mirrors where a ray leaves a medium, after a depth of events ahead:
// Fresnel's reflectance of the ray where the light still goes as the ray does, less or more where it is spread.
vec3 ahead_mirrored(float cosine, float ior, float reflected, float reflected_flux, vec3 depth, float anisotropy) {
    vec3 s = max(depth / anisotropy, vec3(1e-3));
    vec3 mean_cosine = max(transmittance((1.0 - anisotropy) * s) - transmittance(s), vec3(0.0)) / opacity(s);
    float diffuse = reflected - 2.0 * cosine * (reflected - reflected_flux);
    float beside = abs(asin(1.0 / ior) - acos(clamp(cosine, 0.0, 1.0)));
    float ray = fresnel_dielectric(cosine, 1.0 / ior);
    return diffuse + (ray - diffuse) * pow(mean_cosine, vec3(AHEAD_ANGLE / max(beside, 1e-3)));
}
