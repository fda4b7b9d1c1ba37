// The step of a photon of a light to the next surface (Jensen 1996, "Global illumination using photon maps"). Interfaces reflect or
// refract it, a part of the photons each; what media absorb on the path is exact. It lands on the first opaque surface, if an
// interface has refracted or reflected it: all others are straight light. Needs <constants>, <View>, <Surfaces> and <ObjectRow>.

#include "lib/light.glsl"
#include "lib/optics.glsl"
#include "shade/interface_bsdf.glsl"
#include "transport/random.glsl"
#include "transport/hierarchy.glsl"
#include "transport/interior_list.glsl"
#include "transport/surface_hit.glsl"
#include "transport/textured_hit.glsl"
#include "transport/interaction.glsl"
#include "transport/microfacets.glsl"
#include "transport/sampled_branch.glsl"

uniform uint aim;            // its number: a light, and a rectangle
uniform uint round_begin;    // number of the first photon of this aim in one picture,
uniform float round_photons; // and how many these are
uniform vec4 aim_shift;      // where the sequence of starts begins
uniform vec4 light_from;     // position from the center of the media, w = 1; or direction of travel, w = 0
uniform vec4 cone;           // in which a light shines
uniform float light_radius;  // of the sphere that it is; 0 for a light without size
uniform vec3 aim_middle;     // of the rectangle that is aimed at
uniform vec3 aim_right;      // half its sides; 0: all directions from the light
uniform vec3 aim_up;
uniform vec3 photon_power;   // of a photon; times cosine over squared distance where a point light aims at a rectangle
uniform uvec4 light_interior;  // the bodies that the light is in
uniform int all_closed;

const float ROULETTE = 0.05;     // throughput below which a photon ends by Russian roulette, or goes on with this

struct Photon {
    vec3 origin;
    float skipped;     // metres before its origin: from the surface, which it must not hit again
    vec3 direction;
    vec3 throughput;   // fraction of its power that is left
    float choice;      // number from 0 to 1 by which it takes the next branch
    uvec4 interior;
    bool bent;         // refracted or reflected
    bool ends;
};

// Additive recurrences: where a photon is aimed at (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"), and
// where on the disc of a light it begins, by the best of 1500 random pairs of steps: means of smooth functions of all four numbers
// converge twice as fast as by roots of 2 and 3. Photons whose numbers differ by as much start as far apart in both.
vec4 start_of(uint number) {
    uvec4 word = number * uvec4(3242174889u, 2447445414u, 1188417451u, 3613785483u);
    return fract(vec4(word >> 8u) / 16777216.0 + aim_shift);
}

// Point of the disc that a sphere of radius 1 looks like from a direction, by two numbers from 0 to 1.
vec3 disc_point(vec3 direction, vec2 numbers) {
    vec3 right = normalize(cross(direction, aim_up)), up = cross(right, direction);
    float angle = 2.0 * PI * numbers.y;
    return sqrt(numbers.x) * (cos(angle) * right + sin(angle) * up);
}

// Number from 0 to 1 that rises with the numbers of a picture's photons. Photons that take the same branches have numbers one after
// the other, and so starts as even as those of all. If chance chose, light through a pane would have holes where its faces reflect
// photons.
float choice_of(uint number) {
    return min((float(number - round_begin) + 0.5) / round_photons, ALMOST_ONE);
}

// Number of the photon's channel of light, whose indices of refraction count.
int channel_of(uint number) {
#if DISPERSION
    return int(number % 3u);
#else
    return 1;
#endif
}

