// Rays traced through the meshes wherever interfaces reflect and refract them: a tree of exact branches. The stronger branch is
// always followed, the weaker one FORKS times on a path (the first mirror image is free), else it is looked up in the environment;
// so are both at the last of `most_interfaces`. What is absorbed and emitted on each segment is exact. The rasterizer has found the
// first interface. adaptive: only samples of a pixel that are worth it; with the square of their
// luminance in place of the transmittance. ROUGH: some body is. Row 0 of the output is the top row. Radiance is basic radiance, L / n^2.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "lib/color.glsl"
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#include "shade/background.glsl"
#include "shade/environment_light.glsl"
#include "shade/environment_beyond.glsl"
#include "shade/interface_light.glsl"
#include "shade/diffused_light.glsl"
#include "shade/opaque_light.glsl"
#include "transport/hierarchy.glsl"
#include "transport/interior_list.glsl"
#include "transport/surface_hit.glsl"
#include "transport/interaction.glsl"
#include "transport/light_passed.glsl"
#include "transport/footprint.glsl"
#include "transport/opaque_objects.glsl"

uniform int adaptive;              // 1: with the square of luminance, and opaque objects as the mean of all samples shows them

#include "transport/escaped_rays.glsl"
#include "transport/facets.glsl"

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D entered;             // interface towards the eye: normal, axial depth
uniform sampler2D surface_parameters;  // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
uniform int most_interfaces;
uniform int all_closed;                // 1: no solid has holes: what seems to leave through one passes an edge by rounding
uniform float faintest_throughput;          // throughput, its three channels together, below which rays are not followed
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

const int MOST_STACKED = 8;
const int MOST_ESCAPED = 8;

struct Ray {
    vec3 origin;
    float skipped;      // metres of its segment that lie before its origin: from the surface, which it must not hit again
    vec3 direction;
    vec3 throughput;    // fraction of the light at its end that reaches the eye
    uvec4 interior;
    int depth;          // interfaces behind it
    int forks;          // left
    bool reflected;     // sees the environment as a light
    float blur;         // squared alpha of a mirror with the same blur
    int branch_code;    // which of its interfaces it was reflected at, a bit each
    vec3 outwards;      // normal of the body where it starts inside one
    Footprint footprint;
};

// The first interface, as the rasterizer has found it.
struct PrimaryHit {
    int object;
    vec3 point;
    vec3 normal;
    Surface surface;
};

// Rays still to follow, and rays whose ends are not known yet: a step ends two at most.
#if FORKS > 0
Ray stack[MOST_STACKED];
#else
Ray stack[1];
#endif
int stacked = 0;
EscapedRay escaped[MOST_ESCAPED];
int escapes = 0;
vec3 traced_radiance = vec3(0.0);
float traced_lost = 0.0;  // fraction of the light whose ray went through a hole, or is in more bodies than its list holds

float strength(vec3 throughput) {
    return dot(throughput, vec3(1.0));
}

void escape(EscapedRay end) {
    escaped[escapes++] = end;
}

#if OPAQUE
uniform int ground_object;   // number of the object that is the ground, or -1
uniform vec4 ground_plane;   // unit normal upwards, and metres along it from the center of the media
#endif

// Ends a ray that is not followed on: it sees the environment, or the ground before it.
void terminate(Ray ray, vec3 direction, vec3 throughput, bool reflected) {
    EscapedRay end = EscapedRay(AIR, vec3(0.0), ray.origin, ray.origin, direction, throughput, reflected, ray.blur, ellipse_of(ray.footprint));
#if OPAQUE
    float falling = -dot(ground_plane.xyz, direction), height = dot(ground_plane.xyz, ray.origin) - ground_plane.w;
    if (ground_object >= 0 && falling > 1e-3 && height > 0.0) {
        end.object = ground_object;
        end.normal = ground_plane.xyz;
        end.point += height / falling * direction;
    }
#endif
    escape(end);
}

// Whether light that is scattered in a body leaves it as from a layer.
bool is_layer(int body) {
#if LAYERED
    return body != AIR && object_table_row(body).scatters_much > 0.5;
#else
    return false;
#endif
}

