// States of paths, before any is followed: the mean over the paths that have ended, and their number.

uniform sampler2D known_mean;
uniform sampler2D known_spread;
uniform ivec2 tile_origin;
uniform uint first_path;

#include "transport/path_textures.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + tile_origin;
    vec4 mean = first_path > 0u ? texelFetch(known_mean, texel, 0) : vec4(0.0);
    vec4 spread = first_path > 0u ? texelFetch(known_spread, texel, 0) : vec4(0.0);
    Path none = Path(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), vec3(0.0), uvec4(0u), 0u, 0, false, false);
    store(none, 0u, Statistics(first_path, mean.rgb, spread.rgb, mean.a), 0.0);
}
