// Random paths of light through media and interfaces, some events of one path of each pixel, and then of the next one. The
// estimator is that of translucent/reference/interface_paths.py, but for what follows here. The channels of light take one way
// together: how far they fly is drawn for one of them, chosen by what it carries, and weighted with the balance heuristic
// over all (Veach & Guibas 1995; Wilkie et al. 2014), so that together they never carry more than before. What media absorb
// and emit on a segment is exact.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <TracedBody>
#include "lib/interface.glsl"
#include "lib/optics.glsl"
#include "lib/phase.glsl"
#include "lib/ray.glsl"
#include "shade/lights.glsl"
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/environment_beyond.glsl"
uniform sampler2D reflectance_table;
#include "shade/opaque_light.glsl"
#include "transport/path_state.glsl"
#include "transport/random.glsl"
#include "transport/hierarchy.glsl"
#include "transport/record.glsl"
#include "transport/place.glsl"
#include "transport/microfacets.glsl"
#include "transport/straight_light.glsl"
#include "transport/light_passed.glsl"

uniform ivec2 tile_origin;   // of the texels in the picture, from its top left corner
uniform uint last_path;      // how many paths of each pixel are to end
uniform int events;          // that are followed in this pass
uniform float pass_number;
uniform int spread;          // 1: paths start all over their pixels, and not at one place in them
uniform int all_closed;      // 1: no solid has holes: what seems to leave through one passes an edge by rounding

const int CHANNEL = 1;             // whose indices of refraction count
const float ROULETTE = 0.1;       // share of light below which paths end by Russian roulette, or go on with this share
const int MANY_INTERFACES = 256;  // after which they end so whatever they carry: total reflection may hold light for ever
const float GOES_ON = 0.95;
const float EDGE_ON = 1e-3;
const uint MOST_DRAWN = 1u << 22;
const float EYE_MARGIN = 1e-3;    // axial depth before the media at which paths begin

// Place in the picture at which a path starts: an additive recurrence (Roberts 2018, "The unreasonable effectiveness of
// quasirandom sequences").
vec2 pixel_of(ivec2 texel, uint path) {
    vec2 share = vec2(uvec2(path * 3242174889u, path * 2447445414u) >> 8u) / 16777216.0;
    return vec2(texel) + (spread == 1 ? fract(share + 0.5) : 0.5 + frame_size.zw);
}

float largest_share(vec3 share) {
    return max(share.r, max(share.g, share.b));
}

// Number of a channel, chosen by what each carries.
int chosen_channel(vec3 weights, float share) {
    float at = share * (weights.r + weights.g + weights.b);
    return at < weights.r ? 0 : at < weights.r + weights.g || weights.b == 0.0 ? (weights.g > 0.0 ? 1 : 0) : 2;
}

vec3 environment_seen(Path path, vec2 pixel) {
#if SEEN_LIGHTS
    return mirrored_environment(path.direction);
#else
    if ((path.flags & FLAG_REFLECTED) != 0u) { return mirrored_environment(path.direction); }
    if ((path.flags & FLAG_BENT) == 0u) { return seen_environment(in_heights(pixel), path.direction); }
    return environment_beyond(path.origin, path.direction, 0.0);
#endif
}

// Irradiance on paint, as far as lights reach it.
vec3 unblocked_irradiance(vec3 point, vec3 normal) {
    vec3 sum = environment_irradiance(normal);
#if LIGHTS
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, point);
        float facing = dot(normal, arriving.towards);
        float unblocked = facing > 0.0 ? light_unblocked(light, point, normal) : 0.0;
        if (unblocked == 0.0) { continue; }
        sum += facing * unblocked * arriving.irradiance * light_passed(point, normal, arriving.towards, arriving.distance_m);
    }
#endif
    return sum;
}

#include "transport/opaque_objects.glsl"

