// The bsdf of interfaces, with what some surface of the scene has. THIN_FILM, CLEAR_COAT.

#include "lib/bsdf.glsl"
#include "shade/reflectance_table.glsl"

// Reflectance of a rough interface: exact for a polished one, and as the split sum has it relative to that (Karis 2013).
float interface_reflectance(float cosine, float ior, float roughness) {
    float polished = fresnel_dielectric(cosine, ior);
    if (roughness == 0.0 || polished >= 1.0) { return polished; }
    float facing = fresnel_dielectric(1.0, ior);
    vec2 rough = reflectance_entry(cosine, roughness);
    vec2 smooth_one = reflectance_entry(cosine, 0.0);
    return min(polished * (facing * rough.x + rough.y) / max(facing * smooth_one.x + smooth_one.y, 1e-6), 1.0);
}

// Reflectance of an interface that reflects `bare` without the film on it; see filmed_reflectance.
vec3 film_over(vec3 film, float bare, float cosine, float ior, float ior_before) {
#if THIN_FILM
    return filmed_reflectance(bare, cosine, ior, film, ior_before);
#else
    return vec3(bare);
#endif
}

// Fraction of the light that a clear coat reflects. clearcoat: fraction of the interface that has it, and its roughness.
float coat_reflectance(vec2 clearcoat, float cosine) {
#if CLEAR_COAT
    return clearcoat.x * interface_reflectance(cosine, CLEARCOAT_IOR, clearcoat.y);
#else
    return 0.0;
#endif
}

// Fraction of the light from inside that leaves through an interface and its coat. passing: what its base lets pass, with its color.
vec3 leaving_fraction(vec3 passing, float cosine, float ior, float roughness, vec2 clearcoat) {
    return passing * (1.0 - interface_reflectance(cosine, ior, roughness)) * (1.0 - coat_reflectance(clearcoat, cosine));
}

// Fraction of the light that a polished clear coat reflects. clearcoat: fraction of the interface that has it.
float polished_coat_reflectance(float clearcoat, float cosine) {
#if CLEAR_COAT
    return clearcoat * fresnel_dielectric(cosine, CLEARCOAT_IOR);
#else
    return 0.0;
#endif
}
