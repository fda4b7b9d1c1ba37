// Albedo of the diffuse base of opaque objects towards the eye: what photons that land there light.

#include <constants>
#include <View>
#include <Body>
#include <Environment>
#include "lib/ray.glsl"
#if SURFACE
#include "shade/shadows.glsl"
#include "shade/opaque_surface.glsl"
#endif

in float axial;
in vec3 world_normal;
in vec3 from_eye;
#if SURFACE
in vec2 surface_uv;
#if VERTEX_COLORS
in vec4 vertex_color;
#else
const vec4 vertex_color = vec4(1.0);
#endif
#endif

layout(location = 0) out vec4 receiver_base;
layout(location = 1) out vec4 receiver_normal;  // unit, to the side that the mesh calls outside

void main() {
#if SURFACE
    OpaqueSurface surface = opaque_surface_at(color.rgb, world_normal, from_eye, surface_uv, vertex_color);
    if (surface.is_hole || (opaque_one_sided == 1.0 && !gl_FrontFacing)) { discard; }
#endif
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    receiver_normal = vec4(normalize(world_normal), 0.0);
    gl_FragDepth = clamp((axial * axial_depth_scale + axial_depth_start - opaque_range.x) * opaque_range.y, 0.0, 1.0);
#if SURFACE
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    float cos_view = clamp(abs(dot(surface.normal, ray)), 1e-3, 1.0);
    OpaqueBsdf bsdf = opaque_bsdf(surface, cos_view);
    receiver_base = vec4((1.0 - bsdf.coated) * bsdf.base, 1.0);
#else
    receiver_base = vec4(color.rgb, 1.0);
#endif
}
