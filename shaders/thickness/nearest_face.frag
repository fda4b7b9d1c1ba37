// What viewers do that cannot look through a body: the nearest face alone says how thick it is there. For comparison.
// Not SPHERE: everywhere as thick (thicknessFactor of KHR_materials_volume). SPHERE: as if the body were a ball of this
// diameter, whose chord is diameter * n.v.

#include <Body>
#include <View>
#include "lib/ray.glsl"

uniform float size;  // metres

in float axial;
#if SPHERE
in vec3 world_normal;
#endif

#if SPECTRAL
layout(location = 0) out vec4 optical_depth_and_count;
layout(location = 1) out float path;
#else
layout(location = 0) out vec2 path_and_count;
#endif

void main() {
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
    float advance = length(ray);
    float assumed = size;
#if SPHERE
    assumed *= abs(dot(normalize(world_normal), ray)) / advance;
#endif
    // The accumulated path counts along the forward axis; the resolve multiplies it by the ray's advance.
    assumed /= advance;
#if SPECTRAL
    optical_depth_and_count = vec4(assumed * extinction.rgb, 0.0);
    path = assumed;
#else
    path_and_count = vec2(assumed, 0.0);
#endif
}
