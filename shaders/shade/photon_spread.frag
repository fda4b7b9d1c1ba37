// How far the photons of a pixel are spread: over the smallest square on their surface that holds enough of them. With more
// photons squares shrink to the pixel itself, as the radius does in progressive photon mapping (Hachisuka et al. 2008).

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"
#include "shade/photon_surface.glsl"

uniform float enough;  // photons

layout(location = 0) out vec2 spread;  // pixels to each side; fraction of its light that each pixel of the square gets

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    spread = vec2(0.0, 1.0);
    float found = texelFetch(photon_irradiance, here, 0).a;
    if (found == 0.0 || found >= enough) { return; }
    Receiver own = receiver_at(here);
    float pixels = 1.0;
    for (int reach = 1; reach <= WIDEST_SPREAD && found < enough; ++reach) {
        for (int y = -reach; y <= reach; ++y) {
            int step = abs(y) == reach ? 1 : 2 * reach;
            for (int x = -reach; x <= reach; x += step) {
                ivec2 there = here + ivec2(x, y);
                if (!is_in_picture(there) || !same_surface(own, receiver_at(there))) { continue; }
                pixels += 1.0;
                found += texelFetch(photon_irradiance, there, 0).a;
            }
        }
        spread = vec2(reach, 1.0 / pixels);
    }
}
