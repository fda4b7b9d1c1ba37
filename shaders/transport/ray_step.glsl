// One step of a ray in the tree of traced interfaces: from where it starts to the surface that it hits, and the interaction there.
// Adds the light of what ends, and leaves the ray of the stronger branch and that of the weaker one. Who includes it finds the
// hits and follows the rays: nothing here depends on the order, nor on the pixel but by arguments. What is absorbed and emitted
// on each segment is exact. Radiance is basic radiance, L / n^2. ROUGH: some body is rough. LIGHTS: the scene has some.
// EMISSION: media emit along rays: 1: along these; 2: or scatter, and what straight rays find is theirs at the first interface.

#include "lib/color.glsl"
#include "lib/optics.glsl"
#include "lib/ray.glsl"
const bool seen_checkerboard = CHECKERBOARD == 1;
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/environment_beyond.glsl"
#include "shade/interface_light.glsl"
#include "shade/diffused_light.glsl"
#include "shade/opaque_light.glsl"
#include "transport/hierarchy.glsl"
#include "transport/interior_list.glsl"
#include "transport/surface_hit.glsl"
#include "transport/textured_hit.glsl"
#include "transport/interaction.glsl"
#include "transport/light_passed.glsl"
#include "transport/footprint.glsl"
#include "transport/opaque_objects.glsl"

uniform int adaptive;              // 1: with the square of luminance, and opaque objects as the mean of all samples shows them

#include "transport/escaped_rays.glsl"
#include "transport/facets.glsl"

uniform int most_interfaces;
uniform int all_closed;            // 1: no solid has holes: what seems to leave through one passes an edge by rounding
uniform float faintest_throughput; // throughput, its three channels together, below which rays are not followed

const int MOST_INTERACTIONS = 1024; // in the tree of a pixel
const int MOST_FORKED = 16;         // interfaces behind a ray up to which it may fork: no more branches wait at once
const uint MOST_PASSED = 511u;     // surfaces without an effect, one after the other

struct Ray {
    vec3 origin;
    float skipped;      // metres of its segment that lie before its origin: from the surface, which it must not hit again
    vec3 direction;
    float blur;         // squared alpha of a mirror with the same blur
    vec3 throughput;    // fraction of the light at its end that reaches the eye
    uint state;         // see packed_state
    uint branch_code;   // which of its interfaces it was reflected at, a bit each
    uvec4 interior;
    vec3 outwards;      // normal of the body where it starts inside one
    Footprint footprint;
    EventsAhead ahead;
};

// The first interface of a pixel, as the rasterizer has found it.
struct PrimaryHit {
    int object;
    vec3 point;
    vec3 normal;
    float roughness;
    float transmission;
    vec3 color;
    float unoccluded;   // fraction of the light of the environment that reaches it
    uvec2 pixel;        // in all of the picture, for random numbers
};

// Branches that go on behind a step.
const int NONE = 0;
const int ONE = 1;      // the ray alone
const int BOTH = 2;     // and the weaker one

vec3 traced_radiance = vec3(0.0);
float traced_lost = 0.0;  // fraction of the light whose ray went through a hole, or is in more bodies than its list holds

// depth: interfaces behind a ray; forks: how often it may go on as the weaker branch; reflected: it sees the environment as a light;
// interactions: that it and all its branches may have. The highest bits count surfaces that it has passed since.
uint packed_state(int depth, int forks, bool reflected, int interactions) {
    return uint(depth | forks << 7 | (reflected ? 1 : 0) << 10 | interactions << 11);
}

int depth_of(Ray ray) { return int(ray.state & 127u); }
int forks_of(Ray ray) { return int(ray.state >> 7 & 7u); }
bool is_reflected(Ray ray) { return (ray.state >> 10 & 1u) != 0u; }
int interactions_of(Ray ray) { return int(ray.state >> 11 & 4095u); }

float strength(vec3 throughput) {
    return dot(throughput, vec3(1.0));
}

