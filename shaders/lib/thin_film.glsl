// Light at an interface under a thin film, whose two sides interfere: soap bubbles, oxides. Pure: needs only <constants> and the library.
// Each function is the float32 twin of the same name in translucent/formulas/thin_film.py, which explains the numbers. Linear Rec.709.
// Belcour & Barla 2017; KHR_materials_iridescence; Airy 1833. iors are relative to the side that the ray comes from.

#include <constants>
#include "lib/optics.glsl"

// Mean of cos(2 pi path / wavelength) over what each channel sees; optical_path in metres.
vec3 film_interference(float optical_path) {
    float phase = 2.0 * PI * optical_path;
    vec3 waves = cos(FILM_CENTERS * phase) * exp(-FILM_WIDTHS * phase * phase);
    float blue = cos(FILM_BLUE_CENTER * phase) * exp(-FILM_BLUE_WIDTH * phase * phase);
    waves.x = mix(waves.x, blue, FILM_BLUE_SHARE);
    return FILM_TO_RGB * waves;
}

// Reflectance of a smooth interface under a film; optical_thickness: index of the film (not relative) times metres.
vec3 thin_film_reflectance(float cos_incident, float ior, float film_ior, float optical_thickness) {
    float in_film = ((film_ior - 1.0) * (film_ior + 1.0) + cos_incident * cos_incident) / (film_ior * film_ior);
    float beyond = ((ior - 1.0) * (ior + 1.0) + cos_incident * cos_incident) / (ior * ior);
    if (min(min(in_film, beyond), cos_incident) <= 0.0) { return vec3(1.0); }
    in_film = sqrt(in_film);
    beyond = sqrt(beyond);
    float path = 2.0 * optical_thickness * in_film;
    // x: perpendicular to the plane of incidence, y: in it.
    vec2 first = vec2(1.0, film_ior) * cos_incident, film = vec2(film_ior, 1.0) * in_film, last = vec2(ior, film_ior / ior) * beyond;
    vec2 near_sum = first + film, far_sum = film + last;
    vec2 both = (film - first) / near_sum * ((film - last) / far_sum);
    vec2 passed = 4.0 * first * film / (near_sum * near_sum) * (4.0 * film * last / (far_sum * far_sum));
    vec3 wave = film_interference(path);
    vec3 cosine = clamp(wave, -1.0, 1.0);
    vec3 together = passed.x / (1.0 - 2.0 * both.x * cosine + both.x * both.x) + passed.y / (1.0 - 2.0 * both.y * cosine + both.y * both.y);
    vec2 each = passed / ((1.0 - both) * (1.0 + both));
    vec3 colored = vec3(each.x + each.y);
    for (int order = 1; order <= FILM_ORDERS; ++order) {
        if (order > 1) { wave = film_interference(float(order) * path); }
        each *= both;
        colored += 2.0 * (each.x + each.y) * wave;
    }
    vec3 through = 0.5 * mix(together, colored, smoothstep(FILM_SHORT, FILM_LONG, path));
    return 1.0 - clamp(through, 0.0, 1.0);
}

// Thin wall with a film on one side: front is the reflectance of that side, back of the other; optical_depth of one passage.
vec3 film_slab_transmittance(vec3 front, float back, vec3 optical_depth) {
    vec3 kept = (1.0 - front) + front * ((1.0 - back) + back * opacity(2.0 * optical_depth));
    vec3 within = (1.0 - front) / max(kept, vec3(1e-30));
    return within * (1.0 - back) * transmittance(optical_depth);
}

// From the side of the film.
vec3 film_slab_reflectance(vec3 front, float back, vec3 optical_depth) {
    vec3 kept = (1.0 - front) + front * ((1.0 - back) + back * opacity(2.0 * optical_depth));
    vec3 within = (1.0 - front) / max(kept, vec3(1e-30));
    vec3 passage = transmittance(optical_depth);
    return front + (1.0 - front) * back * within * passage * passage;
}