// Adds what media emit and scatter towards the eye along a segment, and attenuates its ray; returns the transmittance.
vec3 through_media(inout Ray ray, int effective, Hit hit) {
    if (ray.interior.x == 0u) { return vec3(1.0); }
    if (hit.object < 0) { traced_lost += strength(ray.throughput) / 3.0; }  // it has left through a hole
    Medium medium = medium_in(ray.interior, effective);
    float path = min(hit.path + ray.skipped, 1e3 * surface_reach);
#if EMISSION
    traced_radiance += ray.throughput * emitted_radiance(medium.emission, medium.extinction, path);
#endif
    vec3 passed = transmittance(medium.extinction * path);
    if (is_layer(effective)) {
        Surface layer = surface_of(vec4(float(effective), 0.0, 1.0, 0.0));
        traced_radiance += ray.throughput * layer_exitance(layer, ray.origin, ray.outwards, path, passed);
    }
    if (effective != AIR) {
        float cosine = clamp(-dot(ray.direction, ray.outwards), 0.0, 1.0);
        traced_radiance += ray.throughput * subsurface_exitance(effective, ray.origin, cosine, medium.extinction * path);
        traced_radiance += ray.throughput * ahead_in_scattered(effective, ray.direction, medium.extinction * path);
    }
    ray.throughput *= passed;
    return passed;
}

// Lets a ray go on behind surfaces that do nothing to light.
void pass_on(inout Ray ray, vec3 point, vec3 face_normal, uvec4 interior, vec3 normal) {
    ray.origin = origin_beside(point, face_normal, ray.direction, ray.skipped);
    ray.interior = interior;
    ray.outwards = normal;
}

// Before the first interface a ray is in no body; it started a little before what the rasterizer has found.
bool starts_within(Ray ray, ObjectRow body, bool outside) {
#if FROM_EYE
    return false;
#else
    return ray.depth == 0 && int(body.type) == TYPE_SOLID && !outside && ray.interior.x == 0u;
#endif
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
    Surface surface = primary.surface;
    if (at.object != primary.object) {
        surface = surface_of(vec4(float(at.object), at.roughness, at.transmission, 0.0));
        surface.color = at.color;
    }
    traced_radiance += ray.throughput * arriving * (1.0 - at.transmission) * base_radiance(surface, at.point, at.normal);
#endif
}

// Goes on with the stronger of two branches, and stacks or ends the weaker one; returns whether the ray ends. again: what another
// path through the body leaves of light that is reflected back into it; total: reflection; last: of the interfaces.
bool branch(inout Ray ray, Ray back, Ray on, vec3 again, bool total, bool last) {
    bool on_stronger = strength(on.throughput) >= strength(back.throughput);
    vec3 arrival = ray.direction;
    bool arrived_reflected = ray.reflected;
    Ray weaker = back;
    ray = on;
    if (!on_stronger) {
        weaker = on;
        ray = back;
    }
    bool stacks = false;
#if FORKS > 0
    weaker.forks -= weaker.depth == 1 ? 0 : 1;
    stacks = weaker.forks >= 0 && !last && stacked < MOST_STACKED && strength(weaker.throughput) > faintest_throughput;
    if (stacks) { stack[stacked++] = weaker; }
#endif
    if (!stacks && strength(weaker.throughput) > 0.0) {
        terminate(weaker, weaker.direction, (on_stronger ? again : vec3(1.0)) * weaker.throughput, weaker.reflected);
    }
    if (!last && strength(ray.throughput) >= faintest_throughput) { return false; }
    // What is reflected totally is looked up as if it left straight on: reflected on, it would most often leave there, too.
    vec3 throughput = (on_stronger ? vec3(1.0) : again) * ray.throughput;
    terminate(ray, total ? arrival : ray.direction, throughput, total ? arrived_reflected : ray.reflected);
    return true;
}

// The interaction of a ray with an interface; returns whether the ray ends there. again, last: as for `branch`.
bool interact(inout Ray ray, Interaction at, ObjectRow body, Hit hit, SurfaceHit surface, PrimaryHit primary, float unoccluded, vec3 again, bool last) {
    // Textures are read where a ray first hits an object; farther on it counts as the same all over.
    if (at.object == primary.object) {
        at.roughness = primary.surface.roughness;
        at.transmission = primary.surface.transmission;
        at.color = primary.surface.color;
    }
    bool polished = at.roughness == 0.0;
    float alpha = at.roughness * at.roughness;
    Facet facet = take_facet(at, alpha, ray.depth, ray.branch_code);
    float bare = interface_reflectance(cosine_of(at), at.ior, at.roughness);
    vec3 emitted, refracted = refracted_at(at);
    Lobes lobes = interface_lobes(at, body, bare, emitted);
    mask_lobes(lobes, facet, at, refracted);
    add_coat(ray, at, body, facet.surface_normal, polished, unoccluded, lobes, emitted);
    traced_radiance += ray.throughput * emitted;
    add_base(ray, lobes.transmission, at, primary);
    lobes.transmission *= passing_base(at);
    float ior_inside = max(at.ior, 1.0 / at.ior);
    Ray back = ray, on = ray;
    back.depth = on.depth = ray.depth + 1;
    split_footprint(ray.footprint, hit, at, back.footprint, on.footprint);
    back.direction = reflected_at(at);
    back.origin = origin_beside(at.point, at.face_normal, back.direction, back.skipped);
    back.throughput = unoccluded * ray.throughput * lobes.reflection;
    back.forks = ray.depth == 0 ? 0 : ray.forks;
    back.reflected = true;
    back.blur += alpha * alpha * (at.outside ? 1.0 : ior_inside * ior_inside);
    back.branch_code = ray.branch_code * 2 + 1;
    back.outwards = -at.normal;
    on.direction = refracted;
    on.origin = origin_beside(ray.origin + surface.path * ray.direction, at.face_normal, on.direction, on.skipped);
    on.throughput = ray.throughput * lobes.transmission;
    on.interior = surface.interior;
    on.blur += alpha * alpha * 0.25 * (ior_inside - 1.0) * (ior_inside - 1.0);
    on.branch_code = ray.branch_code * 2;
    on.outwards = at.normal;
    return branch(ray, back, on, again, bare == 1.0, last);
}

