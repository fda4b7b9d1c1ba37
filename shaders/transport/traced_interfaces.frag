// Rays that meet the interfaces of bodies, followed through the mesh: a tree of exact reflections and refractions. The
// stronger branch is always followed, the weaker one FORKS times on a path (the first mirror image is free), else it is looked
// up in the environment; so are both at the last of `most_interfaces`. What is absorbed and emitted on each segment is exact. The first
// interface is that which the rasterizer has found. adaptive: of several samples of a pixel, those that are worth it; with
// the square of their luminance in place of the transmittance. ROUGH: some body is. Row 0 of the output is the top row. Radiance is basic radiance, L / n^2.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <SurfaceRow>
#include <TracedBody>
#include "lib/color.glsl"
#include "lib/interface.glsl"
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/environment_beyond.glsl"
#include "shade/interface_light.glsl"
#include "shade/diffused_light.glsl"
#include "shade/opaque_light.glsl"
#include "transport/hierarchy.glsl"
#include "transport/record.glsl"
#include "transport/place.glsl"
#include "transport/light_passed.glsl"
#if FOOTPRINTS
#include "transport/footprint.glsl"
#endif
#include "transport/opaque_objects.glsl"

uniform int adaptive;              // 1: with the square of luminance, and opaque objects as the mean of all samples shows them

#include "transport/branch_ends.glsl"
#include "transport/sampled_facets.glsl"

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D entered;           // interface towards the eye: normal, axial depth
uniform sampler2D surface_finish;    // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
uniform int most_interfaces;
uniform int all_closed;              // 1: no solid has holes: what seems to leave through one passes an edge by rounding
uniform float faintest_share;        // of the light, its three channels together: fainter rays are not followed
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

const float EDGE_ON = 1e-3;
const int WAITING = 8;
const int GLIMPSES = 8;

// One of the rays that wait to be followed.
struct Ray {
    vec3 origin;
    float skipped;    // metres of its path that lie before its origin: from the surface, which it must not meet again
    vec3 direction;
    vec3 share;       // of the light at its end that reaches the eye
    uvec4 record;
    int met;          // interfaces
    int forks;        // left
    bool reflected;   // sees the environment as a light
    float blur;       // squared alpha of a mirror with the same blur
    int turns;        // which of its interfaces it was reflected at, a bit each
    vec3 outwards;    // normal of the body where it starts inside one
#if FOOTPRINTS
    Footprint footprint;
#endif
};

float strength(vec3 share) {
    return dot(share, vec3(1.0));
}

// Ray that goes on from a point of a surface: on the side that its direction goes to, a little off, so that it does not meet
// the surface again.
void leave(inout Ray ray, vec3 point, vec3 face_normal) {
    float offset = SURFACE_OFFSET * surface_reach;
    float across = dot(face_normal, ray.direction);
    ray.origin = point + (across < 0.0 ? -offset : offset) * face_normal;
    ray.skipped = offset / max(abs(across), 1e-2);
}

struct Sum {
    vec3 light;
    float lost;        // share of the light whose ray went through a hole, or is in more bodies than a record holds
};

#if OPAQUE
uniform int ground_object;   // number of the object that is the ground, or -1
uniform vec4 ground_plane;   // unit normal upwards, and metres along it from the center of the media

#endif

// What a ray sees that is not followed on: the environment, or the ground before it.
Glimpse seen_ahead(Ray ray, vec3 direction, vec3 share, bool reflected) {
    Glimpse end = Glimpse(AIR, vec3(0.0), ray.origin, ray.origin, direction, share, reflected, ray.blur
#if FOOTPRINTS
        , ellipse_of(ray.footprint.direction)
#endif
    );
#if OPAQUE
    float falling = -dot(ground_plane.xyz, direction), height = dot(ground_plane.xyz, ray.origin) - ground_plane.w;
    if (ground_object >= 0 && falling > 1e-3 && height > 0.0) {
        end.object = ground_object;
        end.normal = ground_plane.xyz;
        end.point += height / falling * direction;
    }
#endif
    return end;
}

// The first interface, as the rasterizer has found it.
struct Seen {
    int object;
    vec3 point;
    vec3 normal;
    Finish finish;
};

