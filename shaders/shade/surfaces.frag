// Light at the interfaces of bodies: what they reflect and refract, and the radiance of their diffuse base and of light that
// scatters many times. What the media absorb and emit on straight rays has been found; the first interval of a refracted ray is as long
// as it is bent. Row 0 of the output is the top row. ONE_INTERFACE: rays bend where they enter, and leave without bending.
// Drawn where there is an interface: shade/no_interface.frag shades the rest, and leaves the depth that separates the two.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#include "lib/two_stream.glsl"
const bool seen_checkerboard = CHECKERBOARD == 1;
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/interface_light.glsl"
#include "shade/diffused_light.glsl"
#include "shade/refraction.glsl"

// Without hierarchies nobody knows what bodies keep of lights on their path.
vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m) { return vec3(1.0); }

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D straight_optical_depth;
uniform sampler2D straight_thickness;
uniform sampler2D surface_parameters;  // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
#if !ONE_INTERFACE
uniform sampler2D left_parameters;   // object of what is left
#endif

layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

struct Crossing {
    vec3 light;
    vec3 optical_depth;  // along the refracted ray
    float thickness;     // metres inside media along it
};

// The straight ray's path and optical depth.
struct Straight {
    float thickness;
    vec3 optical_depth;
    float first_interval; // negative where it has no end
};

#if ONE_INTERFACE
// Light that bends where it enters and nowhere else. How far on the body ends changes nothing of its path, and what is
// absorbed is what the straight ray's path absorbs. A microfacet deflects it by (1 - 1 / ior) times its angle, a reflection
// by twice that angle.
Crossing refracted(Surface surface, vec3 point, vec3 normal, vec3 ray, float ior, bool enters, Straight straight) {
    vec3 passed = transmittance(straight.optical_depth);
    float blur = surface.roughness * sqrt(0.5 * abs(1.0 - 1.0 / ior));
    vec3 light = passed * radiance_beyond(point, refracted_direction(ray, normal, ior), blur);
    return Crossing(light, straight.optical_depth, straight.thickness);
}
#else
// Light that crosses the first interval along a refracted ray; the media there are taken to be mixed as along the straight one.
Crossing refracted(Surface surface, vec3 point, vec3 normal, vec3 ray, float ior, bool enters, Straight straight) {
    vec3 inside = enters ? refracted_direction(ray, normal, ior) : ray;
    Exit leaving = find_exit(point, inside, surface.longest, -inside);
    vec3 beyond = point + leaving.path * inside;
    Crossing result;
    result.thickness = max(straight.thickness + leaving.path - straight.first_interval, 0.0);
    result.optical_depth = straight.optical_depth * (result.thickness / max(straight.thickness, 1e-30));
    vec3 passed = transmittance(result.optical_depth);
    if (leaving.stopped) {
        result.light = leaving.stop * passed;
        return result;
    }
    float cosine = clamp(-dot(leaving.normal, inside), 0.0, 1.0);
    vec3 kept = film_over(surface.film, fresnel_dielectric(cosine, 1.0 / ior), cosine, 1.0 / ior, ior);
    float blur = refraction_roughness(surface.roughness, ior);
    // What the far interface keeps inside leaves after at least one more crossing, taken to be as long as this one: visible
    // where it is reflected to. Light that scatters inside leaves all the same as from a layer.
    vec3 again = surface.scatters_much ? vec3(1.0) : passed;
    result.light = kept * again * environment_light(reflected_direction(inside, leaving.normal), blur);
    vec3 outside = refracted_direction(inside, leaving.normal, 1.0 / ior);
    if (min(kept.r, min(kept.g, kept.b)) < 1.0) { result.light += (1.0 - kept) * radiance_beyond(beyond, outside, blur); }
    result.light *= passed;
    return result;
}
#endif

Crossing crossed(Surface surface, vec3 point, vec3 normal, vec3 ray, bool enters, Straight straight) {
    if (surface.thin_walled || straight.first_interval < 0.0) {
        vec3 passed = transmittance(straight.optical_depth);
        float blur = refraction_roughness(surface.roughness, surface.ior);
        return Crossing(passed * radiance_beyond(point, ray, blur), straight.optical_depth, straight.thickness);
    }
    if (surface.dispersion == 0.0) { return refracted(surface, point, normal, ray, surface.ior, enters, straight); }
    vec3 iors = channel_iors(surface.ior, surface.dispersion);
    Crossing result = refracted(surface, point, normal, ray, iors.g, enters, straight);
    result.light.r = refracted(surface, point, normal, ray, iors.r, enters, straight).light.r;
    result.light.b = refracted(surface, point, normal, ray, iors.b, enters, straight).light.b;
    return result;
}

