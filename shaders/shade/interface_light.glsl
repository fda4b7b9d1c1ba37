// Light that interfaces of bodies reflect from lights, and the radiance of their diffuse base and of layers that scatter many
// times. Needs <constants>, <View>, <Surfaces>, <ObjectRow> and environment_light.glsl. SINGLE_SCATTERING: light of lights that
// is scattered once is found elsewhere. Who includes it has light_passed, as in transport/light_passed.glsl.

#include "lib/two_stream.glsl"
#include "shade/highlight.glsl"
#include "shade/in_picture.glsl"
#include "shade/interface_bsdf.glsl"
#include "shade/lights.glsl"
#include "shade/shadows.glsl"

// What the surface of a body is like at a point, and the layer below it.
struct Surface {
    float ior;
    float dispersion;
    bool thin_walled;
    bool scatters_much;   // what is scattered more than once leaves as from a layer
    vec3 wall_depth;      // optical depth straight through a thin wall
    vec3 passed;          // fraction of the light on the base that passes to the other side, with its color,
    float passed_share;   // and without
    vec3 stream_absorption;
    vec3 stream_scattering;
    float inner_mirror;   // fraction of diffuse light from inside that the interface reflects
    float longest;        // metres across the body
    float roughness;
    float transmission;
    vec3 color;
    float unoccluded;     // fraction of the light of the environment that reaches it
    vec3 film;            // fraction of the interface that has it, its ior, and metres
    vec2 clearcoat;       // fraction of the interface that has it, and its roughness
};

// parameters: object, roughness, transmission.
Surface surface_of(vec4 parameters) {
    ObjectRow row = object_table_row(int(parameters.x + 0.5));
    return Surface(row.ior, row.dispersion, int(row.type) == TYPE_THIN_WALL, row.scatters_much > 0.5, row.extinction, row.passed,
        row.passed_share, row.stream_absorption, row.stream_scattering, row.inner_mirror, row.longest, parameters.y, parameters.z,
        vec3(1.0), 1.0, row.film, vec2(row.clearcoat, row.clearcoat_roughness));
}

// Fraction of the light that microfacets reflect, those of a thin wall at both of its sides.
vec3 reflected_by_facets(Surface surface, float cosine) {
    float bare = fresnel_dielectric(cosine, surface.ior);
    vec3 filmed = film_over(surface.film, bare, cosine, surface.ior, 1.0);
    return vec3(surface.thin_walled ? 2.0 * bare : bare) + (filmed - bare);
}

// An interface that tilts microfacets by small angles deflects reflections by twice these, and refracted light by (ior - 1)
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

// Microfacets that reflect the lights, as far as these reach them.
vec3 highlights(vec3 point, vec3 normal, vec3 ray, Surface surface, float alpha, SampleFilter within) {
    vec3 sum = vec3(0.0);
    float cos_view = max(-dot(normal, ray), 1e-3);
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        if (dot(normal, arriving.towards) <= 0.0) { continue; }
        float cos_facet;
        float value = highlight_value(arriving, normal, ray, cos_view, alpha, within, cos_facet);
        vec3 reflected = value * reflected_by_facets(surface, cos_facet);
        if (max(reflected.r, max(reflected.g, reflected.b)) > FAINTEST_HIGHLIGHT) { sum += reflected * irradiance_reaching(light, arriving, point, normal); }
    }
    return sum;
}

// Filter of a sample that shows a point. stored: variance of the normals within it.
SampleFilter sample_filter(vec3 point, float stored) {
    vec3 from_eye = point + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    float width = filter_width() * pixel_metres(metres_ahead_of(point) + surface_ahead.z);
    return SampleFilter(unpacked_variance(stored), width, surface_right.w == 1.0 ? width / length(from_eye) : 0.0);
}

// The same with its clear coat. stored: variance of the normals within the pixel.
vec3 coated_highlights(vec3 point, vec3 normal, vec3 ray, Surface surface, float stored) {
    SampleFilter within = sample_filter(point, stored);
    vec3 sum = highlights(point, normal, ray, surface, surface.roughness * surface.roughness, within);
#if CLEAR_COAT
    if (surface.clearcoat.x == 0.0) { return sum; }
    Surface coat = surface;
    coat.ior = CLEARCOAT_IOR;
    coat.thin_walled = false;
    coat.film = vec3(0.0, 1.0, 0.0);
    sum *= 1.0 - coat_reflectance(surface.clearcoat, clamp(-dot(normal, ray), 0.0, 1.0));
    sum += surface.clearcoat.x * highlights(point, normal, ray, coat, surface.clearcoat.y * surface.clearcoat.y, within);
#endif
    return sum;
}

// On both sides of an interface, as far as lights reach them. unoccluded: fraction of the environment's light.
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

// Radiance of diffuse light out of the body: as a layer reflects it, and lets it through from behind. What passes without an
// event is visible as it is, and left out here.
vec3 layer_exitance(Surface surface, vec3 point, vec3 normal, float thickness, vec3 passed) {
    vec3 absorbed = surface.stream_absorption * thickness;
    vec3 turned = surface.stream_scattering * thickness;
    float mirror = surface.inner_mirror;
    vec3 bare_through = two_stream_transmittance(absorbed, turned);
    vec3 bare_back = two_stream_reflectance(absorbed, turned);
    vec3 all_through = mirrored_transmittance(bare_back, bare_through, mirror);
    vec3 all_back = mirrored_reflectance(bare_back, bare_through, mirror);
    // Of what enters behind or is mirrored there, the rays see what passes without an event.
    vec3 unscattered = min(passed, bare_through);
    vec3 through = max(all_through - unscattered * (1.0 - mirror + mirror * all_back), vec3(0.0));
    vec3 back = max(all_back - unscattered * mirror * all_through, vec3(0.0));
    vec3 sum = environment_irradiance(normal) * back + environment_irradiance(-normal) * through;
#if SINGLE_SCATTERING
    // Light of lights that is scattered once is in the emitted radiance.
    back = max(back - (1.0 - mirror) * (bare_back - multiple_reflectance(absorbed, turned)), vec3(0.0));
#endif
    TwoSides lights = irradiance_on(point, normal, 0.0);
    return (sum + lights.front * back + lights.back * through) / PI;
}

// Radiance of the diffuse base.
vec3 base_radiance(Surface surface, vec3 point, vec3 normal) {
    TwoSides light = irradiance_on(point, normal, surface.unoccluded);
    return diffuse_radiance(light.front, light.back, surface.color, surface.passed, surface.passed_share);
}
