// Light that a medium without an interface scatters into a direction, in all orders. Points count from the center of the
// media; direction: in which light travels.
//
// The radiance of a beam in a medium that scatters ahead has Legendre moments that decay as exp(-(sigma_t - sigma_s g^l) s)
// as long as it has turned little (Goudsmit & Saunderson 1940). Those of orders 0 to 2 spread in space, too: cells hold
// them, by diffusion and discrete ordinates. All others are found here at each point, from the optical depth to the light:
// a small-angle solution for what is peaked, a diffuse one for the rest (Romanova 1962; Budak, Klyuykov & Korkin 2010).

#include <Density>
#include "lib/environment.glsl"
#include "lib/phase.glsl"

uniform sampler3D scattered_light;  // grids of all bodies, one behind the other along z: mean radiance, and moments of orders 1 and 2

vec3 scattered_moment(vec3 at, float number) {
    return textureLod(scattered_light, at + vec3(0.0, 0.0, number), 0.0).rgb;
}

// From the environment and lights, on its second event and later ones; and from the environment on its first.
vec3 scattered_before(int slot, vec3 point, vec3 direction) {
    vec4 low = scattered_low[slot];
    vec4 grid = scattered_grid[slot];
    if (low.w == 0.0) { return vec3(0.0); }
    vec3 size = vec3(textureSize(scattered_light, 0));
    vec3 at = clamp((point - low.xyz) * low.w, vec3(0.5), grid.xyz - 0.5);
    at = (at + vec3(0.0, 0.0, grid.w)) / size;
    vec3 mean = textureLod(scattered_light, at, 0.0).rgb;
    if (scattered_ahead[slot].x > 0.0) {
        float next = grid.z / size.z;
        vec3 d = direction;
        mean += d.x * scattered_moment(at, next) + d.y * scattered_moment(at, 2.0 * next) + d.z * scattered_moment(at, 3.0 * next);
        vec3 mixed = sqrt(3.0) * d * d.yzx;
        mean += mixed.x * scattered_moment(at, 4.0 * next) + mixed.y * scattered_moment(at, 5.0 * next) + mixed.z * scattered_moment(at, 6.0 * next);
        mean += (1.5 * d.z * d.z - 0.5) * scattered_moment(at, 7.0 * next);
        mean += 0.5 * sqrt(3.0) * (d.x * d.x - d.y * d.y) * scattered_moment(at, 8.0 * next);
    }
    return mean;
}

// Light of the environment that is scattered ahead on a ray, at its beginning, less what cells hold of it: a picture of the
// environment for each depth, behind the cells. depth: of scattering on the whole ray.
vec3 environment_ahead(int slot, vec3 direction, vec3 depth) {
    float deepest = scattered_ahead[slot].z;
    if (deepest == 0.0) { return vec3(0.0); }
    vec2 uv = equirectangular_uv(direction, 0.0);
    vec3 size = vec3(textureSize(scattered_light, 0));
    float first = scattered_grid[slot].w + 9.0 * scattered_grid[slot].z;
    vec2 at = vec2(1.0 + AHEAD_WIDTH * fract(uv.x), clamp(AHEAD_HEIGHT * uv.y, 0.5, AHEAD_HEIGHT - 0.5));
    vec3 level = sqrt(min(depth / deepest, vec3(1.0))) * (AHEAD_DEPTHS - 1.0) + 0.5 + first;
    vec3 scattered = transmittance((1.0 - scattered_ahead[slot].y) * depth) - transmittance(depth);
    return scattered * vec3(
        textureLod(scattered_light, vec3(at, level.r) / size, 0.0).r,
        textureLod(scattered_light, vec3(at, level.g) / size, 0.0).g,
        textureLod(scattered_light, vec3(at, level.b) / size, 0.0).b
    );
}
