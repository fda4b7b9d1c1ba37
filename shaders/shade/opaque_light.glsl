// Radiance of an opaque surface: a metal, or a dielectric over a diffuse base, or between the two (glTF 2.0, Appendix B), lit by
// the environment (split sum, Karis 2013) and by lights, as far as they reach it. Energy that a rough surface loses between its
// microfacets is regained by a factor (Turquin 2019). Needs <constants>. THIN_FILM, CLEAR_COAT: its surface may have one
// (KHR_materials_iridescence, KHR_materials_clearcoat).

#include "lib/bsdf.glsl"
#include "shade/environment_light.glsl"
#include "shade/highlight.glsl"
#include "shade/lights.glsl"
#include "shade/reflectance_table.glsl"
#include "shade/shadows.glsl"
#include "shade/ground_light.glsl"

struct OpaqueSurface {
    vec3 base;          // albedo of the diffuse base, and reflectance of metal
    float metallic;
    float roughness;
    float ior;          // of the dielectric
    vec3 passed;        // fraction of the light on the base that passes to the other side, with its color,
    float passed_share; // and without: what the base does not reflect
    vec3 emitted;
    vec3 normal;        // unit, towards the side that the mesh calls outside
    SampleFilter within; // see packed_variance.glsl
    float opacity;      // of texture and vertices
    float unoccluded;   // fraction of the light of the environment that reaches it
    bool is_hole;
    vec3 film;          // fraction of the surface that has it, its ior, and metres
    vec2 clearcoat;     // fraction of the surface that has it, and its roughness
    IrradianceMap map;
};

// Its bsdf for a direction to the eye.
struct OpaqueBsdf {
    Layer dielectric;
    Layer metal;
    Layer coat;          // of the clear coat
    float coated;        // fraction of uniform light that the clear coat reflects
    float metallic;
    vec3 base;           // albedo of the base on this side, below the dielectric
    vec3 passed;         // fraction of light on the other side
    float alpha;         // of its microfacets,
    float coat_alpha;    // and of those of the clear coat
    SampleFilter within; // see packed_variance.glsl
    float coat_weight;
};

vec3 filmed_layer(OpaqueSurface surface, vec3 facing, float cos_view) {
#if THIN_FILM
    if (surface.film.x > 0.0) { return filmed_facing(surface.film, facing, cos_view); }
#endif
    return facing;
}

Layer clearcoat_layer(vec2 clearcoat, float cos_view) {
    float step_in_ior = (CLEARCOAT_IOR - 1.0) / (CLEARCOAT_IOR + 1.0);
    return layer_of(vec3(step_in_ior * step_in_ior), reflectance_entry(cos_view, clearcoat.y));
}

OpaqueBsdf opaque_bsdf(OpaqueSurface surface, float cos_view) {
    OpaqueBsdf bsdf;
    vec2 entry = reflectance_entry(cos_view, surface.roughness);
    float ior = surface.ior;
    vec3 facing = vec3((ior - 1.0) * (ior - 1.0) / ((ior + 1.0) * (ior + 1.0)));
    bsdf.dielectric = layer_of(filmed_layer(surface, facing, cos_view), entry);
    bsdf.metal = layer_of(filmed_layer(surface, surface.base, cos_view), entry);
    bsdf.metallic = surface.metallic;
    vec3 below = (1.0 - surface.metallic) * (1.0 - bsdf.dielectric.albedo);
    bsdf.base = below * (surface.base * (1.0 - surface.passed_share));
    bsdf.passed = below * surface.passed;
    bsdf.alpha = surface.roughness * surface.roughness;
    bsdf.within = surface.within;
#if CLEAR_COAT
    bsdf.coat = clearcoat_layer(surface.clearcoat, cos_view);
    bsdf.coat_weight = surface.clearcoat.x;
    bsdf.coated = surface.clearcoat.x * bsdf.coat.albedo.r;
    bsdf.coat_alpha = surface.clearcoat.y * surface.clearcoat.y;
#else
    bsdf.coat = bsdf.dielectric;
    bsdf.coat_weight = bsdf.coated = bsdf.coat_alpha = 0.0;
#endif
    return bsdf;
}

// Evaluate it for light from the front, times the cosine of that. ray: unit, from the eye.
vec3 opaque_value(OpaqueBsdf bsdf, vec3 normal, vec3 ray, LightSample arriving, float cos_view, float cos_light) {
    float cos_facet;
    float facets = highlight_value(arriving, normal, ray, cos_view, bsdf.alpha, bsdf.within, cos_facet);
    float away = pow(1.0 - min(cos_facet, 1.0), 5.0);
    vec3 reflected = mix(layer_reflectance(bsdf.dielectric, away), layer_reflectance(bsdf.metal, away), bsdf.metallic);
    vec3 value = reflected * facets + bsdf.base * (cos_light / PI);
#if CLEAR_COAT
    facets = highlight_value(arriving, normal, ray, cos_view, bsdf.coat_alpha, bsdf.within, cos_facet);
    away = pow(1.0 - min(cos_facet, 1.0), 5.0);
    value = (1.0 - bsdf.coated) * value + bsdf.coat_weight * layer_reflectance(bsdf.coat, away) * facets;
#endif
    return value;
}

// Light of the environment; direction: of the mirror image.
vec3 opaque_environment(OpaqueSurface surface, OpaqueBsdf bsdf, vec3 normal, vec3 direction, vec3 point) {
    vec3 sum = surface.unoccluded * mix(bsdf.dielectric.albedo, bsdf.metal.albedo, bsdf.metallic) * environment_light(direction, surface.roughness);
    // One after the other in a loop: compilers then inline the shadows of the environment once.
    float last = surface.passed == vec3(0.0) ? 1.0 : -1.0;
    for (float side = 1.0; side >= last; side -= 2.0) {
        vec3 albedo = surface.unoccluded * (side > 0.0 ? bsdf.base : bsdf.passed);
        sum += albedo * surrounding_irradiance(surface.map, point, side * normal) / PI;
    }
#if CLEAR_COAT
    sum = (1.0 - bsdf.coated) * sum + surface.unoccluded * bsdf.coated * environment_light(direction, surface.clearcoat.y);
#endif
    return sum;
}

// ray: unit, from the eye; normal: to the eye's side; point: from the center of the media.
vec3 opaque_radiance_of(OpaqueSurface surface, vec3 normal, vec3 ray, vec3 point) {
    float cos_view = clamp(-dot(normal, ray), 1e-3, 1.0);
    OpaqueBsdf bsdf = opaque_bsdf(surface, cos_view);
    vec3 sum = opaque_environment(surface, bsdf, normal, reflected_direction(ray, normal), point);
    if (surface.map.lit > 0.0) { bsdf.base = bsdf.passed = vec3(0.0); }  // lights are left to mirror
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        float cos_light = dot(normal, arriving.towards);
        vec3 irradiance = arriving.irradiance;
        if (cos_light > 0.0 || surface.passed_share > 0.0) { irradiance *= light_reaching(light, point, normal); }
        if (cos_light > 0.0) {
            sum += opaque_value(bsdf, normal, ray, arriving, cos_view, cos_light) * irradiance;
        } else {
            sum -= (1.0 - bsdf.coated) * bsdf.passed / PI * cos_light * irradiance;
        }
    }
    return sum + (1.0 - bsdf.coated) * surface.emitted;
}
