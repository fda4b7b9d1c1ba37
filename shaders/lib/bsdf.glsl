// What the interfaces of dielectrics do to light: smooth and rough ones, thin walls, thin films, clear coats, and a diffuse base.
// Pure. Reflectances and transmittances are fractions of the light at an interface, by channel; a cosine is that of the direction
// which the light comes from; ior is that of the other side relative to this one. Directions are unit vectors of travel, normals
// look to the side that light comes from. Each function of numbers is the float32 twin of the same name in
// translucent/formulas/bsdf.py. Walter et al. 2007; Heitz 2014 and 2018; Belcour & Barla 2017; glTF 2.0, Appendix B; Turquin 2019.

#include <constants>
#include "lib/interface.glsl"
#include "lib/optics.glsl"
#include "lib/thin_film.glsl"

// The two lobes of an interface: fractions of the light that it sends back, and that go on.
struct Lobes {
    vec3 reflection;
    vec3 transmission;
};

// Reflectance of an interface that reflects `bare` without the film on it. film: fraction of the interface that has it, its index
// of refraction, and metres; ior_before: index of the side that light comes from.
vec3 filmed_reflectance(float bare, float cosine, float ior, vec3 film, float ior_before) {
    if (film.x == 0.0) { return vec3(bare); }
    return mix(vec3(bare), thin_film_reflectance(cosine, ior, film.y / ior_before, film.y * film.z), film.x);
}

Lobes smooth_lobes(vec3 reflectance) {
    return Lobes(reflectance, 1.0 - reflectance);
}

// Both sides of a thin wall at once. front: reflectance of the side towards the light, back: of the other; optical_depth: of one
// passage.
Lobes thin_wall_lobes(vec3 front, float back, vec3 optical_depth) {
    return Lobes(film_slab_reflectance(front, back, optical_depth), film_slab_transmittance(front, back, optical_depth));
}

// The same without what the passage to the other side absorbs, where that is counted elsewhere.
Lobes thin_wall_entrance(vec3 front, float back, vec3 optical_depth) {
    vec3 kept = (1.0 - front) + front * ((1.0 - back) + back * opacity(2.0 * optical_depth));
    return Lobes(film_slab_reflectance(front, back, optical_depth), (1.0 - front) * (1.0 - back) / max(kept, vec3(1e-30)));
}

// Fraction of what a thin wall emits that leaves through its front, as it goes back and forth in it, too.
vec3 thin_wall_exitance(vec3 front, float back, vec3 optical_depth) {
    vec3 kept = (1.0 - front) + front * ((1.0 - back) + back * opacity(2.0 * optical_depth));
    return (1.0 - front) / max(kept, vec3(1e-30)) * (1.0 + back * transmittance(optical_depth));
}

// What a clear coat that reflects a fraction of the light leaves for the interface below, without its own reflection.
Lobes below_coat(Lobes lobes, float coat) {
    return Lobes((1.0 - coat) * lobes.reflection, (1.0 - coat) * lobes.transmission);
}

// A microfacet of a rough interface as light sees it, for two random numbers. alpha: squared roughness.
vec3 microfacet_normal(vec3 normal, vec3 direction, float alpha, vec2 shares) {
    vec3 aside = normalize(abs(normal.x) < 0.7 ? cross(normal, vec3(1.0, 0.0, 0.0)) : cross(normal, vec3(0.0, 1.0, 0.0)));
    vec3 up = cross(normal, aside);
    vec3 towards = -vec3(dot(direction, aside), dot(direction, up), dot(direction, normal));
    vec3 local = ggx_visible_normal(towards, alpha, shares);
    return local.x * aside + local.y * up + local.z * normal;
}

// Fraction of the light on a microfacet that leaves the surface: G2 / G1 of Smith's masking, heights correlated.
float masking_ratio(float cos_in, float cos_out, float alpha) {
    if (cos_out <= 0.0) { return 0.0; }
    float into = smith_lambda(cos_in, alpha);
    return (1.0 + into) / (1.0 + into + smith_lambda(cos_out, alpha));
}

// A direction that a smooth normal moves to the wrong side of a face, mirrored to the right one.
vec3 kept_on_side(vec3 direction, vec3 side) {
    return direction - 2.0 * min(dot(direction, side), 0.0) * side;
}

// Radiance of a diffuse base, for the irradiance on its front and on its back. passed: fraction of the light that passes to the
// other side, with its color; passed_share: without.
vec3 diffuse_radiance(vec3 front, vec3 back, vec3 color, vec3 passed, float passed_share) {
    return (color * (1.0 - passed_share) * front + passed * back) / PI;
}

// Microfacets over something else, by Schlick's approximation.
struct Layer {
    vec3 facing;    // reflectance face-on, and
    vec3 grazing;   // edge-on
    vec3 regained;  // what is lost between microfacets, as a factor
    vec3 albedo;    // fraction of uniform light that it reflects
};

// entry: scale and bias of the reflectance at normal incidence (split sum, Karis 2013).
Layer layer_of(vec3 facing, vec2 entry) {
    // Only what hardly has a step in ior reflects less than 2 % face-on: that fades at grazing angles, too.
    vec3 grazing = min(50.0 * facing, vec3(1.0));
    vec3 regained = 1.0 + facing * (1.0 / max(entry.x + entry.y, 1e-3) - 1.0);
    return Layer(facing, grazing, regained, (facing * entry.x + grazing * entry.y) * regained);
}

// Reflectance of its microfacets. away: (1 - cosine)^5 of the angle at these.
vec3 layer_reflectance(Layer layer, float away) {
    return (layer.facing + (layer.grazing - layer.facing) * away) * layer.regained;
}

// Reflectance face-on of what reflects as much at this angle as an interface of ior, by channel, under a film (Schlick 1994).
vec3 filmed_facing(vec3 film, vec3 facing, float cos_view) {
    vec3 root = sqrt(min(facing, vec3(0.9999)));
    vec3 ior = (1.0 + root) / (1.0 - root);
    vec3 reflected = vec3(thin_film_reflectance(cos_view, ior.r, film.y, film.y * film.z).r,
        thin_film_reflectance(cos_view, ior.g, film.y, film.y * film.z).g, thin_film_reflectance(cos_view, ior.b, film.y, film.y * film.z).b);
    float away = min(pow(1.0 - cos_view, 5.0), 0.99);
    return mix(facing, clamp((reflected - away) / (1.0 - away), 0.0, 1.0), film.x);
}

// Density of microfacets that reflect one direction into the other, times what of them is not masked: a bsdf is this times
// their reflectance.
float microfacet_value(float cos_half, float cos_light, float cos_view, float alpha) {
    return ggx_distribution(min(cos_half, 1.0), alpha) * ggx_visibility(cos_light, cos_view, alpha);
}
