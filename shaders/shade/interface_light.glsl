// Light that interfaces of bodies reflect, and give back from paint and from many scattering events. Needs <constants>,
// <View>, <Surfaces>, <SurfaceRow> and environment_light.glsl. SINGLE_SCATTERING: light of lights that is
// scattered once is found elsewhere. THIN_FILM, CLEAR_COAT: some body has one. Who includes it has light_passed, as in transport/light_passed.glsl.

#include "lib/interface.glsl"
#include "lib/optics.glsl"
#if THIN_FILM
#include "lib/thin_film.glsl"
#endif
#include "lib/two_stream.glsl"
#include "shade/highlight.glsl"
#include "shade/lights.glsl"
#include "shade/shadows.glsl"

uniform sampler2D reflectance_table; // scale and bias of the reflectance at normal incidence

struct Finish {
    float ior;
    float dispersion;
    bool is_sheet;
    bool scatters_much;   // gives back what it scatters more than once, as a layer
    vec3 sheet_depth;     // optical depth straight through a sheet
    vec3 painted_through; // share of light on the paint that passes to the other side, with its color,
    float painted_share;  // and without
    vec3 stream_absorption;
    vec3 stream_scattering;
    float inner_mirror;   // share of diffuse light from inside that the interface mirrors
    float longest;        // metres across the body
    float roughness;
    float transmission;
    vec3 color;
    float unoccluded;     // share of the light of the environment that reaches it
#if THIN_FILM
    vec3 film;            // share of the interface that has it, its ior, and metres
#endif
#if CLEAR_COAT
    vec2 clearcoat;       // share of the interface that has it, and its roughness
#endif
};

// surface: object, roughness, transmission.
Finish finish_of(vec4 surface) {
    SurfaceRow row = surface_table_row(int(surface.x + 0.5));
    return Finish(row.ior, row.dispersion, row.is_sheet > 0.5, row.scatters_much > 0.5, row.sheet_depth, row.painted_through,
        row.painted_share, row.stream_absorption, row.stream_scattering, row.inner_mirror, row.longest, surface.y, surface.z, vec3(1.0), 1.0
#if THIN_FILM
        , row.film
#endif
#if CLEAR_COAT
        , vec2(row.clearcoat, row.clearcoat_roughness)
#endif
    );
}

// Reflectance of a rough interface: exact for a polished one, and as the split sum has it relative to that (Karis 2013).
float interface_reflectance(float cosine, float ior, float roughness) {
    float polished = fresnel_dielectric(cosine, ior);
    if (roughness == 0.0 || polished >= 1.0) { return polished; }
    float facing = fresnel_dielectric(1.0, ior);
    vec2 rough = texture(reflectance_table, reflectance_coordinate(cosine, roughness)).rg;
    vec2 smooth_one = texture(reflectance_table, reflectance_coordinate(cosine, 0.0)).rg;
    return min(polished * (facing * rough.x + rough.y) / max(facing * smooth_one.x + smooth_one.y, 1e-6), 1.0);
}

#if THIN_FILM
// Reflectance of an interface that reflects `bare` without the film on it. before: index of the side that the ray comes from.
vec3 filmed_reflectance(vec3 film, float bare, float cosine, float ior, float before) {
    if (film.x == 0.0) { return vec3(bare); }
    return mix(vec3(bare), thin_film_reflectance(cosine, ior, film.y / before, film.y * film.z), film.x);
}
#endif

// Share of light that microfacets mirror, those of a sheet at both of its sides.
vec3 mirrored_by_facets(Finish finish, float cosine) {
    float bare = fresnel_dielectric(cosine, finish.ior);
    vec3 share = vec3(finish.is_sheet ? 2.0 * bare : bare);
#if THIN_FILM
    share += filmed_reflectance(finish.film, bare, cosine, finish.ior, 1.0) - bare;
#endif
    return share;
}

// An interface that turns microfacets by small angles turns reflections by twice these, and refracted light by (ior - 1)
// times them at each of two interfaces.
float refraction_roughness(float roughness, float ior) {
    return roughness * sqrt(min(abs(ior - 1.0) * 0.70710678, 1.0));
}

vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m);

// Irradiance of a light on an interface that faces it, as far as nothing opaque blocks it, and bodies let it pass.
vec3 irradiance_reaching(int light, LightSample arriving, vec3 point, vec3 normal) {
    float unblocked = light_unblocked(light, point, normal);
    if (unblocked == 0.0) { return vec3(0.0); }
    return unblocked * light_passed(point, normal, arriving.towards, arriving.distance_m) * arriving.irradiance;
}

