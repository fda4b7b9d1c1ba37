// How far the photons of a pixel are spread: over the smallest square on their surface that holds enough of them. With more
// photons squares shrink to the pixel itself, as the radius does in progressive photon mapping (Hachisuka et al. 2008).

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"
#include "shade/photon_surface.glsl"

uniform float enough;  // photons

layout(location = 0) out vec2 spread;  // pixels to each side; fraction of its light that each pixel of the square gets

const float CHANCE = 2.0;  // standard deviations, of a Poisson distribution, up to which a count is that of its neighbors

// Photons of a pixel stay in it where it and its neighbors have enough on average. Its own number, while small, says little:
// spread by it, half of the pixels of an evenly lit surface would keep theirs, and show the pattern in which photons start.
// A pixel of a bright line has more than its neighbors by more than chance.
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    spread = vec2(0.0, 1.0);
    float mine = texelFetch(photon_irradiance, here, 0).a, found = mine;
    if (found == 0.0) { return; }
    Receiver own = receiver_at(here);
    float pixels = 1.0;
    for (int reach = 1; reach <= WIDEST_SPREAD && (reach == 1 || found < enough); ++reach) {
        for (int y = -reach; y <= reach; ++y) {
            int step = abs(y) == reach ? 1 : 2 * reach;
            for (int x = -reach; x <= reach; x += step) {
                ivec2 there = here + ivec2(x, y);
                if (!is_in_picture(there) || !same_surface(own, receiver_at(there))) { continue; }
                pixels += 1.0;
                found += texelFetch(photon_irradiance, there, 0).a;
            }
        }
        float mean = found / pixels;
        if (mean >= enough || (mine >= enough && mine > mean + CHANCE * sqrt(mean))) { return; }
        spread = vec2(reach, 1.0 / pixels);
    }
}
