// Fraction of the light of the environment that bodies take from the points of a ground, by channel: that of one of the directions,
// to be added up. A direction represents all within its cell: what throws shadows some metres away blurs them in proportion. How far
// away that is nobody knows, but that it is in a box: nothing is blurred more than by the near side of that.

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
uniform vec3 box_low;        // bounds of all that throws shadows, from the center of the media
uniform vec3 box_high;
uniform int order;           // number among the directions that are drawn
uniform float cell_radius;   // of the cell of the direction, in radians

const int TAPS = 6;
const float GOLDEN_ANGLE = 2.39996323;

// Metres from a point along a unit direction to where that enters the box, or is nearest to it; 0 within it.
float metres_to_box(vec3 point, vec3 direction) {
    vec3 along = mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    vec3 one = (box_low - point) / along, other = (box_high - point) / along, near = min(one, other), far = max(one, other);
    return max(min(max(near.x, max(near.y, near.z)), min(far.x, min(far.y, far.z))), 0.0);
}

// Mean over the cell, by points of a disc (Vogel 1979) that are turned from direction to direction.
vec3 cell_through(ShadowView view, vec3 point) {
    float radius = cell_radius * metres_to_box(point, -view.ahead.xyz);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < TAPS; ++i) {
        float angle = GOLDEN_ANGLE * float(i + TAPS * order);
        vec2 aside = radius * sqrt((float(i) + 0.5) / float(TAPS)) * vec2(cos(angle), sin(angle));
        sum += light_through(view, point, ground_normal, true, aside, 0.5);
    }
    return sum / float(TAPS);
}

layout(location = 0) out vec4 taken;

void main() {
    vec2 at = unsqueezed(gl_FragCoord.xy / ground_texels * 2.0 - 1.0);
    vec3 point = ground_middle + at.x * ground_x + at.y * ground_y;
    vec3 light = light_of_sky(number, ground_normal) * (1.0 - cell_through(sky_view(number), point));
    taken = vec4(mix(vec3(0.0), light / max(all_light, vec3(1e-30)), greaterThan(all_light, vec3(0.0))), 1.0);
}