// Lobes of the first interface. Of a thin wall they count all reflections between its two sides: what one passage absorbs is in
// the optical depth already.
Lobes first_lobes(Surface surface, float cosine, float bare, bool starts_inside) {
    vec3 front = starts_inside ? vec3(bare) : film_over(surface.film, bare, cosine, surface.ior, 1.0);
    if (!surface.thin_walled) { return smooth_lobes(front); }
    return thin_wall_entrance(front, bare, surface.wall_depth / max(refracted_cosine(cosine, surface.ior), MIN_THIN_LAYER_COSINE));
}

// Light that the interface reflects of the environment and of lights, below and in a clear coat, which takes its part of the lobes.
vec3 reflected_light(Surface surface, inout Lobes lobes, vec3 point, vec3 normal, vec3 ray, float variance) {
    vec3 direction = reflected_direction(ray, normal), light = vec3(0.0);
    float coat = coat_reflectance(surface.clearcoat, clamp(-dot(normal, ray), 0.0, 1.0));
    lobes = below_coat(lobes, coat);
    bool reflects = max(lobes.reflection.r, max(lobes.reflection.g, lobes.reflection.b)) > 0.0;
    if (reflects) { light = surface.unoccluded * lobes.reflection * environment_light(direction, surface.roughness); }
    if (coat > 0.0) { light += surface.unoccluded * coat * environment_light(direction, surface.clearcoat.y); }
    return reflects || coat > 0.0 ? light + coated_highlights(point, normal, ray, surface, variance) : light;
}

// Light that is scattered many times in the body below.
vec3 multiply_scattered(Surface surface, int object, vec3 point, vec3 normal, vec3 ray, float cosine, Crossing crossing, bool starts_inside) {
    vec3 light = vec3(0.0);
    if (surface.scatters_much) {
        light += layer_exitance(surface, point, normal, crossing.thickness, transmittance(crossing.optical_depth));
    }
    float cosine_inside = starts_inside ? 1.0 : refracted_cosine(cosine, surface.ior);
    vec3 inside = starts_inside ? ray : refracted_direction(ray, normal, surface.ior);
    light += subsurface_exitance(object, point, starts_inside ? vec3(0.0) : normal, inside, cosine_inside, crossing.thickness, crossing.optical_depth);
    if (!starts_inside) { light += ahead_from_lights(object, point + crossing.thickness * inside, normal, inside, crossing.optical_depth); }
    return light + ahead_in_scattered(object, inside, crossing.optical_depth);
}

void main() {
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 forward_ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
    float advance = length(forward_ray);
    vec3 ray = forward_ray / advance;
    vec3 emitted = texelFetch(emitted_radiance_sum, here, 0).rgb;
    vec3 through = texelFetch(straight_transmittance, here, 0).rgb;
    vec3 depth = texelFetch(straight_optical_depth, here, 0).rgb;
    float thickness = texelFetch(straight_thickness, here, 0).r;
    vec4 front = texelFetch(entered, texel, 0);
    out_transmittance = vec4(through, 1.0);

    vec4 parameters = texelFetch(surface_parameters, texel, 0);
#if ONE_INTERFACE
    const bool starts_inside = false;
#else
    vec4 back = texelFetch(left, texel, 0);
    bool starts_inside = back.w < front.w;
    if (starts_inside) { parameters = texelFetch(left_parameters, texel, 0); }
#endif
    Surface surface = surface_of(parameters);
    if (!starts_inside) {
        vec4 tint = texelFetch(surface_color, texel, 0);
        surface.color = tint.rgb;
        surface.unoccluded = tint.a;
    }

    vec3 normal = front.xyz;
    float axial_depth = starts_inside ? surface_eye_axial_depth : front.w;
    vec3 point = point_at(pixel, axial_depth);
    float cosine = clamp(-dot(normal, ray), 0.0, 1.0);
    if (starts_inside) { surface.clearcoat.x = 0.0; }
    float bare = starts_inside ? 0.0 : interface_reflectance(cosine, surface.ior, surface.roughness);
    Lobes lobes = first_lobes(surface, cosine, bare, starts_inside);
    vec3 reflected = reflected_light(surface, lobes, point, normal, ray, parameters.w);

    vec3 light = vec3(0.0);
    if (surface.transmission > 0.0) {
#if ONE_INTERFACE
        const float first_interval = 0.0; // nothing reads its length
#else
        float first_interval = back.w < NOTHING ? (end_of_interval(texel) - axial_depth) * surface_ahead.y * advance : -1.0;
#endif
        Crossing crossing = crossed(surface, point, normal, ray, !starts_inside, Straight(thickness, depth, first_interval));
        light = crossing.light + multiply_scattered(surface, int(parameters.x + 0.5), point, normal, ray, cosine, crossing, starts_inside);
        light *= surface.transmission * surface.color;
    }
    if (surface.transmission < 1.0 && !starts_inside) {
        light += (1.0 - surface.transmission) * base_radiance(surface, point, normal);
    }
    out_radiance = vec4(min(reflected + lobes.transmission * (light + emitted), vec3(NOTHING)), 1.0);
}
