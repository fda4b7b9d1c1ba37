// Statistics of the streams of a tile, into those of the picture. Row 0 is the top row.

#include <constants>
#include "transport/path_state.glsl"

layout(std430, binding = ENDED_PATHS_BINDING) readonly buffer EndedPaths { vec4 ended_paths[]; };

uniform ivec2 tile_origin;
uniform ivec2 tile_size;
uniform int streams;
uniform uint first_path;
uniform uint last_path;

layout(location = 0) out vec4 out_mean;    // a: how many paths were lost
layout(location = 1) out vec4 out_spread;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - tile_origin;
    int first = (texel.y * tile_size.x + texel.x) * streams;
    Statistics all = Statistics(0u, vec3(0.0), vec3(0.0), 0.0);
    for (int own = 0; own < streams; ++own) {
        vec4 mean = ended_paths[2 * (first + own)];
        uint count = (last_path - first_path - uint(own) + uint(streams) - 1u) / uint(streams) + (own == 0 ? first_path : 0u);
        add_paths(all, mean.rgb, count);
        all.spread += ended_paths[2 * (first + own) + 1].rgb;
        all.lost += mean.a;
    }
    out_mean = vec4(all.mean, all.lost);
    out_spread = vec4(all.spread, 1.0);
}
