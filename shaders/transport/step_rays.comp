// One step of each live ray of a generation: its light, and up to two branches that go on, at places of their own. So nothing depends
// on the order in which invocations run. The CPU has found what rays hit. MISSES: of the rays that hit nothing. Light of opaque
// objects at their ends is left to shade_ends.comp.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/stored_rays.glsl"
#if OPAQUE
#include "transport/stored_ends.glsl"

layout(std430, binding = END_COUNTS_BINDING) writeonly buffer EndCounts { uint end_counts[]; };
#endif

layout(std430, binding = LIVE_RAYS_BINDING) readonly buffer LiveRays { int live_rays[]; };   // rows: numbers, hits first; by number: place, pixel; path, object, triangle, weights of the hit
layout(std430, binding = RAY_LIGHT_BINDING) writeonly buffer RayLight { vec4 ray_light[]; };  // and fraction that is lost

#if ONE_OBJECT && !MISSES
layout(std430, binding = HORIZONS_BINDING) readonly buffer Horizons { float horizons[]; };  // see horizons.comp
uniform int has_horizons;  // 1: they are found, and those of the mesh are those of the body

// Whether a ray that leaves a triangle hits nothing for certain.
bool escapes(Ray ray, float horizon) {
    return ray.interior.x == 0u && dot(ray.direction, face_outwards) > horizon;
}
#endif

uniform int first_number, live_count;
uniform int live_rows;     // their length

void main() {
    int at = first_number + int(gl_GlobalInvocationID.x);
    if (at >= live_count) { return; }
    read_bodies();
    int number = live_rays[at];
    Ray ray = stored_ray(live_rays[live_rows + number]);
    uint word = uint(live_rays[2 * live_rows + number]);
    int channel = channel_of(word);
#if MISSES
    leave(ray, Hit(NOTHING, -1, -1, vec2(0.0)));
    traced_radiance += first_throughput * radiance_beyond(first_end);
#else
    Hit hit = Hit(intBitsToFloat(live_rays[3 * live_rows + number]), live_rays[4 * live_rows + number], live_rays[5 * live_rows + number],
        intBitsToFloat(ivec2(live_rays[6 * live_rows + number], live_rays[7 * live_rows + number])));
    PrimaryHit primary = PrimaryHit(AIR, vec3(0.0), vec3(0.0), 0.0, 0.0, vec3(0.0), 0.0, uvec2(0u));
    primary.pixel = pixel_number(pixel_of(word));
    if (depth_of(ray) == 0) {
        vec4 front;
        float variance;
        primary = primary_hit(pixel_at(pixel_of(word)), front, variance);
    }
    Ray weaker;
    int goes_on = follow_to_end(ray, weaker, hit, primary, channel, true), stored = 0;
#if ONE_OBJECT
    float horizon = has_horizons == 1 ? horizons[hit.triangle] : 1.0;
    if (goes_on == BOTH && escapes(weaker, horizon)) {
        terminate(weaker);
        goes_on = ONE;
    }
    if (goes_on != NONE && escapes(ray, horizon)) {
        terminate(ray);
        ray = weaker;
        --goes_on;
    }
#endif
    while (ends > 0) {
        vec3 throughput;
        EscapedRay end = take_end(throughput);
#if OPAQUE
        if (end.object != AIR) { store_end(2 * at + stored++, end, throughput); }
#endif
        if (end.object == AIR) { traced_radiance += throughput * radiance_beyond(end); }
        if (ends == 0) { break; }
    }
#endif
    ray_light[number] = vec4(of_channel(traced_radiance, channel), lost_of_channel(traced_lost));
#if OPAQUE && !MISSES
    end_counts[at] = uint(stored);
#endif
#if !MISSES
    branch_pixels[2 * at] = goes_on == NONE ? NO_RAY : word;
    branch_pixels[2 * at + 1] = goes_on == BOTH ? word : NO_RAY;
    for (int branch = 0; branch < goes_on; ++branch) {
        store(2 * at + branch, ray);
        ray = weaker;
    }
#endif
}