// A photon at the light, or where it comes near the scene; its power is that of its channel alone where indices differ.
Photon begun(uint number, inout Draws draws, out vec3 power) {
    vec4 start = start_of(number);
    vec3 light_at = light_from.xyz;
    Photon photon = Photon(light_at, 0.0, light_from.xyz, vec3(1.0), choice_of(number), light_interior, false, false);
    power = photon_power;
#if DISPERSION
    power *= 3.0 * vec3(equal(ivec3(channel_of(number)), ivec3(0, 1, 2)));
#endif
    if (aim_right == vec3(0.0)) {
        if (light_radius > 0.0) { photon.origin += light_radius * sphere_point(random_numbers(draws).xyz); }
        float up = 2.0 * start.x - 1.0;
        float across = sqrt(max((1.0 - up) * (1.0 + up), 0.0));
        photon.direction = vec3(across * cos(2.0 * PI * start.y), across * sin(2.0 * PI * start.y), up);
        power *= cone_attenuation(photon.direction, cone);
        return photon;
    }
    vec3 target = aim_middle + (2.0 * start.x - 1.0) * aim_right + (2.0 * start.y - 1.0) * aim_up;
    float back = 2.0 * surface_reach;
    if (light_from.w == 1.0) {
        if (light_radius > 0.0) { light_at += light_radius * disc_point(normalize(target - light_at), start.zw); }
        vec3 to_target = target - light_at;
        float distance_m = length(to_target);
        photon.direction = to_target / distance_m;
        power *= abs(dot(photon.direction, normalize(cross(aim_right, aim_up)))) / distance_m / distance_m;
        power *= cone_attenuation(photon.direction, cone);
        back = min(back, distance_m);
    }
    photon.origin = target - back * photon.direction;
    return photon;
}

// The interaction of a photon with an interface: one branch.
void interact(inout Photon photon, SurfaceHit surface, ObjectRow body, int before, int after, int channel, inout Draws draws) {
    vec3 normal = facing_normal(surface.smooth_normal, photon.direction);
    vec3 point = photon.origin + surface.path * photon.direction;
    Interaction at = interaction_at(surface, body, point, photon.direction, normal, before, after, channel);
    vec4 numbers = random_numbers(draws);
    vec3 emitted;
    vec3 light_density;
    Branch next = sampled_branch(at, body, polished_lobes(at, body, emitted), photon.throughput, photon.choice, vec3(0.0), draws, light_density);
    photon.throughput *= next.weight;
    if (next.transmitted) { photon.interior = surface.interior; }
    photon.bent = photon.bent || !next.transmitted || (!at.thin_walled && at.ior != 1.0);
    photon.direction = next.direction;
    photon.origin = origin_beside(at.point, at.face_normal, photon.direction, photon.skipped);
    float most = max(photon.throughput.r, max(photon.throughput.g, photon.throughput.b));
    float lives = min(most / ROULETTE, 1.0);
    photon.ends = next.lost || numbers.z >= lives;
    photon.throughput /= max(lives, 1e-30);
}

// Where a photon lands.
struct Landing {
    vec3 point;   // from the center of the media
    vec3 normal;  // of the face, to the side on which it lies
    bool there;
};

// Follows a photon to the nearest surface, `hit`, and from there on; false where it ends there. landing: on what is opaque.
bool follow(inout Photon photon, Hit hit, int channel, inout Draws draws, inout Landing landing) {
    int before = effective_medium(photon.interior);
    photon.throughput *= transmittance(medium_in(photon.interior, before).extinction * (hit.path + photon.skipped));
    bool sound = true;
    SurfaceHit surface = surface_hit(photon.origin, photon.direction, photon.interior, 0.0, hit, before, channel, sound);
    if (!sound && (all_closed == 0 || is_full(surface.interior))) { return false; }
    ObjectRow body = body_at(surface.object, surface.triangle, surface.weights, 0.0);
    photon.throughput *= surface.transmittance;
    if (photon.throughput == vec3(0.0)) { return false; }
    if (int(body.type) == TYPE_OPAQUE && (surface.outside || body.one_sided == 0.0)) {
        if (photon.bent) { landing = Landing(photon.origin + hit.path * photon.direction, surface.face_normal, true); }
        return false;
    }
    int after = effective_medium(surface.interior);
    if (!is_thin_wall(body) && !alters_light(before, after, channel)) {
        vec3 point = photon.origin + surface.path * photon.direction;
        photon.origin = origin_beside(point, surface.face_normal, photon.direction, photon.skipped);
        photon.interior = surface.interior;
    } else {
        interact(photon, surface, body, before, after, channel, draws);
    }
    return !photon.ends;
}
