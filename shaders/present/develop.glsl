// From linear radiance to sRGB on a display: exposure, one of the tone curves, and the encoding.

#include "lib/color.glsl"
#include "lib/tone.glsl"

// tone: the number of the curve in translucent.tone.TONES.
vec3 develop(vec3 radiance, float stops, int tone) {
    vec3 linear = radiance * exposure_scale(stops);
    if (tone == 1) {
        linear = tone_neutral(linear);
    } else if (tone == 2) {
        linear = tone_agx(linear);
    } else {
        linear = tone_none(linear);
    }
    return linear_to_srgb(linear);
}