Sum follow(Ray ray, Seen seen, float first_reach, int channel) {
    Sum sum = Sum(vec3(0.0), 0.0);
#if FORKS > 0
    Ray waiting[WAITING];
#else
    Ray waiting[1];
#endif
    int waits = 0;
    bool ends = false;
    vec3 passed = vec3(1.0);  // transmittance of the last segment
    float reach = first_reach;
    Glimpse glimpses[GLIMPSES];
    int ended = 0;  // branches of which it is not known yet what they see; a step ends two at most
    int step = 0;
    do {
        for (; step < MOST_STEPS && ended + 2 <= GLIMPSES; ++step) {
            if (ends) {
                if (waits == 0) { break; }
                ray = waiting[--waits];
                ends = false;
            }
            int before = dominant_body(ray.record);
            bool sound = true;
            Hit hit = first_hit(ray.origin, ray.direction, 0.0, reach);
            Place place = place_at(ray.origin, ray.direction, ray.record, 0.0, hit, before, channel, sound);
            if (hit.object < 0 && reach < NOTHING) {
                reach = NOTHING;  // the rasterizer sees this edge a little elsewhere
                continue;
            }
            reach = NOTHING;
            if (hit.object < 0 && all_closed == 1) {
                ray.record = uvec4(0u);
                before = AIR;
            }
            passed = vec3(1.0);
            if (ray.record.x != 0u) {
                if (hit.object < 0) { sum.lost += strength(ray.share) / 3.0; }  // it has left through a hole
                Filling filling = filling_of(ray.record, before);
                float path = min(hit.path + ray.skipped, 1e3 * surface_reach);
#if EMISSION
                sum.light += ray.share * emitted_radiance(filling.emission, filling.extinction, path);
#endif
                passed = transmittance(filling.extinction * path);
#if LAYERED
                if (before != AIR && surface_table_row(before).scatters_much > 0.5) {
                    Finish layer = finish_of(vec4(float(before), 0.0, 1.0, 0.0));
                    sum.light += ray.share * scattered_out(layer, ray.origin, ray.outwards, path, passed);
                }
#endif
#if DIFFUSED
                if (before != AIR) {
                    float cosine = clamp(-dot(ray.direction, ray.outwards), 0.0, 1.0);
                    sum.light += ray.share * diffused_out(before, ray.origin, cosine, filling.extinction * path);
                    sum.light += ray.share * haze(before, ray.direction, filling.extinction * path);
                }
#endif
                ray.share *= passed;
            }
            if (hit.object < 0) {
                glimpses[ended++] = Glimpse(AIR, vec3(0.0), ray.origin, ray.origin, ray.direction, ray.share, ray.reflected, ray.blur
#if FOOTPRINTS
                    , ellipse_of(ray.footprint.direction)
#endif
                );
                ends = true;
                continue;
            }
            vec3 point = ray.origin + hit.path * ray.direction;
#if FOOTPRINTS
            ray.footprint.point += hit.path * ray.footprint.direction;
#endif
            TracedBody body = traced_body(place.object);
            int kind = int(body.kind);
            bool outside = place.outside;
            vec3 face_normal = place.face_normal;
#if !FROM_EYE
            // Before the first interface a ray is in no body; it started a little before what the rasterizer has found.
            if (ray.met == 0 && kind == KIND_SOLID && !outside && ray.record.x == 0u) {
                leave(ray, point, face_normal);
                continue;
            }
#endif
            if (!sound && (all_closed == 0 || is_full(ray.record))) { sum.lost += strength(ray.share) / 3.0; }
            vec3 smooth_normal = place.smooth_normal;
            bool first = ray.met == 0 && place.object == seen.object && distance(point, seen.point) < 1e-3 * surface_reach;
            if (first) { smooth_normal = seen.normal; }
            float facing = dot(smooth_normal, ray.direction);
            if (facing > -EDGE_ON) { smooth_normal = normalize(smooth_normal - (facing + EDGE_ON) * ray.direction); }
            sum.light += ray.share * place.glow;
            ray.share *= place.coat;
            if (kind == KIND_OPAQUE && (outside || body.one_sided == 0.0)) {
                // It is in an open body, and whether rightly so, what is behind the opaque object would tell.
                if (all_closed == 0 && is_in_open_body(ray.record)) { sum.lost += strength(ray.share) / 3.0; }
                glimpses[ended++] = Glimpse(place.object, smooth_normal, ray.origin, point, ray.direction, ray.share, ray.reflected, ray.blur
#if FOOTPRINTS
                    , ellipse_of(ray.footprint.direction)
#endif
                );
                ends = true;
                continue;
            }
            int after = dominant_body(place.record);
            if (kind != KIND_SHEET && !alters_light(before, after, channel)) {
                leave(ray, ray.origin + place.path * ray.direction, face_normal);
                ray.record = place.record;
                ray.outwards = smooth_normal;
                continue;
            }
            float ior = index_of(kind == KIND_SHEET ? place.object : after, channel) / index_of(before, channel);
            bool enters = kind == KIND_SHEET || place.object == after;
            // Textures are read where a ray first meets an object; farther on it counts as the same all over.
            bool as_first = place.object == seen.object;
            float roughness = as_first ? seen.finish.roughness : body.roughness;
            float transmission = as_first ? seen.finish.transmission : body.transmission;
            vec3 tint = as_first ? seen.finish.color : body.color;
            float alpha = roughness * roughness;
#if CLEAR_COAT
            vec3 coat_normal = smooth_normal;
            bool polished = roughness == 0.0;
#endif
#if ROUGH
            vec3 facet, facet_normal;
            float facet_alpha = 0.0, full_alpha = 0.0;
            if (roughness > 0.0 && blurred_share < 1.0) {
                facet_alpha = sqrt(1.0 - blurred_share) * alpha;
                full_alpha = alpha;
                alpha *= sqrt(blurred_share);
                facet = microfacet_normal(smooth_normal, ray.direction, facet_alpha, microfacet_shares(ray.met, ray.turns));
                facet_normal = smooth_normal;
                smooth_normal = facet;
                roughness = 0.0;
            }
#endif
            float cosine = clamp(-dot(smooth_normal, ray.direction), 0.0, 1.0);
            float reflectance = interface_reflectance(cosine, ior, roughness);
            vec3 share_back = vec3(reflectance);
            vec3 share_on = vec3(1.0 - reflectance);
#if THIN_FILM
            vec3 filmed = filmed_reflectance(body.film, reflectance, cosine, ior, index_of(before, channel));
            share_back = filmed;
            share_on = 1.0 - filmed;
#endif
            vec3 on_way = ray.direction;
            if (kind == KIND_SHEET) {
                float through = 1.0 / max(refracted_cosine(cosine, ior), MIN_THIN_LAYER_COSINE);
                vec3 depth = body.extinction * through;
#if EMISSION
                // What a sheet emits goes back and forth in it, too.
                vec3 leaving = (1.0 - reflectance) / max(1.0 - reflectance * transmittance(depth), vec3(1e-6));
#if THIN_FILM
                vec3 mirrored_on = reflectance * transmittance(depth);
                leaving = (1.0 - filmed) * (1.0 + mirrored_on) / max(1.0 - filmed * transmittance(depth) * mirrored_on, vec3(1e-6));
#endif
                sum.light += ray.share * leaving * emitted_radiance(body.emission, body.extinction, through);
#endif
#if THIN_FILM
                share_back = film_slab_reflectance(filmed, reflectance, depth);
                share_on = film_slab_transmittance(filmed, reflectance, depth);
#else
                share_back = slab_reflectance(reflectance, depth);
                share_on = slab_transmittance(reflectance, depth);
#endif
            } else {
                on_way = kept_on_side(refracted_direction(ray.direction, smooth_normal, ior), -face_normal);
            }
#if ROUGH
            if (facet_alpha > 0.0) {
                float towards = -dot(facet_normal, ray.direction);
                vec3 mirrored_way = reflected_direction(ray.direction, facet);
                share_back *= masking_ratio(towards, dot(facet_normal, mirrored_way), full_alpha);
                share_on *= kind == KIND_SHEET ? 1.0 : masking_ratio(towards, -dot(facet_normal, on_way), full_alpha);
            }
#endif
            vec3 back_way = kept_on_side(reflected_direction(ray.direction, smooth_normal), face_normal);
#if CLEAR_COAT
            if (body.clearcoat > 0.0 && (outside || kind == KIND_SHEET)) {
                float coated = coated_share(vec2(body.clearcoat, body.clearcoat_roughness), clamp(-dot(coat_normal, ray.direction), 0.0, 1.0));
                share_back *= 1.0 - coated;
                share_on *= 1.0 - coated;
                if (polished && body.clearcoat_roughness == 0.0) {
                    share_back += coated;
                } else {
                    float coat_alpha = body.clearcoat_roughness * body.clearcoat_roughness;
                    vec3 coat_way = kept_on_side(reflected_direction(ray.direction, coat_normal), face_normal);
                    sum.light += (first ? seen.finish.unoccluded : 1.0) * coated * ray.share
                        * environment_seen(point, coat_way, true, ray.blur + coat_alpha * coat_alpha);
                }
            }
#endif
#if PAINTED
            if (transmission < 1.0 && enters) {
                Finish finish = seen.finish;
                if (!as_first) {
                    finish = finish_of(vec4(float(place.object), roughness, transmission, 0.0));
                    finish.color = tint;
                }
                sum.light += ray.share * share_on * (1.0 - transmission) * paint(finish, point, smooth_normal);
            }
#endif
            if (enters) { share_on *= transmission * tint; }
            float ior_inside = max(ior, 1.0 / ior);
            float occlusion = first ? seen.finish.unoccluded : 1.0;
#if FOOTPRINTS
            ray.footprint.point = onto_plane(ray.footprint.point, ray.direction, face_normal);
            mat2x3 normals = normal_differentials(hit, ray.footprint.point, smooth_normal);
#endif
            Ray back = Ray(point, 0.0, back_way, occlusion * ray.share * share_back, ray.record, ray.met + 1,
                ray.met == 0 ? 0 : ray.forks, true, ray.blur + alpha * alpha * (outside ? 1.0 : ior_inside * ior_inside),
                ray.turns * 2 + 1, -smooth_normal
#if FOOTPRINTS
                , Footprint(ray.footprint.point, reflected_differentials(ray.footprint.direction, normals, ray.direction, smooth_normal))
#endif
            );
            Ray on = Ray(point, 0.0, on_way, ray.share * share_on, place.record, ray.met + 1, ray.forks, ray.reflected,
                ray.blur + alpha * alpha * 0.25 * (ior_inside - 1.0) * (ior_inside - 1.0), ray.turns * 2, smooth_normal
#if FOOTPRINTS
                , Footprint(ray.footprint.point, kind == KIND_SHEET ? ray.footprint.direction
                    : refracted_differentials(ray.footprint.direction, normals, ray.direction, smooth_normal, ior))
#endif
            );
            leave(back, point, face_normal);
            leave(on, ray.origin + place.path * ray.direction, face_normal);
            bool on_stronger = strength(on.share) >= strength(back.share);
            bool last = ray.met + 1 >= most_interfaces || step > 3 * MOST_STEPS / 4;
            Ray weaker = back;
            vec3 arrival = ray.direction;
            bool arrived_reflected = ray.reflected;
            vec3 again = outside ? vec3(1.0) : passed;
#if LAYERED
            // Light that scatters on the way comes out all the same where media give it back.
            if (before != AIR && surface_table_row(before).scatters_much > 0.5) { again = vec3(1.0); }
#endif
            ray = on;
            if (!on_stronger) {
                weaker = on;
                ray = back;
            }
#if FORKS > 0
            weaker.forks -= ray.met == 1 ? 0 : 1;
            if (weaker.forks >= 0 && !last && waits < WAITING && strength(weaker.share) > faintest_share) {
                waiting[waits++] = weaker;
            } else
#endif
            if (strength(weaker.share) > 0.0) {
                vec3 share = (on_stronger ? again : vec3(1.0)) * weaker.share;
                glimpses[ended++] = seen_ahead(weaker, weaker.direction, share, weaker.reflected);
            }
            if (last || strength(ray.share) < faintest_share) {
                // What is mirrored totally is looked up as if it left straight on: mirrored on, it would most often leave there, too.
                bool total = reflectance == 1.0;
                vec3 share = (on_stronger ? vec3(1.0) : again) * ray.share;
                glimpses[ended++] = seen_ahead(ray, total ? arrival : ray.direction, share, total ? arrived_reflected : ray.reflected);
                ends = true;
            }
        }
        while (ended > 0) {
            --ended;
            sum.light += glimpses[ended].share * light_at(glimpses[ended]);
        }
    } while (step < MOST_STEPS && !(ends && waits == 0));
    // Not all has been followed after too many steps, or where a driver cuts long loops short: Mesa does after 65,535 turns.
    if (!(ends && waits == 0 && ended == 0)) { sum.lost = 1.0; }
    return sum;
}

