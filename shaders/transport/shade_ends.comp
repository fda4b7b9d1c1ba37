// Light of opaque objects at the ends of rays, added to that of the rays: for the rays of a generation that have such ends alone,
// which the CPU lists. Shaders compute all that any ray of a group needs: so most groups of step_rays.comp need no opaque surface.

#include <constants>

#if !OPAQUE
#error rays end on opaque objects: OPAQUE is 1
#endif

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/stored_rays.glsl"
#include "transport/stored_ends.glsl"

layout(std430, binding = ENDED_RAYS_BINDING) readonly buffer EndedRays { uvec4 ended_rays[]; };  // first end, number of them, number of the ray, its channel
layout(std430, binding = RAY_LIGHT_BINDING) buffer RayLight { vec4 ray_light[]; };

uniform int ended_count;

void main() {
    int at = int(gl_GlobalInvocationID.x);
    if (at >= ended_count) { return; }
    read_bodies();
    uvec4 ended = ended_rays[at];
    vec3 light = vec3(0.0), throughput;
    for (uint i = 0u; i < ended.y; ++i) {
        EscapedRay end = stored_end(int(ended.x + i), throughput);
        light += throughput * radiance_of_opaque(end);
    }
    ray_light[ended.z].rgb += of_channel(light, int(ended.w));
}
