// Formulas of light in a medium. Inputs: extinction in 1/m, distance in m, optical depth without unit, cosines.
// Pure: needs only <constants>. Each function is the float32 twin of the same name in translucent/optics.py, where the
// sources are cited: Beer-Lambert; Max 1995; Porter & Duff 1984; Fresnel; Drobot 2017; Henyey & Greenstein 1941.

#include <constants>

// T = exp(-tau). The clamp keeps infinities out of exp; float32 is 0 from tau = 104 on.
vec3 transmittance(vec3 optical_depth) {
    return exp(-min(optical_depth, vec3(MAX_OPTICAL_DEPTH)));
}

// (1 - exp(-x)) / x. Near 0 the difference cancels, so a Taylor series takes over: its first omitted term,
// x^9 / 10!, is below float32 rounding up to the switch at 0.5.
vec3 mean_opacity_slope(vec3 optical_depth) {
    vec3 x = min(optical_depth, vec3(MAX_OPTICAL_DEPTH));
    vec3 series = vec3(1.0) - x / 9.0;
    for (int k = 8; k >= 2; --k) {
        series = vec3(1.0) - x / float(k) * series;
    }
    vec3 direct = (vec3(1.0) - exp(-x)) / max(x, vec3(SERIES_LIMIT));
    // Beyond the clamp the numerator is 1.
    direct = mix(direct, 1.0 / max(optical_depth, vec3(1.0)), greaterThan(optical_depth, vec3(MAX_OPTICAL_DEPTH)));
    return mix(direct, series, lessThan(x, vec3(SERIES_LIMIT)));
}

// alpha = 1 - exp(-tau), without cancellation at small tau.
vec3 opacity(vec3 optical_depth) {
    vec3 x = min(optical_depth, vec3(MAX_OPTICAL_DEPTH));
    return mix(vec3(1.0) - exp(-x), x * mean_opacity_slope(x), lessThan(x, vec3(SERIES_LIMIT)));
}

// sigma_t = -log(t_c) / d.
vec3 extinction_from_color(vec3 color, float distance_m) {
    return -log(color) / distance_m;
}

// q / sigma_t (1 - exp(-sigma_t d)), and q d where sigma_t = 0.
vec3 emitted_radiance(vec3 emission, vec3 extinction, float distance_m) {
    return emission * distance_m * mean_opacity_slope(extinction * distance_m);
}

// Opacity of a step that is step_ratio times as long: 1 - (1 - alpha)^ratio.
float opacity_for_step(float opacity_at_reference, float step_ratio) {
    // log1p of a small alpha by Kahan's trick: (1 - alpha) has rounded, and dividing by what it rounded to undoes it.
    float kept = 1.0 - opacity_at_reference;
    float lost = 1.0 - kept;
    float log_kept = lost == 0.0 ? -opacity_at_reference : log(kept) * (opacity_at_reference / lost);
    return kept <= 0.0 ? (step_ratio > 0.0 ? 1.0 : 0.0) : opacity(vec3(-step_ratio * log_kept)).x;
}

// Front over behind, associated (premultiplied) colors.
vec3 composite_over(vec3 front, float front_opacity, vec3 behind) {
    return front + (1.0 - front_opacity) * behind;
}

// Unpolarised reflectance of a smooth dielectric; ior is relative to the side that the ray comes from.
float fresnel_dielectric(float cos_incident, float ior) {
    float k = ior * ior - (1.0 - cos_incident) * (1.0 + cos_incident);
    if (ior == 1.0) { return 0.0; }
    if (k <= 0.0) { return 1.0; }  // total internal reflection
    float root = sqrt(k);
    float parallel = (ior * ior * cos_incident - root) / (ior * ior * cos_incident + root);
    float normal = (cos_incident - root) / (cos_incident + root);
    return 0.5 * (parallel * parallel + normal * normal);
}

// Snell: cosine inside; 0 under total internal reflection.
float refracted_cosine(float cos_incident, float ior) {
    return sqrt(max(1.0 - (1.0 - cos_incident) * (1.0 + cos_incident) / (ior * ior), 0.0));
}

// Path through a thin sheet: t / max(0.001, cosine inside).
float thin_layer_thickness(float thickness, float cos_view, float ior) {
    return thickness / max(refracted_cosine(max(cos_view, 0.0), ior), MIN_THIN_LAYER_COSINE);
}

// Phase function in 1/sr; cos_scatter = 1 is straight on. The form of the base avoids cancellation as g -> 1.
float henyey_greenstein(float cos_scatter, float anisotropy) {
    float g = anisotropy;
    float base = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cos_scatter);
    return (1.0 - g) * (1.0 + g) / (4.0 * PI * base * sqrt(base));
}
