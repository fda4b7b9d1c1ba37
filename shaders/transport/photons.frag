// Photons of a light, one for each texel, followed from the light to the first opaque surface (Jensen 1996, "Global
// illumination using photon maps"). Interfaces reflect or refract them by chance as paths of light; what media absorb on the
// way is exact. Only those land that an interface has bent or mirrored: all others are straight light.

#include <constants>
#include <View>
#include <Surfaces>
#include <TracedBody>
#include "lib/interface.glsl"
#include "lib/light.glsl"
#include "lib/optics.glsl"
#include "transport/random.glsl"
#include "transport/hierarchy.glsl"
#include "transport/record.glsl"
#include "transport/place.glsl"
#include "transport/microfacets.glsl"

uniform uint first_photon;   // number of that in the first texel, among all of the aim
uniform uint last_photon;    // before which they end
uniform uint aim;            // its number: a light, and a rectangle
uniform vec2 aim_shift;      // where the sequence of starts begins
uniform vec4 light_from;     // position from the center of the media, w = 1; or direction of travel, w = 0
uniform vec4 cone;           // in which a lamp shines
uniform vec3 aim_middle;     // of the rectangle across the way that is aimed at
uniform vec3 aim_right;      // half its sides; 0: all directions from the light
uniform vec3 aim_up;
uniform vec3 photon_power;   // of a photon; times cosine over squared distance where a point light aims at a rectangle
uniform uvec4 light_record;  // the bodies that the light is in
uniform int all_closed;

layout(location = 0) out vec4 out_point;   // from the center of the media; w: 1 landed, 0 not, -1 given up
layout(location = 1) out vec4 out_power;
layout(location = 2) out vec4 out_normal;

const int MOST_MET = 96;         // surfaces on the way of a photon; after as many it is given up
const float ROULETTE = 0.05;     // share of its power below which a photon ends by Russian roulette, or goes on with this
const float EDGE_ON = 1e-3;

struct Photon {
    vec3 origin;
    float skipped;   // metres before its origin: from the surface, which it must not meet again
    vec3 direction;
    vec3 share;      // of its power that is left
    uvec4 record;
    bool bent;       // or mirrored
    bool ends;
};

// An additive recurrence (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences").
vec2 start_of(uint number) {
    vec2 share = vec2(uvec2(number * 3242174889u, number * 2447445414u) >> 8u) / 16777216.0;
    return fract(share + aim_shift);
}

// A photon at the light, or where it comes near the scene.
Photon begun(uint number, out vec3 power) {
    vec2 share = start_of(number);
    Photon photon = Photon(light_from.xyz, 0.0, light_from.xyz, vec3(1.0), light_record, false, false);
    power = photon_power;
    if (aim_right == vec3(0.0)) {
        float up = 2.0 * share.x - 1.0;
        float across = sqrt(max((1.0 - up) * (1.0 + up), 0.0));
        photon.direction = vec3(across * cos(2.0 * PI * share.y), across * sin(2.0 * PI * share.y), up);
        power *= cone_attenuation(photon.direction, cone);
        return photon;
    }
    vec3 target = aim_middle + (2.0 * share.x - 1.0) * aim_right + (2.0 * share.y - 1.0) * aim_up;
    float back = 2.0 * surface_reach;
    if (light_from.w == 1.0) {
        vec3 way = target - light_from.xyz;
        float distance_m = length(way);
        photon.direction = way / distance_m;
        power *= abs(dot(photon.direction, normalize(cross(aim_right, aim_up)))) / distance_m / distance_m;
        power *= cone_attenuation(photon.direction, cone);
        back = min(back, distance_m);
    }
    photon.origin = target - back * photon.direction;
    return photon;
}

// Goes on from a point of a surface: on the side that its direction goes to, a little off, so that it is not met again.
void leave(inout Photon photon, vec3 point, vec3 face_normal) {
    float offset = SURFACE_OFFSET * surface_reach;
    float across = dot(face_normal, photon.direction);
    photon.origin = point + (across < 0.0 ? -offset : offset) * face_normal;
    photon.skipped = offset / max(abs(across), 1e-2);
}

