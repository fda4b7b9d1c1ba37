// The first rays of a rectangle of pixels, each at a place of its own: those of a block of 4 x 2 pixels lie together, and those of
// the channels of a pixel, which are three where indices differ. adaptive: only of pixels that need more samples.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/stored_rays.glsl"

layout(std430, binding = TRACED_LIGHT_BINDING) writeonly buffer TracedLight { vec4 traced_light[]; };
uniform int summed_row;      // first row of the frame that is there

uniform sampler2D unsettled;
uniform ivec4 rectangle;    // first column and row, and how many there are
uniform int places;         // of blocks, whole ones

void main() {
    int place = int(gl_GlobalInvocationID.x);
    if (place >= places) { return; }
    read_bodies();
    int block = place >> 3, columns = (rectangle.z + 3) / 4;
    ivec2 within = ivec2(block % columns * 4 + (place & 3), block / columns * 2 + (place >> 2 & 1));
    ivec2 here = rectangle.xy + within;
    bool exists = all(lessThan(within, rectangle.zw));
    if (exists) { traced_light[(here.y - summed_row) * int(frame_size.x) + here.x] = vec4(0.0); }
    Ray ray;
    PrimaryHit primary;
    float reach, variance;
    vec3 reflectance;
    bool is_traced = exists && first_ray(pixel_at(here), ray, primary, reach, variance, reflectance);
    if (adaptive == 1) { is_traced = is_traced && texelFetch(unsettled, here, 0).r > 0.0; }
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
