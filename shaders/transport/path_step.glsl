// The step of a random path of light through media and interfaces: from where it starts to the next event or surface. The
// estimator is that of translucent/reference/path_trace.py, but for what follows here. The channels of light take one path
// together: how far they fly is drawn for one of them, chosen by what it carries, and weighted with the balance heuristic
// over all (Veach & Guibas 1995; Wilkie et al. 2014), so that together they never carry more than before. What media absorb
// and emit on a segment is exact. Needs <constants>, <View>, <Environment>, <Surfaces> and <ObjectRow>. PICTURED: opaque objects
// whose textures rays do not read are taken from their picture where paths hit them first. BASES: interfaces have diffuse bases.

#include "lib/optics.glsl"
#include "lib/phase.glsl"
#include "lib/ray.glsl"
#include "shade/lights.glsl"
const bool seen_checkerboard = CHECKERBOARD == 1;
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/environment_beyond.glsl"
#include "shade/interface_bsdf.glsl"
#include "shade/opaque_light.glsl"
#include "transport/path_state.glsl"
#include "transport/random.glsl"
#include "transport/hierarchy.glsl"
#include "transport/interior_list.glsl"
#include "transport/surface_hit.glsl"
#include "transport/textured_hit.glsl"
#include "transport/interaction.glsl"
#include "transport/microfacets.glsl"
#include "transport/sampled_branch.glsl"
#include "transport/straight_light.glsl"
#include "transport/light_passed.glsl"

uniform ivec2 tile_origin;   // of the texels in the picture, from its top left corner
uniform uint last_path;      // how many paths of each pixel are to end
uniform int spread;          // 1: paths start all over their pixels, and not at one place in them
uniform int all_closed;      // 1: no solid has holes: what seems to leave through one passes an edge by rounding
uniform float path_start;    // axial depth at which paths begin: before all objects

const int CHANNEL = 1;             // whose indices of refraction count
const float ROULETTE = 0.1;       // throughput below which paths end by Russian roulette, or go on with this
const int MANY_INTERFACES = 256;  // after which they end so whatever they carry: total reflection may hold light for ever
const float GOES_ON = 0.95;
const uint MOST_DRAWN = 1u << 22;

// Place in the picture at which a path starts: an additive recurrence (Roberts 2018, "The unreasonable effectiveness of
// quasirandom sequences").
vec2 pixel_of(ivec2 texel, uint path) {
    vec2 offset = vec2(uvec2(path * 3242174889u, path * 2447445414u) >> 8u) / 16777216.0;
    return vec2(texel) + (spread == 1 ? fract(offset + 0.5) : 0.5 + frame_size.zw);
}

float largest_of(vec3 channels) {
    return max(channels.r, max(channels.g, channels.b));
}

// Number of a channel, chosen by what each carries.
int chosen_channel(vec3 weights, float number) {
    float at = number * (weights.r + weights.g + weights.b);
    return at < weights.r ? 0 : at < weights.r + weights.g || weights.b == 0.0 ? (weights.g > 0.0 ? 1 : 0) : 2;
}

vec3 environment_radiance(Path path, vec2 pixel) {
#if SEEN_LIGHTS
    return mirrored_environment(path.direction);
#else
    if ((path.flags & FLAG_REFLECTED) != 0u) { return mirrored_environment(path.direction); }
    if ((path.flags & FLAG_BENT) == 0u) { return background_radiance(in_heights(pixel), path.direction); }
    return environment_beyond(path.origin, path.direction, 0.0);
#endif
}

#if BASES
// Irradiance on a diffuse base, as far as lights reach it.
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
#endif

#include "transport/opaque_objects.glsl"
#include "transport/sampled_opaque.glsl"

// A ray towards one of the lights: nothing is known yet of what is on it. weight: light at its end times the throughput.
struct LightRay {
    vec3 origin;
    float skipped;   // metres between the place that is lit and the origin
    uvec4 interior;
    vec3 towards;
    float distance_m;
    vec3 weight;
};