// A photon at an interface: one branch, chosen by its share.
void meet(inout Photon photon, Place place, TracedBody body, int before, int after, int channel, inout Draws draws) {
    bool is_sheet = int(body.kind) == KIND_SHEET;
    vec3 normal = place.smooth_normal;
    float facing = dot(normal, photon.direction);
    if (facing > -EDGE_ON) { normal = normalize(normal - (facing + EDGE_ON) * photon.direction); }
    float cosine = clamp(-dot(normal, photon.direction), 0.0, 1.0);
    float ior = index_of(is_sheet ? place.object : after, channel) / index_of(before, channel);
    vec3 point = photon.origin + place.path * photon.direction;
    float reflectance = fresnel_dielectric(cosine, ior);
    vec4 shares = random_shares(draws);
    bool passes = shares.x >= reflectance;
    vec3 way = reflected_direction(photon.direction, normal);
#if ROUGH
    float alpha = body.roughness * body.roughness;
    if (alpha > 0.0 && ior != 1.0) {
        mat3 frame = frame_around(normal);
        float seen;
        way = scattered_at_microfacets(photon.direction * frame, ior, alpha, vec3(0.0), draws, seen);
        photon.ends = way == vec3(0.0);
        passes = way.z < 0.0;
        way = frame * way;
    } else
#endif
    if (is_sheet) {
        float through = 1.0 / max(refracted_cosine(cosine, ior), MIN_THIN_LAYER_COSINE);
        vec3 depth = body.extinction * through;
        vec3 back = slab_reflectance(reflectance, depth), on = slab_transmittance(reflectance, depth);
        float chance = dot(photon.share, on + vec3(1e-30));
        chance /= chance + dot(photon.share, back);
        passes = shares.x < chance;
        way = passes ? photon.direction : way;
        photon.share *= passes ? on / chance : back / (1.0 - chance);
    } else if (passes) {
        way = refracted_direction(photon.direction, normal, ior);
    }
    if (passes) {
        photon.share *= body.transmission * (is_sheet || place.object == after ? body.color : vec3(1.0));
        photon.record = place.record;
    }
    photon.bent = photon.bent || !passes || (!is_sheet && ior != 1.0);
    photon.direction = kept_on_side(normalize(way), passes ? -place.face_normal : place.face_normal);
    leave(photon, point, place.face_normal);
    float most = max(photon.share.r, max(photon.share.g, photon.share.b));
    float lives = min(most / ROULETTE, 1.0);
    photon.ends = photon.ends || shares.z >= lives;
    photon.share /= max(lives, 1e-30);
}

void main() {
    read_bodies();
    ivec2 here = ivec2(gl_FragCoord.xy);
    uint number = first_photon + uint(here.y) * PHOTON_WIDTH + uint(here.x);
    out_point = vec4(0.0);
    out_power = vec4(0.0);
    out_normal = vec4(0.0);
    if (number >= last_photon) { return; }
    vec3 power;
    Photon photon = begun(number, power);
    if (power == vec3(0.0)) { return; }
#if DISPERSION
    int channel = int(number % 3u);
    power *= 3.0 * vec3(channel == 0, channel == 1, channel == 2);
#else
    const int channel = 1;
#endif
    Draws draws = Draws(number, aim, 0u);
    int surface = 0;
    for (; surface < MOST_MET; ++surface) {
        Hit hit = nearest_hit(photon.origin, photon.direction, 0.0, NOTHING, uvec4(0u));
        if (hit.object < 0) { return; }
        int before = dominant_body(photon.record);
        photon.share *= transmittance(filling_of(photon.record, before).extinction * (hit.path + photon.skipped));
        bool sound = true;
        Place place = place_at(photon.origin, photon.direction, photon.record, 0.0, hit, before, channel, sound);
        if (!sound && (all_closed == 0 || is_full(place.record))) { return; }
        TracedBody body = traced_body(place.object);
        photon.share *= place.coat;
        if (photon.share == vec3(0.0)) { return; }
        if (int(body.kind) == KIND_OPAQUE && (place.outside || body.one_sided == 0.0)) {
            if (!photon.bent) { return; }
            out_point = vec4(photon.origin + hit.path * photon.direction, 1.0);
            out_power = vec4(power * photon.share, 1.0);
            out_normal = vec4(place.face_normal, 0.0);
            return;
        }
        int after = dominant_body(place.record);
        if (int(body.kind) != KIND_SHEET && !alters_light(before, after, channel)) {
            leave(photon, photon.origin + place.path * photon.direction, place.face_normal);
            photon.record = place.record;
            continue;
        }
        meet(photon, place, body, before, after, channel, draws);
        if (photon.ends) { return; }
    }
    // Or a driver has cut the loop short: Mesa does after 65,535 turns of all loops.
    out_point.w = -1.0;
}