#if MIRROR
#include "transport/mirrored_ground.glsl"
#else
const int mirrored = 0;
#endif

// The first ray of a pixel, which starts a little before what the rasterizer has found, and how far it looks for that.
void begin(vec2 pixel, vec3 direction, vec4 front, vec4 surface, vec4 tint, bool starts_inside, out Ray ray, out Seen seen, out float reach) {
    Finish finish = finish_of(surface);
    finish.color = tint.rgb;
    finish.unoccluded = tint.a;
    seen = Seen(front.w < NOTHING ? int(surface.x + 0.5) : AIR, point_at(pixel, front.w), front.xyz, finish);
    vec3 eye = point_at(pixel, surface_eye_axial_depth);
    float margin = min(1e-3 * surface_reach, distance(seen.point, eye));
    ray = Ray(seen.point - margin * direction, 0.0, direction, vec3(1.0), uvec4(0u), 0, FORKS, false, 0.0, 0, -direction
#if FOOTPRINTS
        , footprint_of(pixel, front.w)
#endif
    );
    reach = margin + 1e-3 * surface_reach;
#if FROM_EYE
    // Something may lie before the first interface.
    ray.origin = point_at(pixel, 0.0);
#if FOOTPRINTS
    ray.footprint = footprint_of(pixel, starts_inside ? surface_eye_axial_depth : 0.0);
#endif
    if (starts_inside) {
        ray.skipped = 2.0 * SURFACE_OFFSET * surface_reach;
        ray.origin = eye + ray.skipped * direction;
        ray.record = record_at_eye(eye, direction, ray.skipped);
    }
    reach = NOTHING;
#endif
}