// Share of the light of each channel that the media of a place turn by an angle, in 1/sr.
vec3 phase_of(uvec4 record, int dominant, vec3 scattering, float cosine) {
#if ONE_OBJECT || PRIORITY
    return vec3(phase_value(traced_body(dominant).phase, cosine));
#else
    vec3 sum = vec3(0.0);
    for (int i = 0; i < RECORD_SIZE; ++i) {
        uint entry = record_entry(record, i);
        if (entry == 0u) { break; }
        if (!counts_in(record, i)) { continue; }
        TracedBody body = traced_body(int(entry) - 1);
        sum += body.scattering * phase_value(body.phase, cosine);
    }
    return sum / max(scattering, vec3(1e-30));
#endif
}

// Phase function of one of the media of a place, chosen by what it scatters of the light.
vec4 chosen_phase(uvec4 record, int dominant, vec3 scattering, vec3 carried, float share) {
#if ONE_OBJECT || PRIORITY
    return traced_body(dominant).phase;
#else
    vec3 each = carried / max(scattering, vec3(1e-30));
    float left = share * dot(each, scattering);
    vec4 phase = vec4(0.0);
    for (int i = 0; i < RECORD_SIZE; ++i) {
        uint entry = record_entry(record, i);
        if (entry == 0u) { break; }
        if (!counts_in(record, i)) { continue; }
        TracedBody body = traced_body(int(entry) - 1);
        float own = dot(each, body.scattering);
        if (own > 0.0) { phase = body.phase; }
        left -= own;
        if (left < 0.0) { break; }
    }
    return phase;
#endif
}

// Ends paths that carry little, or lets them carry more for those that end (Arvo & Kirk 1990).
void play_roulette(inout Path path, float share) {
    float chance = min(largest_share(path.share) / ROULETTE, 1.0);
    if (path.met > MANY_INTERFACES) { chance = min(chance, GOES_ON); }
    path.ends = share >= chance;
    path.share /= max(chance, 1e-30);
}

// Goes on from a point of a surface: on the side that its direction goes to, a little off, so that it is not met again.
void leave(inout Path path, vec3 point, vec3 face_normal) {
    float offset = SURFACE_OFFSET * surface_reach;
    float across = dot(face_normal, path.direction);
    path.origin = point + (across < 0.0 ? -offset : offset) * face_normal;
    path.skipped = offset / max(abs(across), 1e-2);
}

void begin_path(inout Path path, vec2 pixel, ivec2 texel) {
    vec3 direction = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    path = Path(point_at(pixel, max(-EYE_MARGIN, surface_eye_axial_depth)), 0.0, direction, vec3(1.0), vec3(0.0), uvec4(0u),
        FLAG_FOLLOWED, 0, false, false);
#if FROM_EYE
    if (start_record.x != 0u) {
        vec3 eye = point_at(pixel, surface_eye_axial_depth);
        path.skipped = 2.0 * SURFACE_OFFSET * surface_reach;
        path.origin = eye + path.skipped * direction;
        path.record = record_at_eye(eye, direction, path.skipped);
    }
#endif
#if OPAQUE
    if (texelFetch(opaque_axial_depth, stored(texel), 0).r < max(-EYE_MARGIN, surface_eye_axial_depth)) {
        path.light = texelFetch(opaque_radiance, stored(texel), 0).rgb;
        path.ends = true;
    }
#endif
}

// Turns a path where media scatter it, and adds that of one of the lights there.
void scatter(inout Path path, Filling filling, int dominant, inout Draws draws) {
    path.flags |= FLAG_BENT | FLAG_REFLECTED;
    path.skipped = 0.0;
    vec4 shares = random_shares(draws);
#if LIGHTS
    int number = min(int(shares.x * float(light_count)), light_count - 1);
    shares.x = fract(shares.x * float(light_count));
    LightSample arriving = light_at(number, path.origin);
    vec3 phase = phase_of(path.record, dominant, filling.scattering, dot(arriving.towards, path.direction));
    vec3 through = straight_transmittance(path.origin, 0.0, path.record, arriving.towards, arriving.distance_m, CHANNEL);
    path.light += path.share * phase * through * arriving.irradiance * float(light_count);
#endif
    vec4 phase_function = chosen_phase(path.record, dominant, filling.scattering, path.share, shares.x);
    vec3 before = path.direction;
    path.direction = turned_by(before, phase_cosine(phase_function, shares.y), shares.z);
#if !(ONE_OBJECT || PRIORITY)
    vec3 turned = phase_of(path.record, dominant, filling.scattering, dot(before, path.direction));
    float density = dot(path.share, turned) / max(dot(path.share, vec3(1.0)), 1e-30);
    path.share *= turned / max(density, 1e-30);
#endif
    play_roulette(path, shares.w);
}