// Fraction of the light of each channel that the media of a place turn by an angle, in 1/sr.
vec3 phase_of(uvec4 interior, int effective, vec3 scattering, float cosine) {
#if ONE_OBJECT || PRIORITY
    return vec3(phase_value(traced_body(effective).phase, cosine));
#else
    vec3 sum = vec3(0.0);
    for (int i = 0; i < INTERIOR_SIZE; ++i) {
        uint entry = interior_entry(interior, i);
        if (entry == 0u) { break; }
        if (!fills(interior, i)) { continue; }
        ObjectRow body = traced_body(int(entry) - 1);
        sum += body.scattering * phase_value(body.phase, cosine);
    }
    return sum / max(scattering, vec3(1e-30));
#endif
}

// Phase function of one of the media of a place, chosen by what it scatters of the light.
vec4 chosen_phase(uvec4 interior, int effective, vec3 scattering, vec3 carried, float number) {
#if ONE_OBJECT || PRIORITY
    return traced_body(effective).phase;
#else
    vec3 each = carried / max(scattering, vec3(1e-30));
    float left = number * dot(each, scattering);
    vec4 phase = vec4(0.0);
    for (int i = 0; i < INTERIOR_SIZE; ++i) {
        uint entry = interior_entry(interior, i);
        if (entry == 0u) { break; }
        if (!fills(interior, i)) { continue; }
        ObjectRow body = traced_body(int(entry) - 1);
        float own = dot(each, body.scattering);
        if (own > 0.0) { phase = body.phase; }
        left -= own;
        if (left < 0.0) { break; }
    }
    return phase;
#endif
}

// Ends paths that carry little, or lets them carry more in place of the ended ones (Arvo & Kirk 1990).
void play_roulette(inout Path path, float number) {
    float chance = min(largest_of(path.throughput) / ROULETTE, 1.0);
    if (path.depth > MANY_INTERFACES) { chance = min(chance, GOES_ON); }
    path.ends = number >= chance;
    path.throughput /= max(chance, 1e-30);
}

void begin_path(inout Path path, vec2 pixel, ivec2 texel) {
    vec3 direction = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    path = Path(point_at(pixel, path_start), 0.0, direction, vec3(1.0), vec3(0.0), uvec4(0u),
        FLAG_FOLLOWED, 0, false, false);
#if FROM_EYE
    if (start_interior.x != 0u) {
        vec3 eye = point_at(pixel, surface_eye_axial_depth);
        path.skipped = 2.0 * SURFACE_OFFSET * surface_reach;
        path.origin = eye + path.skipped * direction;
        path.interior = interior_at_eye(eye, direction, path.skipped);
    }
#endif
}

// Light of one of them that arrives from somewhere in its sphere.
LightSample light_drawn(int number, vec3 point, inout Draws draws) {
    Light light = light_row(number);
    if (light.disc.w > 0.0) {
        light.position.xyz += light.disc.xyz + light.disc.w * sphere_point(random_numbers(draws).xyz);
    }
    return light_sample(light, point);
}

// Turns a path where media scatter it, and finds a ray to one of the lights there.
void scatter(inout Path path, Medium medium, int effective, inout Draws draws, inout LightRay lit) {
    path.flags = (path.flags | FLAG_BENT | FLAG_REFLECTED) & ~FLAG_SEES_LIGHTS;
    path.skipped = 0.0;
    vec4 numbers = random_numbers(draws);
#if LIGHTS
    int light = min(int(numbers.x * float(light_count)), light_count - 1);
    numbers.x = fract(numbers.x * float(light_count));
    LightSample arriving = light_drawn(light, path.origin, draws);
    vec3 phase = phase_of(path.interior, effective, medium.scattering, dot(arriving.towards, path.direction));
    vec3 weight = path.throughput * phase * arriving.irradiance * float(light_count);
    lit = LightRay(path.origin, 0.0, path.interior, arriving.towards, arriving.distance_m, weight);
#endif
    vec4 phase_function = chosen_phase(path.interior, effective, medium.scattering, path.throughput, numbers.x);
    vec3 before = path.direction;
    path.direction = turned_by(before, phase_cosine(phase_function, numbers.y), numbers.z);
#if !(ONE_OBJECT || PRIORITY)
    vec3 turned = phase_of(path.interior, effective, medium.scattering, dot(before, path.direction));
    float density = dot(path.throughput, turned) / max(dot(path.throughput, vec3(1.0)), 1e-30);
    path.throughput *= turned / max(density, 1e-30);
#endif
    play_roulette(path, numbers.w);
}

