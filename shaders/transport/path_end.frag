// Statistics of the paths of a tile, into those of the picture. Row 0 is the top row.

uniform sampler2D path_mean;
uniform sampler2D path_spread;
uniform ivec2 tile_origin;

layout(location = 0) out vec4 out_mean;    // a: how many paths were lost
layout(location = 1) out vec4 out_spread;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - tile_origin;
    out_mean = texelFetch(path_mean, texel, 0);
    out_spread = vec4(texelFetch(path_spread, texel, 0).rgb, 1.0);
}