// Light at an interface: one branch, chosen by its share.
void meet(inout Path path, Place place, TracedBody body, int before, int after, inout Draws draws) {
    bool is_sheet = int(body.kind) == KIND_SHEET;
    vec3 normal = place.smooth_normal;
    float facing = dot(normal, path.direction);
    if (facing > -EDGE_ON) { normal = normalize(normal - (facing + EDGE_ON) * path.direction); }
    float cosine = clamp(-dot(normal, path.direction), 0.0, 1.0);
    float ior = index_of(is_sheet ? place.object : after, CHANNEL) / index_of(before, CHANNEL);
    vec3 point = path.origin + place.path * path.direction;
    vec3 passing = body.transmission * (is_sheet || place.object == after ? body.color : vec3(1.0));
    float reflectance = fresnel_dielectric(cosine, ior);
    vec4 shares = random_shares(draws);
    path.flags |= FLAG_BENT;
    ++path.met;
    vec3 mirrored = vec3(reflectance);
    float coated = 0.0;
#if THIN_FILM
    if (body.film.x > 0.0) {
        float film_ior = body.film.y / index_of(before, CHANNEL);
        mirrored = mix(mirrored, thin_film_reflectance(cosine, ior, film_ior, body.film.y * body.film.z), body.film.x);
    }
#endif
#if CLEAR_COAT
    if (is_sheet || place.outside) { coated = body.clearcoat * fresnel_dielectric(cosine, CLEARCOAT_IOR); }
#endif
    bool passes = shares.x >= reflectance;
    vec3 painted = vec3(1.0);
    vec3 way = reflected_direction(path.direction, normal);
#if ROUGH
    float alpha = body.roughness * body.roughness;
    if (alpha > 0.0 && ior != 1.0) {
        mat3 frame = frame_around(normal);
        vec3 to_light = vec3(0.0);
        float seen;
#if LIGHTS
        int number = min(int(shares.y * float(light_count)), light_count - 1);
        LightSample arriving = light_at(number, point);
        to_light = arriving.towards * frame;
#endif
        way = scattered_at_microfacets(path.direction * frame, ior, alpha, to_light, draws, seen);
        path.lost = way == vec3(0.0);
        passes = way.z < 0.0;
        way = frame * way;
#if LIGHTS
        // Light that comes from the other side of the face than of the smooth surface does not exist.
        float side = to_light.z < 0.0 ? -1.0 : 1.0;
        if (seen > 0.0 && side * dot(arriving.towards, place.face_normal) > 0.0) {
            float offset = SURFACE_OFFSET * surface_reach;
            float skipped = offset / max(abs(dot(place.face_normal, arriving.towards)), 1e-2);
            vec3 through = straight_transmittance(point + side * offset * place.face_normal, skipped,
                side > 0.0 ? path.record : place.record, arriving.towards, arriving.distance_m - skipped, CHANNEL);
            path.light += path.share * (side > 0.0 ? vec3(1.0) : passing) * through * arriving.irradiance * seen * float(light_count);
        }
#endif
    } else
#endif
    if (is_sheet) {
        float through = 1.0 / max(refracted_cosine(cosine, ior), MIN_THIN_LAYER_COSINE);
        vec3 depth = body.extinction * through;
#if EMISSION
        // What a sheet emits goes back and forth in it, too.
        vec3 again = reflectance * transmittance(depth);
        vec3 leaving = (1.0 - mirrored) * (1.0 + again) / max(1.0 - mirrored * transmittance(depth) * again, vec3(1e-6));
        leaving *= 1.0 - coated;
        path.light += path.share * leaving * emitted_radiance(body.emission, body.extinction, through);
#endif
#if THIN_FILM
        vec3 back = film_slab_reflectance(mirrored, reflectance, depth), on = film_slab_transmittance(mirrored, reflectance, depth);
#else
        vec3 back = slab_reflectance(reflectance, depth), on = slab_transmittance(reflectance, depth);
#endif
        back += coated * (1.0 - back);
        on *= 1.0 - coated;
        float chance = dot(path.share, on * passing + vec3(1e-30));
        chance /= chance + dot(path.share, back);
        // Paint is lit by all that passes, whatever the path does.
        path.light += path.share * on * (1.0 - body.transmission)
            * (body.transmission < 1.0 ? body.color * (1.0 - body.passed_share) * unblocked_irradiance(point, normal)
            + body.passed * unblocked_irradiance(point, -normal) : vec3(0.0)) / PI;
        passes = shares.x < chance;
        way = passes ? path.direction : way;
        path.share *= passes ? on / chance : back / (1.0 - chance);
        painted = vec3(0.0);
    } else {
        mirrored += coated * (1.0 - mirrored);
        if (mirrored != vec3(reflectance)) {
            float chance = dot(mirrored, vec3(1.0 / 3.0));
            passes = shares.x >= chance;
            path.share *= passes ? (1.0 - mirrored) / (1.0 - chance) : mirrored / max(chance, 1e-30);
        }
        if (passes) { way = refracted_direction(path.direction, normal, ior); }
    }
    if (passes) {
        if (body.transmission < 1.0 && painted.r > 0.0) {
            vec3 front = body.color * (1.0 - body.passed_share) * unblocked_irradiance(point, normal);
            path.light += path.share * (1.0 - body.transmission) * (front + body.passed * unblocked_irradiance(point, -normal)) / PI;
        }
        path.share *= passing;
        path.record = place.record;
    } else {
        path.flags |= FLAG_REFLECTED;
    }
    path.direction = kept_on_side(normalize(way), passes ? -place.face_normal : place.face_normal);
    leave(path, point, place.face_normal);
    play_roulette(path, shares.z);
    path.ends = path.ends || path.lost;
}