// The ray to one of the lights whose light the microfacets of a rough interface scatter into the path. light_density: of
// scattering, in 1/sr.
void light_at_facets(Path path, Interaction at, SurfaceHit surface, LightSample arriving, vec3 light_density, inout LightRay lit) {
#if LIGHTS
    // Light that comes from the other side of the face than of the smooth surface does not exist.
    float side = dot(arriving.towards, at.normal) < 0.0 ? -1.0 : 1.0;
    float across = dot(arriving.towards, at.face_normal);
    if (light_density == vec3(0.0) || side * across <= 0.0) { return; }
    float skipped;
    vec3 origin = origin_beside(at.point, at.face_normal, arriving.towards, skipped);
    vec3 passing = side > 0.0 ? vec3(1.0) : passing_base(at);
    vec3 weight = path.throughput * passing * arriving.irradiance * light_density * float(light_count);
    lit = LightRay(origin, skipped, side > 0.0 ? path.interior : surface.interior, arriving.towards, arriving.distance_m - skipped, weight);
#endif
}

// Adds the radiance of the diffuse base, for the fraction of the light that comes to it: whatever the path does next.
void add_base(inout Path path, Interaction at, ObjectRow body, vec3 arriving) {
#if BASES
    if (at.transmission == 1.0 || arriving == vec3(0.0)) { return; }
    vec3 base = diffuse_radiance(unblocked_irradiance(at.point, at.normal), unblocked_irradiance(at.point, -at.normal), at.color,
        body.passed, body.passed_share);
    path.light += path.throughput * arriving * (1.0 - at.transmission) * base;
#endif
}

// The interaction of a path with an interface: one branch, by chance.
void interact(inout Path path, SurfaceHit surface, ObjectRow body, int before, int after, inout Draws draws, inout LightRay lit) {
    vec3 normal = facing_normal(surface.smooth_normal, path.direction);
    vec3 point = path.origin + surface.path * path.direction;
    Interaction at = interaction_at(surface, body, point, path.direction, normal, before, after, CHANNEL);
    vec4 numbers = random_numbers(draws);
    path.flags |= FLAG_BENT;
    ++path.depth;
    vec3 emitted;
    Lobes lobes = polished_lobes(at, body, emitted);
    path.light += path.throughput * emitted;
    LightSample arriving = LightSample(vec3(0.0), 0.0, vec3(0.0), vec4(0.0));
#if LIGHTS
    if (is_rough(at)) { arriving = light_drawn(min(int(numbers.y * float(light_count)), light_count - 1), at.point, draws); }
#endif
    vec3 light_density;
    Branch next = sampled_branch(at, body, lobes, path.throughput, numbers.x, arriving.towards, draws, light_density);
    light_at_facets(path, at, surface, arriving, light_density, lit);
    if (!next.polished) {
        path.flags &= ~FLAG_SEES_LIGHTS;
    } else if (at.ior != 1.0) {
        path.flags |= FLAG_SEES_LIGHTS;
    }
    add_base(path, at, body, next.on_base);
    path.throughput *= next.weight;
    if (next.transmitted) {
        path.interior = surface.interior;
    } else {
        path.flags |= FLAG_REFLECTED;
    }
    path.lost = path.lost || next.lost;
    path.direction = next.direction;
    path.origin = origin_beside(at.point, at.face_normal, path.direction, path.skipped);
    play_roulette(path, numbers.z);
    path.ends = path.ends || path.lost;
}

// Attenuates a path up to where media scatter it (it collides), or to a surface, by what is not left to chance. channel: that the
// length was drawn for.
void attenuate(inout Path path, Medium medium, bool collides, float length_m, int channel) {
#if SCATTER
    if (largest_of(medium.scattering) > 0.0) {
        // Relative to the channel that was drawn for: the others may differ by more than float32 holds.
        vec3 relative = exp(-(medium.scattering - medium.scattering[channel]) * length_m);
        vec3 found = collides ? medium.scattering * relative : relative;
        float density = dot(path.throughput, found) / dot(path.throughput, vec3(1.0));
        path.throughput *= transmittance(max(medium.extinction - medium.scattering, vec3(0.0)) * length_m) * found / density;
        return;
    }
#endif
    path.throughput *= transmittance(medium.extinction * length_m);
}