void lose(Ray ray) {
    traced_lost += strength(ray.throughput) / 3.0;
}

// Rays that have ended in a step, two at most, and their throughput. What light they see is looked up in one place: processors that
// draw compute every place for all rays.
int ends = 0;
EscapedRay first_end, second_end;
vec3 first_throughput, second_throughput;

void escape(Ray ray, EscapedRay end) {
    if (ends == 0) {
        first_end = end;
        first_throughput = ray.throughput;
    } else {
        second_end = end;
        second_throughput = ray.throughput;
    }
    ++ends;
}

// Takes the last of the ends.
EscapedRay take_end(out vec3 throughput) {
    bool is_second = ends == 2;
    --ends;
    throughput = is_second ? second_throughput : first_throughput;
    if (is_second) { return second_end; }
    return first_end;
}

// Adds the light at the ends of rays.
void add_ends() {
    vec3 throughput;
    while (ends > 0) {
        EscapedRay end = take_end(throughput);
        traced_radiance += throughput * escaped_radiance(end);
        if (ends == 0) { break; }
    }
}

EscapedRay escaped_ray(Ray ray, int object, vec3 normal, vec3 point) {
    return EscapedRay(object, -1, vec2(0.0), 0.0, normal, ray.origin, point, ray.direction, is_reflected(ray), ray.blur, ellipse_of(ray.footprint), ray.ahead);
}

#if OPAQUE
uniform int ground_object;   // number of the object that is the ground, or -1
uniform vec4 ground_plane;   // unit normal upwards, and metres along it from the center of the media
#endif

// Ends a ray that is not followed on: it sees the environment, or the ground before it. One that is in a body leaves it who knows
// where: it sees the environment as blurred as the roughest mirror shows it, and no image of a light that is not there.
void terminate(Ray ray) {
    EscapedRay end = escaped_ray(ray, AIR, vec3(0.0), ray.origin);
    if (ray.interior.x != 0u) { end.blur = 1.0; }
#if OPAQUE
    float falling = -dot(ground_plane.xyz, ray.direction), height = dot(ground_plane.xyz, ray.origin) - ground_plane.w;
    if (ground_object >= 0 && falling > 1e-3 && height > 0.0) {
        end.object = ground_object;
        end.blur = ray.blur;
        end.normal = ground_plane.xyz;
        end.point += height / falling * ray.direction;
    }
#endif
    escape(ray, end);
}

// Whether light that is scattered in a body leaves it as from a layer.
bool is_layer(int body) {
#if LAYERED
    return body != AIR && object_table_row(body).scatters_much > 0.5;
#else
    return false;
#endif
}

#if DIFFUSED
// Optical depth of a segment, without events ahead. Diffusion counts light that is scattered ahead as unscattered (similarity): so
// does a ray, through all interfaces behind, and sees blurred what is at its end.
vec3 depth_without_ahead(inout Ray ray, int body, vec3 ahead, vec3 optical_depth, float path) {
    vec3 depth = ahead * optical_depth;
#if AHEAD
    float before = strength(ray.ahead.depth), here = strength(depth);
    if (here > 0.0) {
        ray.ahead.path = (before * ray.ahead.path + here * 0.5 * path) / (before + here);
        ray.ahead.depth += depth;
        ray.ahead.body = body;
    }
#endif
    return optical_depth - depth;
}
#endif