// Follows a ray to the next surface, and from there on; returns whether it ends. reach: how far a surface is looked for at first.
bool follow(inout Ray ray, PrimaryHit primary, inout float reach, int channel, bool late) {
    int before = effective_medium(ray.interior);
    bool sound = true;
    Hit hit = first_hit(ray.origin, ray.direction, 0.0, reach);
    SurfaceHit surface = surface_hit(ray.origin, ray.direction, ray.interior, 0.0, hit, before, channel, sound);
    bool looks_on = hit.object < 0 && reach < NOTHING;
    reach = NOTHING;
    if (looks_on) { return false; }  // the rasterizer sees this edge a little elsewhere
    if (hit.object < 0 && all_closed == 1) {
        ray.interior = uvec4(0u);
        before = AIR;
    }
    vec3 passed = through_media(ray, before, hit);
    if (hit.object < 0) {
        escape(EscapedRay(AIR, vec3(0.0), ray.origin, ray.origin, ray.direction, ray.throughput, ray.reflected, ray.blur, ellipse_of(ray.footprint)));
        return true;
    }
    vec3 point = ray.origin + hit.path * ray.direction;
    advance(ray.footprint, hit.path);
    ObjectRow body = traced_body(surface.object);
    int type = int(body.type);
    if (starts_within(ray, body, surface.outside)) {
        ray.origin = origin_beside(point, surface.face_normal, ray.direction, ray.skipped);
        return false;
    }
    if (!sound && (all_closed == 0 || is_full(ray.interior))) { traced_lost += strength(ray.throughput) / 3.0; }
    bool first = ray.depth == 0 && surface.object == primary.object && distance(point, primary.point) < 1e-3 * surface_reach;
    vec3 normal = facing_normal(first ? primary.normal : surface.smooth_normal, ray.direction);
    traced_radiance += ray.throughput * surface.emitted;
    ray.throughput *= surface.transmittance;
    if (type == TYPE_OPAQUE && (surface.outside || body.one_sided == 0.0)) {
        // It is in an open body, and whether rightly so, what is behind the opaque object would decide.
        if (all_closed == 0 && is_in_open_body(ray.interior)) { traced_lost += strength(ray.throughput) / 3.0; }
        escape(EscapedRay(surface.object, normal, ray.origin, point, ray.direction, ray.throughput, ray.reflected, ray.blur, ellipse_of(ray.footprint)));
        return true;
    }
    int after = effective_medium(surface.interior);
    if (type != TYPE_THIN_WALL && !alters_light(before, after, channel)) {
        ray.origin = origin_beside(ray.origin + surface.path * ray.direction, surface.face_normal, ray.direction, ray.skipped);
        ray.interior = surface.interior;
        ray.outwards = normal;
        return false;
    }
    Interaction at = interaction_at(surface, body, point, ray.direction, normal, before, after, channel);
    // Light that scatters inside leaves all the same as from a layer.
    vec3 again = surface.outside || is_layer(before) ? vec3(1.0) : passed;
    bool last = ray.depth + 1 >= most_interfaces || late;
    return interact(ray, at, body, hit, surface, primary, first ? primary.surface.unoccluded : 1.0, again, last);
}

// Light of a tree of rays, and how much of it is lost.
void trace(Ray ray, PrimaryHit primary, float reach, int channel) {
    traced_radiance = vec3(0.0);
    traced_lost = 0.0;
    stacked = escapes = 0;
    bool ends = false;
    int step = 0;
    do {
        for (; step < MOST_STEPS && escapes + 2 <= MOST_ESCAPED; ++step) {
            if (ends) {
                if (stacked == 0) { break; }
                ray = stack[--stacked];
            }
            ends = follow(ray, primary, reach, channel, step > 3 * MOST_STEPS / 4);
        }
        while (escapes > 0) {
            --escapes;
            traced_radiance += escaped[escapes].throughput * escaped_radiance(escaped[escapes]);
        }
    } while (step < MOST_STEPS && !(ends && stacked == 0));
    // Not all has been followed after too many steps, or where a driver cuts long loops short: Mesa does after 65,535 iterations.
    if (!(ends && stacked == 0 && escapes == 0)) { traced_lost = 1.0; }
}