// How far a path flies before media scatter it, and the channel that this is drawn for; NOTHING where they do not.
float drawn_flight(Path path, Medium medium, inout Draws draws, out int channel) {
    channel = 1;
#if SCATTER
    if (largest_of(medium.scattering) > 0.0) {
        vec4 numbers = random_numbers(draws);
        channel = chosen_channel(path.throughput, numbers.x);
        float along = medium.scattering[channel];
        return along > 0.0 ? min(-log(numbers.y) / along, NOTHING) : NOTHING;
    }
#endif
    return NOTHING;
}

// The interaction of a path with an opaque object: one lobe of its bsdf, by chance; and a ray to one of the lights.
void interact_opaque(inout Path path, SurfaceHit surface, ObjectRow body, vec3 point, inout Draws draws, inout LightRay lit) {
    vec3 normal = body.plain == 1.0 ? surface.face_normal : facing_normal(surface.smooth_normal, path.direction);
    float cos_view = clamp(-dot(normal, path.direction), 1e-3, 1.0);
    OpaqueSurface opaque = opaque_surface(body, normal, point);
    OpaqueBsdf bsdf = opaque_bsdf(opaque, cos_view);
    vec4 numbers = random_numbers(draws);
    path.flags = (path.flags | FLAG_BENT | FLAG_REFLECTED) & ~FLAG_SEES_LIGHTS;
    ++path.depth;
    path.light += path.throughput * (1.0 - bsdf.coated) * opaque.emitted;
#if LIGHTS
    LightSample arriving = light_drawn(min(int(numbers.x * float(light_count)), light_count - 1), point, draws);
    numbers.x = fract(numbers.x * float(light_count));
    arriving.disc = vec4(0.0);  // it comes from one point of it
    float cos_light = dot(normal, arriving.towards);
    if (cos_light * dot(surface.face_normal, arriving.towards) > 0.0) {
        vec3 value = cos_light > 0.0 ? opaque_value(bsdf, normal, path.direction, arriving, cos_view, cos_light)
            : (1.0 - bsdf.coated) * bsdf.passed / PI * -cos_light;
        float skipped;
        vec3 origin = origin_beside(point, surface.face_normal, arriving.towards, skipped);
        vec3 weight = path.throughput * value * arriving.irradiance * float(light_count);
        lit = LightRay(origin, skipped, path.interior, arriving.towards, arriving.distance_m - skipped, weight);
    }
#endif
    bool transmitted;
    path.throughput *= sampled_opaque(bsdf, normal, path.throughput, numbers.xyz, path.direction, transmitted);
    path.direction = kept_on_side(path.direction, transmitted ? -surface.face_normal : surface.face_normal);
    path.origin = origin_beside(point, surface.face_normal, path.direction, path.skipped);
    play_roulette(path, numbers.w);
}

// Radiance of lights with a size that a path hits before a distance, where no ray to them has been drawn. flight: in metres, drawn
// for a channel, to where media scatter it.
vec3 lights_hit(Path path, Medium medium, float end, int channel) {
    vec3 sum = vec3(0.0);
#if LIGHTS && SPHERES
    if ((path.flags & FLAG_SEES_LIGHTS) == 0u) { return sum; }
    for (int i = 0; i < light_count; ++i) {
        Light light = light_row(i);
        vec3 middle = light.position.xyz + light.disc.xyz - path.origin;
        float along = dot(middle, path.direction), radius = light.disc.w;
        vec3 aside = middle - along * path.direction;
        float within = radius * radius - dot(aside, aside);
        float distance_m = along - sqrt(max(within, 0.0)) + path.skipped;
        if (within <= 0.0 || distance_m <= 0.0 || distance_m >= end) { continue; }
        Path there = path;
        attenuate(there, medium, false, distance_m, channel);
        sum += there.throughput * light.power / (PI * radius * radius);
    }
#endif
    return sum;
}

