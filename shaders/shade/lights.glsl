// The lights of the scene. Points count from the center of the media.

#include <Lights>
#include "lib/light.glsl"

Light light_row(int number) {
    return Light(light_position[number], light_power[number].rgb, light_cone[number], light_power[number].w, light_disc[number]);
}

// Light of one of them that arrives at a point.
LightSample light_at(int number, vec3 point) {
    return light_sample(light_row(number), point);
}