#if MIRROR
#include "transport/mirrored_ground.glsl"
#else
const int mirrored = 0;
#endif

// The first ray of a pixel, which starts a little before what the rasterizer has found, and how far it looks for that.
void begin(vec2 pixel, vec3 direction, vec4 front, vec4 parameters, vec4 tint, bool starts_inside, out Ray ray, out PrimaryHit primary, out float reach) {
    Surface surface = surface_of(parameters);
    surface.color = tint.rgb;
    surface.unoccluded = tint.a;
    primary = PrimaryHit(front.w < NOTHING ? int(parameters.x + 0.5) : AIR, point_at(pixel, front.w), front.xyz, surface);
    vec3 eye = point_at(pixel, surface_eye_axial_depth);
    float margin = min(1e-3 * surface_reach, distance(primary.point, eye));
    ray = Ray(primary.point - margin * direction, 0.0, direction, vec3(1.0), uvec4(0u), 0, FORKS, false, 0.0, 0, -direction,
        footprint_of(pixel, front.w));
    reach = margin + 1e-3 * surface_reach;
#if FROM_EYE
    // Something may lie before the first interface.
    ray.origin = point_at(pixel, 0.0);
    ray.footprint = footprint_of(pixel, starts_inside ? surface_eye_axial_depth : 0.0);
    if (starts_inside) {
        ray.skipped = 2.0 * SURFACE_OFFSET * surface_reach;
        ray.origin = eye + ray.skipped * direction;
        ray.interior = interior_at_eye(eye, direction, ray.skipped);
    }
    reach = NOTHING;
#endif
}

// Traces a ray, in each channel for itself where indices differ.
void trace_channels(Ray ray, PrimaryHit primary, float reach) {
    trace(ray, primary, reach, 1);
#if DISPERSION
    if (mirrored == 1) { return; }
    vec3 light = traced_radiance;
    float lost = traced_lost;
    trace(ray, primary, reach, 0);
    light.r = traced_radiance.r;
    lost += traced_lost;
    trace(ray, primary, reach, 2);
    light.b = traced_radiance.b;
    traced_radiance = light;
    traced_lost = (lost + traced_lost) / 3.0;
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
    out_transmittance = vec4(through, 1.0);  // alpha: fraction of the light that can be trusted
#if FROM_EYE
    bool starts_inside = start_interior.x != 0u;
#else
    const bool starts_inside = false;
#endif
    Ray ray;
    PrimaryHit primary;
    float reach = NOTHING;
    vec4 parameters = vec4(0.0);
#if MIRROR
    vec3 reflectance;
    if (mirrored == 1) {
        out_radiance = out_transmittance = vec4(0.0);
        if (front.w < NOTHING || !begin_in_mirror(pixel, texel, direction, ray, primary, reflectance)) { return; }
    } else
#endif
    if (front.w < NOTHING || starts_inside) {
        parameters = texelFetch(surface_parameters, texel, 0);
        begin(pixel, direction, front, parameters, texelFetch(surface_color, texel, 0), starts_inside, ray, primary, reach);
    } else {
        out_radiance = vec4(background(pixel, direction, texel) * through + emitted, 1.0);
        return;
    }
    trace_channels(ray, primary, reach);
    vec3 light = traced_radiance;
#if MIRROR
    if (mirrored == 1) {
        vec3 without = environment_radiance(ray.origin, ray.direction, true, ray.blur);
        out_radiance = vec4(reflectance * through * (min(light, vec3(NOTHING)) - without), 0.0);
        out_transmittance.a = -strength(reflectance) / 3.0 * min(traced_lost, 1.0);
        return;
    }
#endif
    vec3 entering = vec3(1.0);
    if (front.w < NOTHING && !starts_inside) {
        Surface surface = primary.surface;
        float cosine = clamp(-dot(front.xyz, direction), 0.0, 1.0);
        entering = vec3(1.0 - interface_reflectance(cosine, surface.ior, surface.roughness)) * surface.transmission * surface.color;
        entering *= 1.0 - coat_reflectance(surface.clearcoat, cosine);
        light += coated_highlights(primary.point, front.xyz, direction, surface, parameters.w);
    }
#if !EMISSION
    light += entering * emitted;
#endif
    out_radiance = vec4(min(light, vec3(NOTHING)), 1.0);
    out_transmittance.a = 1.0 - min(traced_lost, 1.0);
    if (adaptive == 1) {
        float level = min(luminance(out_radiance.rgb), 1e15);
        out_transmittance.rgb = vec3(level * level, 0.0, 0.0);
    }
}