// Adds what media emit and scatter towards the eye along a segment, and attenuates its ray; returns what another path
// as long would leave of light that is reflected back: where bodies scatter light ahead, all but what is absorbed.
// on_opaque: it ends on an opaque object.
vec3 through_media(inout Ray ray, int effective, Hit hit, bool on_opaque) {
    ray.ahead.path += hit.path;
    if (ray.interior.x == 0u) { return vec3(1.0); }
    if (hit.object < 0) { lose(ray); }  // it has left through a hole
    Medium medium = medium_in(ray.interior, effective);
    float path = min(hit.path + ray.skipped, 1e3 * surface_reach);
#if EMISSION == 1
    traced_radiance += ray.throughput * emitted_radiance(medium.emission, medium.extinction, path);
#endif
    vec3 passed = transmittance(medium.extinction * path), again = passed;
#if LAYERED
    if (is_layer(effective)) {
        Surface layer = surface_of(vec4(float(effective), 0.0, 1.0, 0.0));
        traced_radiance += ray.throughput * layer_exitance(layer, ray.origin, ray.outwards, path, passed);
    }
#endif
#if DIFFUSED
    if (effective != AIR) {
        float cosine = clamp(-dot(ray.direction, ray.outwards), 0.0, 1.0);
        traced_radiance += ray.throughput * subsurface_exitance(effective, ray.origin, ray.outwards, ray.direction, cosine, path, medium.extinction * path);
        if (!on_opaque) {
            vec3 far_end = ray.origin + hit.path * ray.direction;
            traced_radiance += ray.throughput * ahead_from_lights(effective, far_end, ray.outwards, ray.direction, medium.extinction * path);
        }
        ObjectRow row = object_table_row(effective);
        vec3 depth = depth_without_ahead(ray, effective, row.ahead, medium.extinction * path, path);
        passed = transmittance(depth);
        again = row.ahead == vec3(0.0) ? passed : transmittance((1.0 - row.albedo) * depth);
    }
#endif
    ray.throughput *= passed;
    return again;
}

// Lets a ray go on behind surfaces that do nothing to light.
int pass_on(inout Ray ray, vec3 point, vec3 face_normal, uvec4 interior, vec3 normal) {
    ray.origin = origin_beside(point, face_normal, ray.direction, ray.skipped);
    ray.interior = interior;
    ray.outwards = normal;
    if (ray.state >> 23 == MOST_PASSED) {
        lose(ray);
        return NONE;
    }
    ray.state += 1u << 23;
    return ONE;
}

// Before the first interface a ray is in no body; it started a little before what the rasterizer has found.
bool starts_within(Ray ray, ObjectRow body, bool outside) {
#if FROM_EYE
    return false;
#else
    return depth_of(ray) == 0 && int(body.type) == TYPE_SOLID && !outside && ray.interior.x == 0u;
#endif
}

#if TEXTURED
uniform float sample_width;  // of a sample, in pixels

// Metres of a surface that a sample sees, as if its ray had gone straight.
float width_at_hit(vec3 point, float facing) {
    float away = length(point + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz);
    return sample_width * pixel_metres(away) * inversesqrt(max(facing, 0.05));
}
#else
float width_at_hit(vec3 point, float facing) { return 0.0; }
#endif

// Whether a ray has hit the first interface of its pixel at a point. Without a ray from the eye itself it started a little before.
bool is_primary(Ray ray, Hit hit, int object, vec3 point, PrimaryHit primary) {
    if (depth_of(ray) != 0 || object != primary.object) { return false; }
#if FROM_EYE
    return distance(point, primary.point) < 1e-3 * surface_reach;
#else
    return hit.path < 2e-3 * surface_reach;
#endif
}

// Material of the first interface as the rasterizer has it.
void take_material(inout Interaction at, PrimaryHit primary) {
    at.roughness = primary.roughness;
    at.transmission = primary.transmission;
    at.color = primary.color;
}

// A clear coat: takes its part of the lobes and of what is emitted below, and reflects it as the interface below does, or adds
// what a rougher one sees. normal: of the surface; polished: the interface below is.
void add_coat(Ray ray, Interaction at, ObjectRow body, vec3 normal, bool polished, float unoccluded, inout Lobes lobes, inout vec3 emitted) {
#if CLEAR_COAT
    if (body.clearcoat == 0.0 || !(at.outside || at.thin_walled)) { return; }
    float coat = coat_reflectance(vec2(body.clearcoat, body.clearcoat_roughness), clamp(-dot(normal, at.direction), 0.0, 1.0));
    lobes = below_coat(lobes, coat);
    emitted *= 1.0 - coat;
    if (polished && body.clearcoat_roughness == 0.0) {
        lobes.reflection += coat;
    } else {
        float alpha = body.clearcoat_roughness * body.clearcoat_roughness;
        vec3 direction = kept_on_side(reflected_direction(at.direction, normal), at.face_normal);
        traced_radiance += unoccluded * coat * ray.throughput * environment_radiance(at.point, direction, true, ray.blur + alpha * alpha);
    }
#endif
}

