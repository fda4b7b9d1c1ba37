// States of paths and their statistics in seven texels of textures: so a path goes on in the next pass where one stops.

#include "transport/path_state.glsl"

uniform sampler2D path_origin;      // and throughput of red light
uniform sampler2D path_direction;   // and of green
uniform sampler2D path_light;       // found so far; and of blue
uniform usampler2D path_interior;   // list of the bodies that it is in
uniform usampler2D path_counts;     // paths that have ended; random numbers drawn; interfaces behind it, and flags; metres skipped
uniform sampler2D path_mean;        // of the paths that have ended; how many of them were lost
uniform sampler2D path_spread;      // sum of their squared differences from the mean; pass in which the last one ended

layout(location = 0) out vec4 out_origin;
layout(location = 1) out vec4 out_direction;
layout(location = 2) out vec4 out_light;
layout(location = 3) out uvec4 out_interior;
layout(location = 4) out uvec4 out_counts;
layout(location = 5) out vec4 out_mean;
layout(location = 6) out vec4 out_spread;

Statistics stored_statistics(ivec2 texel) {
    vec4 mean = texelFetch(path_mean, texel, 0);
    return Statistics(texelFetch(path_counts, texel, 0).x, mean.rgb, texelFetch(path_spread, texel, 0).rgb, mean.a);
}

Path stored_path(ivec2 texel) {
    vec4 origin = texelFetch(path_origin, texel, 0);
    vec4 direction = texelFetch(path_direction, texel, 0);
    vec4 light = texelFetch(path_light, texel, 0);
    uvec4 counts = texelFetch(path_counts, texel, 0);
    return Path(origin.xyz, uintBitsToFloat(counts.w), direction.xyz, vec3(origin.w, direction.w, light.w), light.rgb,
        texelFetch(path_interior, texel, 0), counts.z & ~DEPTH_BITS, int(counts.z & DEPTH_BITS), false, false);
}

void store(Path path, uint drawn, Statistics known, float ended_in) {
    out_origin = vec4(path.origin, path.throughput.r);
    out_direction = vec4(path.direction, path.throughput.g);
    out_light = vec4(path.light, path.throughput.b);
    out_interior = path.interior;
    out_counts = uvec4(known.count, drawn, path.flags | (uint(path.depth) & DEPTH_BITS), floatBitsToUint(path.skipped));
    out_mean = vec4(known.mean, known.lost);
    out_spread = vec4(known.spread, ended_in);
}
