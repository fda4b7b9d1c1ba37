// Passes where the last pass has found a crossing: an occlusion query around it decides whether to go on.

#include <constants>

uniform sampler2D found;

void main() {
    if (texelFetch(found, ivec2(gl_FragCoord.xy), 0).r >= NOTHING) { discard; }
}
