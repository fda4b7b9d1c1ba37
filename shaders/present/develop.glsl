// From linear radiance to sRGB on a display: exposure, one of the tone curves, and the encoding.

#include "lib/color.glsl"
#include "lib/tone.glsl"

vec3 develop(vec3 radiance, float stops) {
    vec3 linear = radiance * exposure_scale(stops);
#if TONE == 1
    linear = tone_neutral(linear);
#elif TONE == 2
    linear = tone_agx(linear);
#else
    linear = tone_none(linear);
#endif
    return linear_to_srgb(linear);
}