void main() {
    read_bodies();
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 direction = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    vec3 emitted = texelFetch(emitted_radiance_sum, here, 0).rgb;
    vec3 through = texelFetch(straight_transmittance, here, 0).rgb;
    vec4 front = texelFetch(entered, texel, 0);
    out_transmittance = vec4(through, 1.0);  // alpha: share of the light that can be trusted
#if FROM_EYE
    bool starts_inside = start_record.x != 0u;
#else
    const bool starts_inside = false;
#endif
    Ray ray;
    Seen seen;
    float reach = NOTHING;
    vec4 surface = vec4(0.0);
#if MIRROR
    vec3 mirrored_share;
    if (mirrored == 1) {
        out_radiance = out_transmittance = vec4(0.0);
        if (front.w < NOTHING || !begin_in_mirror(pixel, texel, direction, ray, seen, mirrored_share)) { return; }
    } else
#endif
    if (front.w < NOTHING || starts_inside) {
        surface = texelFetch(surface_finish, texel, 0);
        begin(pixel, direction, front, surface, texelFetch(surface_color, texel, 0), starts_inside, ray, seen, reach);
    } else {
        out_radiance = vec4(background(pixel, direction, texel) * through + emitted, 1.0);
        return;
    }
    Sum sum = follow(ray, seen, reach, 1);
#if MIRROR
    if (mirrored == 1) {
        vec3 without = environment_seen(ray.origin, ray.direction, true, ray.blur);
        out_radiance = vec4(mirrored_share * through * (min(sum.light, vec3(NOTHING)) - without), 0.0);
        out_transmittance.a = -strength(mirrored_share) / 3.0 * min(sum.lost, 1.0);
        return;
    }
#endif
#if DISPERSION
    Sum red = follow(ray, seen, reach, 0);
    Sum blue = follow(ray, seen, reach, 2);
    sum.light.rb = vec2(red.light.r, blue.light.b);
    sum.lost = (sum.lost + red.lost + blue.lost) / 3.0;
#endif
    vec3 light = sum.light;
    vec3 share = vec3(1.0);
    if (front.w < NOTHING && !starts_inside) {
        float cosine = clamp(-dot(front.xyz, direction), 0.0, 1.0);
        share = vec3(1.0 - interface_reflectance(cosine, seen.finish.ior, seen.finish.roughness)) * seen.finish.transmission * seen.finish.color;
        vec3 glints = highlights(seen.point, front.xyz, direction, seen.finish, highlight_alpha(seen.finish.roughness, surface.w));
#if CLEAR_COAT
        float below = 1.0 - coated_share(seen.finish.clearcoat, cosine);
        share *= below;
        glints = below * glints + coat_highlights(seen.point, front.xyz, direction, seen.finish, surface.w);
#endif
        light += glints;
    }
#if !EMISSION
    light += share * emitted;
#endif
    out_radiance = vec4(min(light, vec3(NOTHING)), 1.0);
    out_transmittance.a = 1.0 - min(sum.lost, 1.0);
    if (adaptive == 1) {
        float level = min(luminance(out_radiance.rgb), 1e15);
        out_transmittance.rgb = vec3(level * level, 0.0, 0.0);
    }
}
