// Photons of a light, one for each texel, followed from the light to the first opaque surface.

#include <constants>
#include <View>
#include <Surfaces>
#include <ObjectRow>
#include "transport/photon_step.glsl"

uniform uint first_photon;   // number of that in the first texel, among all of the aim
uniform uint last_photon;    // before which they end

layout(location = 0) out vec4 out_point;   // from the center of the media; w: 1 landed, 0 not, -1 given up
layout(location = 1) out vec4 out_power;
layout(location = 2) out vec4 out_normal;

void main() {
    read_bodies();
    ivec2 here = ivec2(gl_FragCoord.xy);
    uint number = first_photon + uint(here.y) * PHOTON_WIDTH + uint(here.x);
    out_point = vec4(0.0);
    out_power = vec4(0.0);
    out_normal = vec4(0.0);
    if (number >= last_photon) { return; }
    vec3 power;
    Draws draws = Draws(number, aim, 0u);
    Photon photon = begun(number, draws, power);
    if (power == vec3(0.0)) { return; }
    Landing landing = Landing(vec3(0.0), vec3(0.0), false);
    for (int surface = 0; surface < MOST_PHOTON_HITS; ++surface) {
        Hit hit = nearest_hit(photon.origin, photon.direction, 0.0, NOTHING, uvec4(0u));
        if (hit.object < 0 || !follow(photon, hit, channel_of(number), draws, landing)) {
            if (landing.there) {
                out_point = vec4(landing.point, 1.0);
                out_power = vec4(power * photon.throughput, 1.0);
                out_normal = vec4(landing.normal, 0.0);
            }
            return;
        }
    }
    // Or a driver has cut the loop short: Mesa does after 65,535 iterations of all loops.
    out_point.w = -1.0;
}
