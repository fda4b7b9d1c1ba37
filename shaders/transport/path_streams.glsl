// Streams of paths in storage buffers: the path that each follows, and the statistics of ended paths. Needs
// interior_list.glsl and random.glsl.

#include "transport/path_state.glsl"

layout(std430, binding = PATH_STATES_BINDING) buffer PathStates { uint path_states[]; };
layout(std430, binding = ENDED_PATHS_BINDING) buffer EndedPaths { vec4 ended_paths[]; };      // two for each stream
layout(std430, binding = PATH_SEGMENTS_BINDING) readonly buffer PathSegments { float path_segments[]; };
layout(std430, binding = NEXT_SEGMENTS_BINDING) writeonly buffer NextSegments { float next_segments[]; };  // rows: origins, directions, paths left

uniform int live_room;  // of a row

#if ONE_OBJECT
const int STREAM_WORDS = 11;
#else
const int STREAM_WORDS = 14;
#endif

Statistics stored_statistics(int stream, uint count) {
    vec4 mean = ended_paths[2 * stream], spread = ended_paths[2 * stream + 1];
    return Statistics(count, mean.rgb, spread.rgb, mean.a);
}

vec3 stored_vector(int at) {
    return uintBitsToFloat(uvec3(path_states[at], path_states[at + 1], path_states[at + 2]));
}

void store_vector(int at, vec3 vector) {
    for (int axis = 0; axis < 3; ++axis) { path_states[at + axis] = floatBitsToUint(vector[axis]); }
}

// number: that its segment has.
Path stored_path(int stream, int number, inout Draws draws) {
    int at = STREAM_WORDS * stream;
    Path path = Path(vec3(0.0), uintBitsToFloat(path_states[at]), vec3(0.0), stored_vector(at + 4), stored_vector(at + 7), uvec4(0u),
        path_states[at + 1] & ~DEPTH_BITS, int(path_states[at + 1] & DEPTH_BITS), false, false);
    draws.path = path_states[at + 2];
    draws.count = path_states[at + 3];
    for (int axis = 0; axis < 3; ++axis) {
        path.origin[axis] = path_segments[3 * number + axis];
        path.direction[axis] = path_segments[3 * (live_room + number) + axis];
    }
#if ONE_OBJECT
    path.interior = unpacked_interior(path_states[at + 10]);
#else
    for (int word = 0; word < 4; ++word) { path.interior[word] = path_states[at + 10 + word]; }
#endif
    return path;
}

void store(int stream, int number, Path path, Draws draws) {
    int at = STREAM_WORDS * stream;
    path_states[at] = floatBitsToUint(path.skipped);
    path_states[at + 1] = path.flags | (uint(path.depth) & DEPTH_BITS);
    path_states[at + 2] = draws.path;
    path_states[at + 3] = draws.count;
    store_vector(at + 4, path.throughput);
    store_vector(at + 7, path.light);
#if ONE_OBJECT
    path_states[at + 10] = packed_interior(path.interior);
#else
    for (int word = 0; word < 4; ++word) { path_states[at + 10 + word] = path.interior[word]; }
#endif
    for (int axis = 0; axis < 3; ++axis) {
        next_segments[3 * number + axis] = path.origin[axis];
        next_segments[3 * (live_room + number) + axis] = path.direction[axis];
    }
}
