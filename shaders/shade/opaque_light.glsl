// What an opaque surface sends to the eye: a metal, or a coat over paint, or between the two (glTF 2.0, Appendix B), lit by the
// environment (split sum, Karis 2013) and by lights, as far as they reach it. Energy that a rough surface loses between its
// microfacets is given back by a factor (Turquin 2019). Needs <constants> and a texture `reflectance_table`.
// THIN_FILM, CLEAR_COAT: its surface may have one (KHR_materials_iridescence, KHR_materials_clearcoat).

#include "lib/interface.glsl"
#if THIN_FILM
#include "lib/thin_film.glsl"
#endif
#include "shade/environment_light.glsl"
#include "shade/highlight.glsl"
#include "shade/lights.glsl"
#include "shade/shadows.glsl"

struct OpaqueFinish {
    vec3 base;          // albedo of paint, and reflectance of metal
    float metallic;
    float roughness;
    float ior;          // of the coat
    vec3 passed;        // share of light on the paint that passes to the other side, with its color,
    float passed_share; // and without: what paint does not reflect
    vec3 emitted;
    vec3 normal;        // unit, towards the side that the mesh calls outside
    float variance;     // of normals within a pixel
    float opacity;      // of texture and vertices
    float unoccluded;   // share of the light of the environment that reaches it
    bool is_hole;
#if THIN_FILM
    vec3 film;          // share of the surface that has it, its ior, and metres
#endif
#if CLEAR_COAT
    vec2 clearcoat;     // share of the surface that has it, and its roughness
#endif
};

// What the microfacets of one of the two layers mirror, relative to those without any loss.
struct Layer {
    vec3 facing;    // reflectance face-on, and
    vec3 grazing;   // edge-on (Schlick 1994)
    vec3 regained;  // what is lost between microfacets, as a factor
    vec3 mirrored;  // share of uniform light
};

Layer layer_of(vec3 facing, vec2 table) {
    // Only what hardly has a step in ior reflects less than 2 % face-on: that fades at grazing angles, too.
    vec3 grazing = min(50.0 * facing, vec3(1.0));
    vec3 regained = 1.0 + facing * (1.0 / max(table.x + table.y, 1e-3) - 1.0);
    return Layer(facing, grazing, regained, (facing * table.x + grazing * table.y) * regained);
}

vec3 fresnel_of(Layer layer, float away) {
    return (layer.facing + (layer.grazing - layer.facing) * away) * layer.regained;
}

#if THIN_FILM
// Reflectance face-on of what mirrors as much at this angle as an interface of ior, by channel, under a film (Schlick 1994).
vec3 filmed_facing(vec3 film, vec3 facing, float cos_view) {
    vec3 root = sqrt(min(facing, vec3(0.9999)));
    vec3 ior = (1.0 + root) / (1.0 - root);
    vec3 mirrored = vec3(thin_film_reflectance(cos_view, ior.r, film.y, film.y * film.z).r,
        thin_film_reflectance(cos_view, ior.g, film.y, film.y * film.z).g, thin_film_reflectance(cos_view, ior.b, film.y, film.y * film.z).b);
    float away = min(pow(1.0 - cos_view, 5.0), 0.99);
    return mix(facing, clamp((mirrored - away) / (1.0 - away), 0.0, 1.0), film.x);
}
#endif

#if CLEAR_COAT
// A clear coat, as what it mirrors.
Layer clearcoat_layer(vec2 clearcoat, float cos_view) {
    float step_in_ior = (CLEARCOAT_IOR - 1.0) / (CLEARCOAT_IOR + 1.0);
    vec2 table = textureLod(reflectance_table, reflectance_coordinate(cos_view, clearcoat.y), 0.0).rg;
    return layer_of(vec3(step_in_ior * step_in_ior), table);
}
#endif

// ray: unit, from the eye; normal: to the eye's side; point: from the center of the media.
vec3 opaque_radiance_of(OpaqueFinish finish, vec3 normal, vec3 ray, vec3 point) {
    float ior = finish.ior;
    float cos_view = clamp(-dot(normal, ray), 1e-3, 1.0);
    vec2 table = textureLod(reflectance_table, reflectance_coordinate(cos_view, finish.roughness), 0.0).rg;
    vec3 facing = vec3((ior - 1.0) * (ior - 1.0) / ((ior + 1.0) * (ior + 1.0))), facing_metal = finish.base;
#if THIN_FILM
    if (finish.film.x > 0.0) {
        facing = filmed_facing(finish.film, facing, cos_view);
        facing_metal = filmed_facing(finish.film, facing_metal, cos_view);
    }
#endif
    Layer coat = layer_of(facing, table);
    Layer metal = layer_of(facing_metal, table);
    vec3 painted = (1.0 - finish.metallic) * (1.0 - coat.mirrored);
    vec3 paint = finish.base * (1.0 - finish.passed_share);

    vec3 sum = finish.unoccluded * mix(coat.mirrored, metal.mirrored, finish.metallic)
        * environment_light(reflected_direction(ray, normal), finish.roughness);
    // One after the other in a loop: compilers then inline the shadows of the environment once.
    float last = finish.passed == vec3(0.0) ? 1.0 : -1.0;
    for (float side = 1.0; side >= last; side -= 2.0) {
        vec3 turned = finish.unoccluded * painted * (side > 0.0 ? paint : finish.passed);
        sum += turned * environment_irradiance(side * normal) * environment_reaching(point, side * normal) / PI;
    }
#if CLEAR_COAT
    Layer lacquer = clearcoat_layer(finish.clearcoat, cos_view);
    float coated = finish.clearcoat.x * lacquer.mirrored.r;
    float lacquer_alpha = highlight_alpha(finish.clearcoat.y, finish.variance);
    sum = (1.0 - coated) * sum + finish.unoccluded * coated * environment_light(reflected_direction(ray, normal), finish.clearcoat.y);
#endif
    float alpha = highlight_alpha(finish.roughness, finish.variance);
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        vec3 towards = arriving.towards, irradiance = arriving.irradiance;
        float cos_light = dot(normal, towards);
        if (cos_light > 0.0 || finish.passed_share > 0.0) { irradiance *= light_reaching(light, point, normal); }
        if (cos_light <= 0.0) {
#if CLEAR_COAT
            irradiance *= 1.0 - coated;
#endif
            sum -= painted * finish.passed / PI * cos_light * irradiance;
            continue;
        }
        vec3 half_way = normalize(towards - ray);
        float away = pow(1.0 - clamp(dot(half_way, towards), 0.0, 1.0), 5.0);
        vec3 glint = mix(fresnel_of(coat, away), fresnel_of(metal, away), finish.metallic)
            * ggx_distribution(min(dot(half_way, normal), 1.0), alpha) * ggx_visibility(cos_light, cos_view, alpha);
        vec3 turned = glint + painted * paint / PI;
#if CLEAR_COAT
        turned = (1.0 - coated) * turned + finish.clearcoat.x * fresnel_of(lacquer, away)
            * ggx_distribution(min(dot(half_way, normal), 1.0), lacquer_alpha) * ggx_visibility(cos_light, cos_view, lacquer_alpha);
#endif
        sum += turned * cos_light * irradiance;
    }
#if CLEAR_COAT
    return sum + (1.0 - coated) * finish.emitted;
#else
    return sum + finish.emitted;
#endif
}
