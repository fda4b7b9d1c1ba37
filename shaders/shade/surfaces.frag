// Light at the interfaces of bodies: what they reflect, what enters and bends, and what paint and many scattering events
// give back. What the media absorb and emit on straight rays has been found; the first interval of a refracted ray is as long
// as it is bent. Row 0 of the output is the top row. ONE_INTERFACE: rays bend where they enter, and leave without bending.
// Drawn where there is an interface: shade/no_interface.frag shades the rest, and leaves the depth that tells the two apart.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <SurfaceRow>
#include "lib/interface.glsl"
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#include "lib/two_stream.glsl"
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/interface_light.glsl"
#include "shade/diffused_light.glsl"
#include "shade/refraction.glsl"

// Without hierarchies nobody knows what bodies keep of lights on their way.
vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m) { return vec3(1.0); }

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D straight_optical_depth;
uniform sampler2D straight_thickness;
uniform sampler2D surface_finish;    // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
#if !ONE_INTERFACE
uniform sampler2D left_finish;       // object of what is left
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
// Light that bends where it enters and nowhere else. How far on the body ends changes nothing of its way, and what is
// absorbed is what the straight ray's path absorbs. A microfacet turns it by (1 - 1 / ior) times its angle, a reflection
// by twice that angle.
Crossing refracted(Finish finish, vec3 point, vec3 normal, vec3 ray, float ior, bool enters, Straight straight) {
    vec3 passed = transmittance(straight.optical_depth);
    float blur = finish.roughness * sqrt(0.5 * abs(1.0 - 1.0 / ior));
    vec3 light = passed * radiance_beyond(point, refracted_direction(ray, normal, ior), blur);
    return Crossing(light, straight.optical_depth, straight.thickness);
}
#else
// Light that crosses the first interval along a refracted ray; the media there are taken to be mixed as along the straight one.
Crossing refracted(Finish finish, vec3 point, vec3 normal, vec3 ray, float ior, bool enters, Straight straight) {
    vec3 inside = enters ? refracted_direction(ray, normal, ior) : ray;
    Exit leaving = find_exit(point, inside, finish.longest, -inside);
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
    vec3 kept = vec3(interface_reflectance(cosine, 1.0 / ior, 0.0));
#if THIN_FILM
    kept = filmed_reflectance(finish.film, kept.r, cosine, 1.0 / ior, ior);
#endif
    float blur = refraction_roughness(finish.roughness, ior);
    // What the far interface keeps inside leaves after at least one more crossing, taken to be as long as this one: seen
    // where it is mirrored to. Light that scatters on the way comes out all the same where media give it back.
    vec3 again = finish.scatters_much ? vec3(1.0) : passed;
    result.light = kept * again * environment_light(reflected_direction(inside, leaving.normal), blur);
    vec3 outside = refracted_direction(inside, leaving.normal, 1.0 / ior);
    if (min(kept.r, min(kept.g, kept.b)) < 1.0) { result.light += (1.0 - kept) * radiance_beyond(beyond, outside, blur); }
    result.light *= passed;
    return result;
}
#endif

