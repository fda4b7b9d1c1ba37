// Formulas of light in a medium. Inputs: extinction in 1/m, distance in m, optical depth without unit, cosines.
// Pure: needs only <constants>. Each function is the float32 twin of the same name in translucent/formulas/optics.py, where the
// sources are cited: Beer-Lambert; Max 1995; Porter & Duff 1984; Fresnel; Drobot 2017.

#include <constants>

// (1 - exp(-x)) / x. Near 0 the difference cancels, so a Taylor series takes over: its first omitted term,
// x^9 / 10!, is below float32 rounding up to the switch at 0.5.
vec3 mean_transmittance(vec3 optical_depth) {
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
    return mix(vec3(1.0) - exp(-x), x * mean_transmittance(x), lessThan(x, vec3(SERIES_LIMIT)));
}

// T = exp(-tau); 0 from tau = 104 on in float32. Near 1 drivers' exp is off by a rounding, 1 - opacity is not.
vec3 transmittance(vec3 optical_depth) {
    vec3 x = min(optical_depth, vec3(MAX_OPTICAL_DEPTH));
    // Taylor series, without the divisions of mean_transmittance: up to the switch x^9 / 9! is below float32 rounding.
    vec3 series = 1.0 / 5040.0 - x / 40320.0;
    series = 1.0 / 120.0 - x * (1.0 / 720.0 - x * series);
    series = 0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * series));
    return mix(exp(-x), vec3(1.0) - x * (vec3(1.0) - x * series), lessThan(x, vec3(SERIES_LIMIT)));
}

// log(1 - x). Drivers' log has an absolute error, useless near 1; there it is 2 artanh(-x / (2 - x)) as a series whose
// first omitted term, s^14 / 15, is below float32 rounding for |s| <= 1/3.
float log_one_minus(float x) {
    if (x > 0.5) { return log(1.0 - x); }
    float s = -x / (2.0 - x);
    float s2 = s * s;
    float series = 1.0 / 13.0;
    for (int k = 11; k >= 1; k -= 2) {
        series = 1.0 / float(k) + s2 * series;
    }
    return 2.0 * s * series;
}

// sigma_t = -log(t_c) / d. For t_c >= 0.5 the difference 1 - t_c is exact.
vec3 extinction_from_color(vec3 color, float distance_m) {
    vec3 near_white = vec3(log_one_minus(1.0 - color.r), log_one_minus(1.0 - color.g), log_one_minus(1.0 - color.b));
    return -mix(log(color), near_white, greaterThanEqual(color, vec3(0.5))) / distance_m;
}

// q / sigma_t (1 - exp(-sigma_t d)), and q d where sigma_t = 0.
vec3 emitted_radiance(vec3 emission, vec3 extinction, float distance_m) {
    return emission * distance_m * mean_transmittance(extinction * distance_m);
}

// Opacity of a step that is step_ratio times as long: 1 - (1 - alpha)^ratio.
float opacity_for_step(float opacity_at_reference, float step_ratio) {
    if (step_ratio == 0.0) { return 0.0; }
    if (opacity_at_reference >= 1.0) { return 1.0; }
    return opacity(vec3(-step_ratio * log_one_minus(opacity_at_reference))).x;
}

// Front over behind, associated (premultiplied) colors.
vec3 composite_over(vec3 front, float front_opacity, vec3 behind) {
    return front + (1.0 - front_opacity) * behind;
}

// Unpolarized reflectance of a smooth dielectric; ior is relative to the side that the ray comes from.
// Multiplied out, each amplitude holds n^2 - 1 as a factor, so that nothing cancels where ior is near 1.
float fresnel_dielectric(float cos_incident, float ior) {
    float ior_squared_minus_1 = (ior - 1.0) * (ior + 1.0);
    float k = ior_squared_minus_1 + cos_incident * cos_incident;
    if (ior_squared_minus_1 == 0.0) { return 0.0; }
    if (k <= 0.0) { return 1.0; }  // total internal reflection
    float root = sqrt(k);
    float c_squared = cos_incident * cos_incident;
    float twice = 2.0 * cos_incident * root;
    float n_squared = ior * ior;
    // The squares (n^2 c + root)^2 and (c + root)^2 as sums with k, so that a grazing ray gives exactly 1.
    float parallel = ior_squared_minus_1 * (c_squared * (n_squared + 1.0) - 1.0) / (n_squared * (n_squared * c_squared + twice) + k);
    float normal = ior_squared_minus_1 / (c_squared + twice + k);
    return min(0.5 * (parallel * parallel + normal * normal), 1.0);
}

// Snell: cosine inside; 0 under total internal reflection.
float refracted_cosine(float cos_incident, float ior) {
    return sqrt(max((ior - 1.0) * (ior + 1.0) + cos_incident * cos_incident, 0.0)) / ior;
}

// Path through a thin sheet: t / max(0.001, cosine inside).
float thin_layer_thickness(float thickness, float cos_view, float ior) {
    return thickness / max(refracted_cosine(max(cos_view, 0.0), ior), MIN_THIN_LAYER_COSINE);
}
