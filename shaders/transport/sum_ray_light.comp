// Adds the light of a generation's rays to that of their pixels. The rays of a pixel lie together, and one invocation adds them up, in
// their order: so sums are the same each time.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

layout(std430, binding = PIXEL_RAYS_BINDING) readonly buffer PixelRays { uvec2 pixel_rays[]; };  // first ray; pixel
layout(std430, binding = RAY_LIGHT_BINDING) readonly buffer RayLight { vec4 ray_light[]; };
layout(std430, binding = TRACED_LIGHT_BINDING) buffer TracedLight { vec4 traced_light[]; };

uniform int pixel_count;
uniform int columns;       // of the frame
uniform int summed_row;     // first row of the frame whose light is there

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= pixel_count) { return; }
    uint pixel = pixel_rays[number].y, end = pixel_rays[number + 1].x;
    vec4 sum = vec4(0.0);
    for (uint ray = pixel_rays[number].x; ray < end; ++ray) { sum += ray_light[ray]; }
    traced_light[(int(pixel >> 15) - summed_row) * columns + int(pixel & 0x7fffu)] += sum;
}
