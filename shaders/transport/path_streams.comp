// Random paths of light, an event of each live stream: the CPU has found what its path hits. A stream follows every so-many-th path of
// a pixel, one after the other, and leaves where the next segment starts.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/path_step.glsl"
#include "transport/path_streams.glsl"

layout(std430, binding = LIVE_PATHS_BINDING) readonly buffer LivePaths { int live_paths[]; };  // rows: stream, number of its segment, object and triangle of its hit

uniform ivec2 tile_size;
uniform int streams;      // of each pixel
uniform int begins;       // 1: streams begin their first paths instead
uniform uint first_path;
uniform int live_count;
uniform sampler2D known_mean;    // of paths before the first
uniform sampler2D known_spread;

const int MOST_BEGUN = 64;  // paths that miss everything, one after the other

// Whether the bounds of all objects are on a ray.
bool may_hit(vec3 origin, vec3 direction) {
    LocalRay ray = local_ray((origin - objects_frame.xyz) * objects_frame.w, direction * objects_frame.w);
    return hits_bounds(texelFetch(hierarchy_nodes, hierarchy_texel(octant_of(direction) * object_nodes), 0), ray, 0.0, NOTHING);
}

// How many a stream has to follow from one on.
uint paths_left(uint path) {
    return path < last_path ? (last_path - path + uint(streams) - 1u) / uint(streams) : 0u;
}

void main() {
    int at = int(gl_GlobalInvocationID.x);
    if (at >= live_count) { return; }
    read_bodies();
    int stream = begins == 1 ? at : live_paths[at];
    int own = stream % streams, number = stream / streams;
    ivec2 texel = ivec2(number % tile_size.x, number / tile_size.x) + tile_origin;
    Draws draws = Draws(uint(texel.y + int(beyond.y)) * uint(frame_size.x + beyond.z) + uint(texel.x + int(beyond.x)), 0u, 0u);
    Path path = Path(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), vec3(0.0), uvec4(0u), 0u, 0, false, false);
    Hit hit = Hit(NOTHING, -1, -1, vec2(0.0));
    if (begins == 0) {
        path = stored_path(stream, live_paths[live_room + at], draws);
        int object = live_paths[2 * live_room + at];
        if (object >= 0) { hit = known_hit(object, live_paths[3 * live_room + at], path.origin, path.direction); }
    } else {
        bool continues = own == 0 && first_path > 0u;
        draws.path = first_path + uint(own);
        ended_paths[2 * stream] = continues ? texelFetch(known_mean, texel, 0) : vec4(0.0);
        ended_paths[2 * stream + 1] = continues ? texelFetch(known_spread, texel, 0) : vec4(0.0);
    }
    // Software rasterizers compute all of a loop once more for any of its invocations that goes on: most leave it after the first time.
    for (int begun = 0; true; ) {
        vec2 pixel = pixel_of(texel, draws.path);
        bool followed = (path.flags & FLAG_FOLLOWED) != 0u;
        if (followed && !path.ends) { follow(path, hit, pixel, texel, draws); }
        bool broken = any(isnan(path.light)) || any(isinf(path.light)) || draws.count > MOST_DRAWN;
        if (followed && (path.ends || broken)) {
            if (broken) { path.light = vec3(0.0); }
            // Where nothing was left to chance, all paths are the same.
            uint before = (draws.path - first_path) / uint(streams);
            uint count = draws.count == 0u && spread == 0 ? paths_left(draws.path) : 1u;
            Statistics ended = stored_statistics(stream, before + (own == 0 ? first_path : 0u));
            ended.lost += path.lost || broken ? float(count) : 0.0;
            add_paths(ended, path.light, count);
            ended_paths[2 * stream] = vec4(ended.mean, ended.lost);
            ended_paths[2 * stream + 1] = vec4(ended.spread, 0.0);
            path.flags = 0u;
            draws.path += count * uint(streams);
        }
        if (draws.path >= last_path) { break; }
        if ((path.flags & FLAG_FOLLOWED) == 0u) {
            draws.count = 0u;
            begin_path(path, pixel_of(texel, draws.path), texel);
            ++begun;
        }
        if (!path.ends && (begun >= MOST_BEGUN || may_hit(path.origin, path.direction))) { break; }
        hit = Hit(NOTHING, -1, -1, vec2(0.0));
    }
    store(stream, at, path, draws);
    next_segments[6 * live_room + at] = float(paths_left(draws.path));
}