Crossing crossed(Finish finish, vec3 point, vec3 normal, vec3 ray, bool enters, Straight straight) {
    if (finish.is_sheet || straight.first_interval < 0.0) {
        vec3 passed = transmittance(straight.optical_depth);
        float blur = refraction_roughness(finish.roughness, finish.ior);
        return Crossing(passed * radiance_beyond(point, ray, blur), straight.optical_depth, straight.thickness);
    }
    if (finish.dispersion == 0.0) { return refracted(finish, point, normal, ray, finish.ior, enters, straight); }
    vec3 iors = channel_iors(finish.ior, finish.dispersion);
    Crossing result = refracted(finish, point, normal, ray, iors.g, enters, straight);
    result.light.r = refracted(finish, point, normal, ray, iors.r, enters, straight).light.r;
    result.light.b = refracted(finish, point, normal, ray, iors.b, enters, straight).light.b;
    return result;
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

#if ONE_INTERFACE
    const bool starts_inside = false;
#else
    vec4 back = texelFetch(left, texel, 0);
    bool starts_inside = back.w < front.w;
#endif
#if ONE_INTERFACE
    vec4 surface = texelFetch(surface_finish, texel, 0);
#else
    vec4 surface = starts_inside ? texelFetch(left_finish, texel, 0) : texelFetch(surface_finish, texel, 0);
#endif
    Finish finish = finish_of(surface);
    if (!starts_inside) {
        vec4 tint = texelFetch(surface_color, texel, 0);
        finish.color = tint.rgb;
        finish.unoccluded = tint.a;
    }

    vec3 normal = front.xyz;
    float axial_depth = starts_inside ? surface_eye_axial_depth : front.w;
    vec3 point = point_at(pixel, axial_depth);
    float cosine = clamp(-dot(normal, ray), 0.0, 1.0);
    float reflectance = starts_inside ? 0.0 : interface_reflectance(cosine, finish.ior, finish.roughness);
    vec3 mirrored_share = vec3(reflectance);
    vec3 entered_share = vec3(1.0 - reflectance);
#if THIN_FILM
    if (!starts_inside) { mirrored_share = filmed_reflectance(finish.film, reflectance, cosine, finish.ior, 1.0); }
    entered_share = 1.0 - mirrored_share;
#endif
    if (finish.is_sheet) {
        // All reflections between its two sides; what one passage absorbs is in the optical depth already.
        vec3 passage = finish.sheet_depth / max(refracted_cosine(cosine, finish.ior), MIN_THIN_LAYER_COSINE);
        vec3 back_and_forth = reflectance * transmittance(passage);
#if THIN_FILM
        vec3 front_share = mirrored_share;
        back_and_forth = sqrt(front_share * reflectance) * transmittance(passage);
        mirrored_share = film_slab_reflectance(front_share, reflectance, passage);
        entered_share = (1.0 - front_share) * (1.0 - reflectance) / max(1.0 - back_and_forth * back_and_forth, 1e-6);
#else
        mirrored_share = slab_reflectance(reflectance, passage);
        entered_share = (1.0 - reflectance) * (1.0 - reflectance) / max(1.0 - back_and_forth * back_and_forth, 1e-6);
#endif
    }
    vec3 mirrored = vec3(0.0);
    if (max(mirrored_share.r, max(mirrored_share.g, mirrored_share.b)) > 0.0) {
        mirrored = finish.unoccluded * mirrored_share * environment_light(reflected_direction(ray, normal), finish.roughness)
            + highlights(point, normal, ray, finish, highlight_alpha(finish.roughness, surface.w));
    }
#if CLEAR_COAT
    if (!starts_inside && finish.clearcoat.x > 0.0) {
        float coated = coated_share(finish.clearcoat, cosine);
        entered_share *= 1.0 - coated;
        mirrored = (1.0 - coated) * mirrored + coat_highlights(point, normal, ray, finish, surface.w)
            + finish.unoccluded * coated * environment_light(reflected_direction(ray, normal), finish.clearcoat.y);
    }
#endif

    vec3 light = vec3(0.0);
    if (finish.transmission > 0.0) {
#if ONE_INTERFACE
        const float first_interval = 0.0; // nothing asks how long it is
#else
        float first_interval = back.w < NOTHING ? (end_of_interval(texel) - axial_depth) * surface_ahead.y * advance : -1.0;
#endif
        Crossing crossing = crossed(finish, point, normal, ray, !starts_inside, Straight(thickness, depth, first_interval));
        light = crossing.light;
        if (finish.scatters_much) {
            light += scattered_out(finish, point, normal, crossing.thickness, transmittance(crossing.optical_depth));
        }
#if DIFFUSED
        int object = int(surface.x + 0.5);
        float cosine_inside = starts_inside ? 1.0 : refracted_cosine(cosine, finish.ior);
        light += diffused_out(object, point, cosine_inside, crossing.optical_depth);
        vec3 inside = starts_inside ? ray : refracted_direction(ray, normal, finish.ior);
        light += haze(object, inside, crossing.optical_depth);
#endif
        light *= finish.transmission * finish.color;
    }
    if (finish.transmission < 1.0 && !starts_inside) {
        light += (1.0 - finish.transmission) * paint(finish, point, normal);
    }
    out_radiance = vec4(min(mirrored + entered_share * (light + emitted), vec3(NOTHING)), 1.0);
}