// Follows a path to its next event or surface.
void follow(inout Path path, vec2 pixel, ivec2 texel, inout Draws draws) {
    int before = dominant_body(path.record);
    Filling filling = filling_of(path.record, before);
    bool scatters = false;
    float flight = NOTHING;
    int channel = 1;
#if SCATTER
    scatters = largest_share(filling.scattering) > 0.0;
    if (scatters) {
        vec4 shares = random_shares(draws);
        channel = chosen_channel(path.share, shares.x);
        float along = filling.scattering[channel];
        flight = along > 0.0 ? min(-log(shares.y) / along, NOTHING) : NOTHING;
    }
#endif
    // A little farther than it flies: events beside a surface are kept off it, or rounding might put them behind.
    float margin = 2.0 * SURFACE_OFFSET * surface_reach;
    float end = flight < NOTHING ? max(flight - path.skipped, 0.0) + margin : NOTHING;
#if EMISSION
    if (largest_share(filling.emission) > 0.0) { end = NOTHING; }
#endif
    Hit hit = nearest_hit(path.origin, path.direction, 0.0, end, uvec4(0u));
    bool meets = hit.object >= 0;
    float farthest = 1e3 * surface_reach;
    float surface = meets ? hit.path + path.skipped : max(flight, farthest);
    bool collides = flight < surface;
    vec3 at = path.origin + max(min(flight - path.skipped, meets ? hit.path - margin : NOTHING), 0.0) * path.direction;
    bool astray = path.record.x != 0u && !meets && (!collides || length(at) > surface_reach);
    if (astray && all_closed == 1) {
        path.record = uvec4(0u);
    } else {
        path.lost = astray;
#if EMISSION
        path.light += path.share * emitted_radiance(filling.emission, filling.extinction, min(surface, farthest));
#endif
        float length_m = collides ? flight : min(surface, farthest);
        if (scatters) {
            // Relative to the channel that was drawn for: the others may differ by more than float32 holds.
            vec3 relative = exp(-(filling.scattering - filling.scattering[channel]) * length_m);
            vec3 found = collides ? filling.scattering * relative : relative;
            float density = dot(path.share, found) / dot(path.share, vec3(1.0));
            path.share *= transmittance(max(filling.extinction - filling.scattering, vec3(0.0)) * length_m) * found / density;
        } else {
            path.share *= transmittance(filling.extinction * length_m);
        }
        if (path.lost) {
            path.ends = true;
            return;
        }
        if (collides) {
            path.origin = at;
            scatter(path, filling, before, draws);
            return;
        }
    }
    if (!meets) {
        path.light += path.share * environment_seen(path, pixel);
        path.ends = true;
        return;
    }
    bool sound = true;
    Place place = place_at(path.origin, path.direction, path.record, 0.0, hit, before, CHANNEL, sound);
    TracedBody body = traced_body(place.object);
    path.lost = !sound && (all_closed == 0 || is_full(path.record));
    path.light += path.share * place.glow;
    path.share *= place.coat;
    if (int(body.kind) == KIND_OPAQUE && (place.outside || body.one_sided == 0.0)) {
        path.ends = true;
#if OPAQUE
        if ((path.flags & FLAG_BENT) == 0u) {
            path.light += path.share * background(pixel, path.direction, stored(texel));
            return;
        }
#endif
        vec3 normal = place.smooth_normal;
        float facing = dot(normal, path.direction);
        if (body.plain == 1.0) {
            normal = place.face_normal;
        } else if (facing > -EDGE_ON) {
            normal = normalize(normal - (facing + EDGE_ON) * path.direction);
        }
        path.light += path.share * opaque_light(body, normal, path.direction, path.origin + hit.path * path.direction);
        return;
    }
    int after = dominant_body(place.record);
    if (int(body.kind) != KIND_SHEET && !alters_light(before, after, CHANNEL)) {
        leave(path, path.origin + place.path * path.direction, place.face_normal);
        path.record = place.record;
    } else {
        meet(path, place, body, before, after, draws);
    }
    path.ends = path.ends || path.lost || path.share == vec3(0.0);
}

