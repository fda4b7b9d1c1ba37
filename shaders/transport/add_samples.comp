// Adds the light of a sample to the sums of some pixels, once that of their rays has been summed up: where an interface is visible,
// or, for rays that a ground has mirrored, where none is. Row 0 is the top row.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/stored_rays.glsl"
#include "transport/shaded_pixel.glsl"

layout(std430, binding = FIRST_PIXELS_BINDING) readonly buffer FirstPixels { uint first_pixels[]; };
layout(rgba32f) uniform restrict image2D summed_light;
layout(rgba32f) uniform restrict image2D summed_spread;

uniform int pixel_count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= pixel_count) { return; }
    read_bodies();
    Pixel pixel = pixel_at(pixel_of(first_pixels[number]));
    if (has_interface(pixel) == (mirrored == 1)) { return; }
    vec4 light, spread;
    shade_pixel(pixel, light, spread);
    imageStore(summed_light, pixel.here, imageLoad(summed_light, pixel.here) + light);
    imageStore(summed_spread, pixel.here, imageLoad(summed_spread, pixel.here) + spread);
}
