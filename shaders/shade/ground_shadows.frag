// Fraction of the light of the environment that bodies take from the points of a ground, by channel: that of one of the directions,
// to be added up.

#if SHADOW_MAPS < 1
#error bodies are in shadow maps: SHADOW_MAPS is 1
#endif

#include <constants>
#include <Lights>
#include "shade/shadows.glsl"

uniform int number;         // of the direction
uniform vec3 ground_middle; // from the center of the media
uniform vec3 ground_x;      // in the ground, as long as where squeezing begins
uniform vec3 ground_y;
uniform vec3 ground_normal;
uniform vec3 all_light;     // irradiance of all directions where nothing shadows them
uniform float ground_texels; // along a side

layout(location = 0) out vec4 taken;

void main() {
    vec2 at = unsqueezed(gl_FragCoord.xy / ground_texels * 2.0 - 1.0);
    vec3 point = ground_middle + at.x * ground_x + at.y * ground_y;
    vec3 light = light_of_sky(number, ground_normal) * (1.0 - light_through(sky_view(number), point, ground_normal, true, vec2(0.0), 1.0));
    taken = vec4(mix(vec3(0.0), light / max(all_light, vec3(1e-30)), greaterThan(all_light, vec3(0.0))), 1.0);
}