// Radiance of the diffuse base, for the fraction of the light that comes to it.
void add_base(Ray ray, vec3 arriving, Interaction at, PrimaryHit primary) {
#if DIFFUSE_BASE
    if (at.transmission == 1.0) { return; }
    Surface surface = surface_of(vec4(float(at.object), at.roughness, at.transmission, 0.0));
    surface.color = at.color;
    surface.unoccluded = at.object == primary.object ? primary.unoccluded : 1.0;
    traced_radiance += ray.throughput * arriving * (1.0 - at.transmission) * base_radiance(surface, at.point, at.normal);
#endif
}

// Strength of what a ray sees sharp at its end.
float sharp_strength(Ray ray) {
#if AHEAD
    return strength(ray.throughput * transmittance(ray.ahead.depth));
#else
    return strength(ray.throughput);
#endif
}

// Whether nothing that a ray might hit on its way would show: outside the only object, where what it sees is blurred.
bool sees_blur_alone(Ray ray) {
#if AHEAD && ONE_OBJECT
    return ray.interior.x == 0u && sharp_strength(ray) < faintest_throughput;
#else
    return false;
#endif
}

// Whether the weaker of two branches goes on: then it has one fork less, and a part of the interactions. The mirror image at the
// first interface is free.
bool forks_on(inout Ray stronger, inout Ray weaker) {
#if FORKS > 0
    int depth = depth_of(weaker), forks = forks_of(weaker), left = interactions_of(weaker), ahead = most_interfaces - depth;
    bool is_free = depth == 1;
    // One for each interface ahead of the mirror image, which may not fork.
    int part = is_free ? min(ahead, left / 2) : left / 4;
    if (is_free && !is_reflected(weaker)) { part = left - part; }
    if (part == 0 || depth > MOST_FORKED || (forks == 0 && !is_free) || sharp_strength(weaker) <= faintest_throughput) { return false; }
    stronger.state -= uint(part) << 11;
    weaker.state = packed_state(depth, is_free ? forks : forks - 1, is_reflected(weaker), part);
    return true;
#else
    return false;
#endif
}

// Goes on with the stronger of two branches, and with the weaker one or ends it; returns which go on. again: what another
// path through the body leaves of light that is reflected back into it; total: reflection; last: of the interfaces.
int branch(inout Ray ray, out Ray weaker, Ray back, Ray on, vec3 again, bool total, bool last) {
    bool on_stronger = strength(on.throughput) >= strength(back.throughput);
    Ray arrival = ray;
    weaker = back;
    ray = on;
    if (!on_stronger) {
        weaker = on;
        ray = back;
    }
    if (!last && forks_on(ray, weaker)) { return BOTH; }
    if (strength(weaker.throughput) > 0.0) {
        if (on_stronger) { weaker.throughput *= again; }
        terminate(weaker);
    }
    if (!last && strength(ray.throughput) >= faintest_throughput && !sees_blur_alone(ray)) { return ONE; }
    // What is reflected totally is looked up as if it left straight on: reflected on, it would most often leave there, too.
    if (!on_stronger) { ray.throughput *= again; }
    if (total) {
        ray.direction = arrival.direction;
        ray.state = arrival.state;
    }
    terminate(ray);
    return NONE;
}

vec3 face_outwards = vec3(0.0);  // unit normal of the face of the last interaction, out of the body

