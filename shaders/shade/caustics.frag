// Light of photons that opaque objects reflect to the eye, spread as far as there are few of them.

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"
#include "shade/photon_surface.glsl"

uniform sampler2D photon_spread;
uniform sampler2D receiver_base;
uniform float photon_weight;  // in the mean of several rounds

layout(location = 0) out vec4 radiance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    radiance = vec4(0.0);
    Receiver own = receiver_at(here);
    if (!own.there) { return; }
    vec3 irradiance = vec3(0.0);
    for (int y = -WIDEST_SPREAD; y <= WIDEST_SPREAD; ++y) {
        for (int x = -WIDEST_SPREAD; x <= WIDEST_SPREAD; ++x) {
            ivec2 there = here + ivec2(x, y);
            if (!is_in_picture(there)) { continue; }
            vec4 found = texelFetch(photon_irradiance, there, 0);
            if (found.a == 0.0) { continue; }
            vec2 spread = texelFetch(photon_spread, there, 0).rg;
            vec2 within = clamp(spread.x + 0.5 - abs(vec2(x, y)), 0.0, 1.0);
            float share = within.x * within.y * spread.y;
            if (share == 0.0) { continue; }
            if ((x == 0 && y == 0) || same_surface(own, receiver_at(there))) { irradiance += share * found.rgb; }
        }
    }
    radiance = vec4(min(photon_weight * irradiance * texelFetch(receiver_base, here, 0).rgb / PI, vec3(NOTHING)), 0.0);
}
