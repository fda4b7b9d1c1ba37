// The most crossings of any pixel in a tile, by the first pass of a peel: it bounds how many passes find any. The picture
// of all tiles lies in a corner of what is drawn into.

#include <constants>

uniform sampler2D first;

layout(location = 0) out vec4 counted;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * PEEL_TILE;
    ivec2 last = textureSize(first, 0) - 1;
    float most = 0.0;
    for (int y = 0; y < PEEL_TILE; ++y) {
        for (int x = 0; x < PEEL_TILE; ++x) {
            float alpha = texelFetch(first, min(corner + ivec2(x, y), last), 0).a;
            most = max(most, alpha - PEEL_UNIT * floor(alpha / PEEL_UNIT));
        }
    }
    counted = vec4(most);
}
