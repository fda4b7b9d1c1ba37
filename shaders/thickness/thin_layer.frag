// Thin sheets (Drobot 2017): every face adds t / max(0.001, n.v). Sheets have no inside, so the count stays 0.

#include <Body>
#include <View>
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif

in float axial;
in vec3 world_normal;
#if HOLES
#include "thickness/holes.glsl"
#endif

#if SPECTRAL
layout(location = 0) out vec4 optical_depth_and_count;
layout(location = 1) out float path;
#else
layout(location = 0) out vec2 path_and_count;
#endif

void main() {
#if HOLES
    if (is_hole()) { discard; }
#endif
    if (axial < axial_start) { discard; }  // behind an orthographic picture
#if OPAQUE
    // What lies on an opaque surface is visible, also where rounding puts it behind.
    if (axial > last_axial() + sheet_tolerance) { discard; }
#endif
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
    float advance = length(ray);
    float facing = gl_FrontFacing ? 1.0 : -1.0;
    float cos_view = -facing * dot(normalize(world_normal), ray) / advance;
    // The accumulated path counts along the forward axis; the resolve multiplies it by the ray's advance.
    float sheet = thin_layer_thickness(sheet_thickness, cos_view, sheet_ior) / advance;
#if SPECTRAL
    optical_depth_and_count = vec4(sheet * extinction.rgb, 0.0);
    path = sheet;
#else
    path_and_count = vec2(sheet, 0.0);
#endif
}