void main() {
    read_bodies();
    ivec2 here = ivec2(gl_FragCoord.xy);
    ivec2 texel = here + tile_origin;
    Statistics known = stored_statistics(here);
    uint drawn = texelFetch(path_counts, here, 0).y;
    float ended_in = texelFetch(path_spread, here, 0).w;
    if (known.count >= last_path && ended_in + 1.5 < pass_number) { discard; }  // both states have it
    Path path = stored_path(here);
    Draws draws = Draws(uint(texel.y + int(beyond.y)) * uint(frame_size.x + beyond.z) + uint(texel.x + int(beyond.x)), known.count, drawn);
    int most = (path.flags & FLAG_CAREFUL) != 0u ? 1 : events;
    int event = 0;
    bool done = known.count >= last_path;
    for (; event < most && !done; ++event) {
        if ((path.flags & FLAG_FOLLOWED) == 0u) {
            draws = Draws(draws.pixel, known.count, 0u);
            begin_path(path, pixel_of(texel, known.count), texel);
        }
        vec2 pixel = pixel_of(texel, known.count);
        if (!path.ends) { follow(path, pixel, texel, draws); }
        bool broken = any(isnan(path.light)) || any(isinf(path.light)) || draws.count > MOST_DRAWN;
        if (path.ends || broken) {
            if (broken) { path.light = vec3(0.0); }
            // Where nothing was left to chance, all paths are the same.
            uint count = draws.count == 0u && spread == 0 ? last_path - known.count : 1u;
            known.lost += path.lost || broken ? float(count) : 0.0;
            add_paths(known, path.light, count);
            path.flags = 0u;
            done = known.count >= last_path;
            if (done) { ended_in = pass_number; }
        }
    }
    if (event < most && !done) {
        // The driver has cut the loop short (Mesa does after 65,535 turns of all loops), at a point that nobody knows.
        known = stored_statistics(here);
        bool again = most > 1;
        path = stored_path(here);
        draws.count = drawn;
        path.flags |= FLAG_CAREFUL;
        if (!again) {
            ++known.count;
            ++known.lost;
            path.flags = 0u;
            if (known.count >= last_path) { ended_in = pass_number; }
        }
    }
    store(path, draws.count, known, ended_in);
}