// Follows a path to its next event or surface, where a ray to one of the lights may begin.
void follow_to_event(inout Path path, Hit hit, vec2 pixel, ivec2 texel, inout Draws draws, inout LightRay lit) {
    int before = effective_medium(path.interior);
    Medium medium = medium_in(path.interior, before);
    int channel;
    float flight = drawn_flight(path, medium, draws, channel);
    // A little farther than it flies: events beside a surface are kept off it, or rounding might put them behind.
    float margin = 2.0 * SURFACE_OFFSET * surface_reach;
    float end = flight < NOTHING ? max(flight - path.skipped, 0.0) + margin : NOTHING;
#if EMISSION
    if (largest_of(medium.emission) > 0.0) { end = NOTHING; }
#endif
#if GIVEN_HITS
    if (hit.path >= end) { hit = Hit(end, -1, -1, vec2(0.0)); }
#else
    hit = nearest_hit(path.origin, path.direction, 0.0, end, uvec4(0u));
#endif
    bool hits = hit.object >= 0;
    float farthest = 1e3 * surface_reach;
    float surface_path = hits ? hit.path + path.skipped : max(flight, farthest);
    bool collides = flight < surface_path;
    vec3 event = path.origin + max(min(flight - path.skipped, hits ? hit.path - margin : NOTHING), 0.0) * path.direction;
    bool astray = path.interior.x != 0u && !hits && (!collides || length(event) > surface_reach);
    path.light += lights_hit(path, medium, min(flight, hits ? surface_path : NOTHING), channel);
    if (astray && all_closed == 1) {
        path.interior = uvec4(0u);
    } else {
        path.lost = astray;
#if EMISSION
        path.light += path.throughput * emitted_radiance(medium.emission, medium.extinction, min(surface_path, farthest));
#endif
        attenuate(path, medium, collides, collides ? flight : min(surface_path, farthest), channel);
        if (path.lost) {
            path.ends = true;
            return;
        }
        if (collides) {
            path.origin = event;
            scatter(path, medium, before, draws, lit);
            return;
        }
    }
    if (!hits) {
        path.light += path.throughput * environment_radiance(path, pixel);
        path.ends = true;
        return;
    }
    bool sound = true;
    SurfaceHit surface = surface_hit(path.origin, path.direction, path.interior, 0.0, hit, before, CHANNEL, sound);
    ObjectRow body = body_at(surface.object, surface.triangle, surface.weights, 0.0);
    path.lost = !sound && (all_closed == 0 || is_full(path.interior));
    path.light += path.throughput * surface.emitted;
    path.throughput *= surface.transmittance;
    if (int(body.type) == TYPE_OPAQUE && (surface.outside || body.one_sided == 0.0)) {
#if PICTURED
        if ((path.flags & FLAG_BENT) == 0u && !reads_all_textures(surface.object)) {
            path.light += path.throughput * background(pixel, path.direction, stored(texel));
            path.ends = true;
            return;
        }
#endif
        interact_opaque(path, surface, body, path.origin + hit.path * path.direction, draws, lit);
        path.ends = path.ends || path.lost;
        return;
    }
    int after = effective_medium(surface.interior);
    if (!is_thin_wall(body) && !alters_light(before, after, CHANNEL)) {
        path.origin = origin_beside(path.origin + surface.path * path.direction, surface.face_normal, path.direction, path.skipped);
        path.interior = surface.interior;
    } else {
        interact(path, surface, body, before, after, draws, lit);
    }
    path.ends = path.ends || path.lost || path.throughput == vec3(0.0);
}

// Follows a path to its next event or surface, and adds the light of one of the lights there. GIVEN_HITS: `hit` is the nearest
// surface; else it is looked for.
void follow(inout Path path, Hit hit, vec2 pixel, ivec2 texel, inout Draws draws) {
    LightRay lit = LightRay(vec3(0.0), 0.0, uvec4(0u), vec3(0.0), 0.0, vec3(0.0));
    follow_to_event(path, hit, pixel, texel, draws, lit);
#if LIGHTS
    if (lit.weight != vec3(0.0)) {
        path.light += lit.weight * straight_transmittance(lit.origin, lit.skipped, lit.interior, lit.towards, lit.distance_m, CHANNEL);
    }
#endif
}
