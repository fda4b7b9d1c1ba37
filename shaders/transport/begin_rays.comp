// The first rays of some pixels, in the order of these; those of the channels of a pixel lie together, which are three where indices
// differ.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/stored_rays.glsl"

layout(std430, binding = FIRST_PIXELS_BINDING) readonly buffer FirstPixels { uint first_pixels[]; };
layout(std430, binding = TRACED_LIGHT_BINDING) writeonly buffer TracedLight { vec4 traced_light[]; };
uniform int summed_row;      // first row of the frame that is there

uniform int first_number, pixel_count;   // of the pixels: of the first, and of all

void main() {
    int place = int(gl_GlobalInvocationID.x);
    if (place >= pixel_count) { return; }
    read_bodies();
    ivec2 here = pixel_of(first_pixels[first_number + place]);
    traced_light[(here.y - summed_row) * int(frame_size.x) + here.x] = vec4(0.0);
    Ray ray;
    PrimaryHit primary;
    float reach, variance;
    vec3 reflectance;
    bool is_traced = first_ray(pixel_at(here), ray, primary, reach, variance, reflectance);
#if DISPERSION
    for (int channel = 0; channel < 3; ++channel) {
        branch_pixels[3 * place + channel] = is_traced && (mirrored == 0 || channel == 1) ? packed_pixel(here, channel) : NO_RAY;
        if (is_traced) { store(3 * place + channel, ray); }
    }
#else
    branch_pixels[place] = is_traced ? packed_pixel(here, 1) : NO_RAY;
    if (is_traced) { store(place, ray); }
#endif
}