// Microfacets that mirror the lights, as far as these reach them.
vec3 highlights(vec3 point, vec3 normal, vec3 ray, Finish finish, float alpha) {
    vec3 sum = vec3(0.0);
    float cos_view = max(-dot(normal, ray), 1e-3);
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        float cos_light = dot(normal, arriving.towards);
        if (cos_light <= 0.0) { continue; }
        vec3 half_way = normalize(arriving.towards - ray);
        vec3 mirrored = mirrored_by_facets(finish, max(dot(half_way, arriving.towards), 0.0))
            * ggx_distribution(min(dot(half_way, normal), 1.0), alpha) * ggx_visibility(cos_light, cos_view, alpha);
        mirrored *= cos_light;
        if (max(mirrored.r, max(mirrored.g, mirrored.b)) > FAINTEST_HIGHLIGHT) { sum += mirrored * irradiance_reaching(light, arriving, point, normal); }
    }
    return sum;
}

#if CLEAR_COAT
// Share of light that a clear coat mirrors, and the highlights of lights in it.
float coated_share(vec2 clearcoat, float cosine) {
    return clearcoat.x * interface_reflectance(cosine, CLEARCOAT_IOR, clearcoat.y);
}

vec3 coat_highlights(vec3 point, vec3 normal, vec3 ray, Finish finish, float variance) {
    Finish coat = finish;
    coat.ior = CLEARCOAT_IOR;
    coat.is_sheet = false;
#if THIN_FILM
    coat.film = vec3(0.0, 1.0, 0.0);
#endif
    return finish.clearcoat.x * highlights(point, normal, ray, coat, highlight_alpha(finish.clearcoat.y, variance));
}
#endif

// On both sides of an interface, as far as lights reach them. unoccluded: share of the environment's light.
struct TwoSides {
    vec3 front;
    vec3 back;
};

TwoSides irradiance_on(vec3 point, vec3 normal, float unoccluded) {
    TwoSides sum = TwoSides(unoccluded * environment_irradiance(normal), unoccluded * environment_irradiance(-normal));
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        float facing = dot(normal, arriving.towards);
        if (facing == 0.0 || arriving.irradiance == vec3(0.0)) { continue; }
        vec3 irradiance = abs(facing) * irradiance_reaching(light, arriving, point, facing > 0.0 ? normal : -normal);
        sum.front += facing > 0.0 ? irradiance : vec3(0.0);
        sum.back += facing > 0.0 ? vec3(0.0) : irradiance;
    }
    return sum;
}

// Diffuse light out of the body: as a layer gives it back, and lets it through from behind. What passes without an event
// is seen as it is, and left out here.
vec3 scattered_out(Finish finish, vec3 point, vec3 normal, float thickness, vec3 passed) {
    vec3 absorbed = finish.stream_absorption * thickness;
    vec3 turned = finish.stream_scattering * thickness;
    float mirror = finish.inner_mirror;
    vec3 bare_through = two_stream_transmittance(absorbed, turned);
    vec3 bare_back = two_stream_reflectance(absorbed, turned);
    vec3 all_through = mirrored_transmittance(bare_back, bare_through, mirror);
    vec3 all_back = mirrored_reflectance(bare_back, bare_through, mirror);
    // Of what enters behind or is mirrored there, the rays see what passes without an event.
    vec3 seen = min(passed, bare_through);
    vec3 through = max(all_through - seen * (1.0 - mirror + mirror * all_back), vec3(0.0));
    vec3 back = max(all_back - seen * mirror * all_through, vec3(0.0));
    vec3 sum = environment_irradiance(normal) * back + environment_irradiance(-normal) * through;
#if SINGLE_SCATTERING
    // Light of lights that is scattered once is in the emitted radiance.
    back = max(back - (1.0 - mirror) * (bare_back - multiple_reflectance(absorbed, turned)), vec3(0.0));
#endif
    TwoSides lights = irradiance_on(point, normal, 0.0);
    return (sum + lights.front * back + lights.back * through) / PI;
}

vec3 paint(Finish finish, vec3 point, vec3 normal) {
    TwoSides light = irradiance_on(point, normal, finish.unoccluded);
    return (finish.color * (1.0 - finish.painted_share) * light.front + finish.painted_through * light.back) / PI;
}
