// Light that comes from all around to points in media without an interface: what has been scattered before, and the
// environment. A medium scatters sigma_s times as much into each metre of a ray. Points count from the center of the media.

#include <Density>

uniform sampler3D scattered_light;  // grids of all bodies, one behind the other along z

vec3 scattered_before(int slot, vec3 point) {
    vec4 low = scattered_low[slot];
    vec4 grid = scattered_grid[slot];
    if (low.w == 0.0) { return vec3(0.0); }
    vec3 at = clamp((point - low.xyz) * low.w, vec3(0.5), grid.xyz - 0.5);
    return textureLod(scattered_light, (at + vec3(0.0, 0.0, grid.w)) / vec3(textureSize(scattered_light, 0)), 0.0).rgb;
}