// The interaction of a ray with an interface; returns which branches go on. again, last: as for `branch`.
int interact(inout Ray ray, out Ray weaker, Interaction at, ObjectRow body, Hit hit, SurfaceHit surface, PrimaryHit primary, float unoccluded,
    vec3 again, bool last) {
    int depth = depth_of(ray) + 1, interactions = interactions_of(ray) - 1;
    bool polished = at.roughness == 0.0;
    float alpha = at.roughness * at.roughness;
    face_outwards = at.outside ? at.face_normal : -at.face_normal;
    Facet facet = take_facet(at, alpha, primary.pixel, depth - 1, ray.branch_code);
#if ROUGH
    float bare = interface_reflectance(cosine_of(at), at.ior, at.roughness);
#else
    float bare = fresnel_dielectric(cosine_of(at), at.ior);
#endif
    vec3 emitted, refracted = refracted_at(at);
    Lobes lobes = interface_lobes(at, body, bare, emitted);
    mask_lobes(lobes, facet, at, refracted);
    add_coat(ray, at, body, facet.surface_normal, polished, unoccluded, lobes, emitted);
    traced_radiance += ray.throughput * emitted;
    add_base(ray, lobes.transmission, at, primary);
    lobes.transmission *= passing_base(at);
    float ior_inside = max(at.ior, 1.0 / at.ior);
    Ray back = ray, on = ray;
    split_footprint(ray.footprint, hit, at, back.footprint, on.footprint);
    back.direction = reflected_at(at);
    back.origin = origin_beside(at.point, at.face_normal, back.direction, back.skipped);
    back.throughput = unoccluded * ray.throughput * lobes.reflection;
    back.state = packed_state(depth, depth == 1 ? 0 : forks_of(ray), true, interactions);
    back.blur += alpha * alpha * (at.outside ? 1.0 : ior_inside * ior_inside);
    back.branch_code = ray.branch_code * 2u + 1u;
    back.outwards = -at.normal;
    on.direction = refracted;
    on.origin = origin_beside(ray.origin + surface.path * ray.direction, at.face_normal, on.direction, on.skipped);
    on.throughput = ray.throughput * lobes.transmission;
    on.state = packed_state(depth, forks_of(ray), is_reflected(ray), interactions);
    on.interior = surface.interior;
    on.blur += alpha * alpha * refracted_spread(at, refracted);
    on.branch_code = ray.branch_code * 2u;
    on.outwards = at.normal;
    return branch(ray, weaker, back, on, again, bare == 1.0, last);
}

// Empties the interior list of a ray that hits nothing: where all solids are closed, it has missed an edge by rounding.
void leave_bodies(inout Ray ray, inout int effective) {
    if (all_closed == 0) { return; }
    ray.interior = uvec4(0u);
    effective = AIR;
}

// Lets a ray end that hits nothing.
void leave(Ray ray, Hit hit) {
    int before = effective_medium(ray.interior);
    leave_bodies(ray, before);
    through_media(ray, before, hit, false);
    escape(ray, escaped_ray(ray, AIR, vec3(0.0), ray.origin));
}

