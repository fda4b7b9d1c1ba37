// How far the photons of a pixel are spread: over the smallest square on their surface that holds enough of them. With more
// photons squares shrink to the pixel itself, as the radius does in progressive photon mapping (Hachisuka et al. 2008).

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"
#include "shade/photon_surface.glsl"

uniform float enough;  // photons

layout(location = 0) out vec2 spread;  // half the side of the square, in pixels; fraction of its light that a pixel in it gets

// Photons of a pixel stay in it where it and its neighbors have enough on average. Its own number, while small, says little:
// spread by it, half of the pixels of an evenly lit surface would keep theirs, and show the pattern in which photons start.
// Sides are not whole numbers: where there are almost enough photons, their light is hardly spread. Otherwise pixels that spread
// their light would be darker than pixels beside them that keep it.
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    spread = vec2(0.5, 1.0);
    float found = texelFetch(photon_irradiance, here, 0).a;
    if (found == 0.0) { return; }
    Receiver own = receiver_at(here);
    float inner = 1.0;  // pixels of the surface: in the square, in the ring around it, and at the corners of the ring
    float ring = 0.0, corners = 0.0;
    for (int reach = 1; reach <= WIDEST_SPREAD && (reach == 1 || found < enough); ++reach) {
        inner += ring;
        ring = corners = 0.0;
        for (int y = -reach; y <= reach; ++y) {
            int step = abs(y) == reach ? 1 : 2 * reach;
            for (int x = -reach; x <= reach; x += step) {
                ivec2 there = here + ivec2(x, y);
                if (!is_in_picture(there) || !same_surface(own, receiver_at(there))) { continue; }
                ring += 1.0;
                corners += float(abs(x) == abs(y));
                found += texelFetch(photon_irradiance, there, 0).a;
            }
        }
        float mean = found / (inner + ring);
        if (mean >= enough) { return; }
        float side = clamp(sqrt(enough / mean), 2.0 * float(reach) - 1.0, 2.0 * float(reach) + 1.0);
        float beyond = 0.5 * side + 0.5 - float(reach);
        spread = vec2(0.5 * side, 1.0 / (inner + beyond * (ring - corners) + beyond * beyond * corners));
    }
}