// Lets a ray interact with the surface that it hits, and returns which branches go on. hit: the nearest one, or that of `first_hit`;
// where nothing is hit as far as its path, which is not NOTHING, the ray stays as it is. hits: it is known to hit something.
int follow_to_end(inout Ray ray, out Ray weaker, Hit hit, PrimaryHit primary, int channel, bool hits) {
    int before = effective_medium(ray.interior);
    bool sound = true;
    SurfaceHit surface = surface_hit(ray.origin, ray.direction, ray.interior, 0.0, hit, before, channel, sound);
    bool leaves = !hits && hit.object < 0;
    if (leaves && hit.path < NOTHING) { return ONE; }
    if (leaves) { leave_bodies(ray, before); }
    bool on_opaque = !leaves && surface.object >= 0 && int(object_table_row(surface.object).type) == TYPE_OPAQUE;
    vec3 left = through_media(ray, before, hit, on_opaque);
    if (leaves) {
        escape(ray, escaped_ray(ray, AIR, vec3(0.0), ray.origin));
        return NONE;
    }
    vec3 point = ray.origin + hit.path * ray.direction;
    advance(ray.footprint, hit.path);
    float width = width_at_hit(point, abs(dot(surface.face_normal, ray.direction)));
    ObjectRow body = body_at(surface.object, surface.triangle, surface.weights, width);
    int type = int(body.type);
    if (starts_within(ray, body, surface.outside)) { return pass_on(ray, point, surface.face_normal, ray.interior, ray.outwards); }
    if (!sound && (all_closed == 0 || is_full(ray.interior))) { lose(ray); }
    bool first = is_primary(ray, hit, surface.object, point, primary);
    vec3 normal = facing_normal(first ? primary.normal : surface.smooth_normal, ray.direction);
    traced_radiance += ray.throughput * surface.emitted;
    ray.throughput *= surface.transmittance;
    if (type == TYPE_OPAQUE && (surface.outside || body.one_sided == 0.0)) {
        // It is in an open body, and whether rightly so, what is behind the opaque object would decide.
        if (all_closed == 0 && is_in_open_body(ray.interior)) { lose(ray); }
#if DIFFUSED
        if (before != AIR && object_table_row(before).diffuses > 0.5) {
            traced_radiance += ray.throughput * inclusion_exitance(before, point, base_color(body, point));
            return NONE;
        }
#endif
        EscapedRay end = escaped_ray(ray, surface.object, normal, point);
        end.triangle = surface.triangle;
        end.weights = surface.weights;
        end.width = width;
        escape(ray, end);
        return NONE;
    }
    int after = effective_medium(surface.interior);
    if (!is_thin_wall(body) && !alters_light(before, after, channel)) {
        return pass_on(ray, ray.origin + surface.path * ray.direction, surface.face_normal, surface.interior, normal);
    }
    Interaction at = interaction_at(surface, body, point, ray.direction, normal, before, after, channel);
    // Where rays cannot read textures, all of an object is as where it is first hit.
    if (first || (TEXTURED == 0 && surface.object == primary.object)) { take_material(at, primary); }
    // Light that scatters inside leaves all the same as from a layer.
    vec3 again = surface.outside || is_layer(before) ? vec3(1.0) : left;
    bool last = depth_of(ray) + 1 >= most_interfaces || interactions_of(ray) <= 1;
    return interact(ray, weaker, at, body, hit, surface, primary, first ? primary.unoccluded : 1.0, again, last);
}

// The same with the light at the ends of rays.
int follow(inout Ray ray, out Ray weaker, Hit hit, PrimaryHit primary, int channel) {
    int goes_on = follow_to_end(ray, weaker, hit, primary, channel, false);
    add_ends();
    return goes_on;
}

// Light of the traced rays of a pixel with that of the lights in its first interface, where there is one. emitted: what media emit
// along the straight ray; variance: of normals.
vec3 with_lights(vec3 light, vec3 direction, PrimaryHit primary, vec3 emitted, float variance, bool starts_inside) {
#if LIGHTS || EMISSION == 2
    vec3 leaving = vec3(1.0);
    if (primary.object != AIR && !starts_inside) {
        Surface surface = surface_of(vec4(float(primary.object), primary.roughness, primary.transmission, variance));
#if EMISSION == 2
        float cosine = clamp(-dot(primary.normal, direction), 0.0, 1.0);
        leaving = leaving_fraction(surface.transmission * primary.color, cosine, surface.ior, surface.roughness, surface.clearcoat);
#endif
#if LIGHTS
        light += coated_highlights(primary.point, primary.normal, direction, surface, variance);
#endif
    }
#if EMISSION == 2
    if (adaptive == 0) { light += leaving * emitted; }  // else shade/no_interface.frag has added it
#endif
#endif
    return min(light, vec3(NOTHING));
}
