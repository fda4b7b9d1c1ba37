// Opaque objects: where they are, and what light they reflect. DEPTH_ONLY: no more than where they are.
// PROJECTED_DEPTH: the depth buffer has the depth of the projection; else it is linear, whatever the near plane.
// Plain ones reflect diffusely (Lambert 1760); SURFACE: as their surface says, lit by filtered maps of the environment.

#include <constants>
#include <View>
#if DEPTH_ONLY && !SURFACE
#include "geometry/of_body.glsl"
#else
#include <Body>
#endif
#include <Environment>
#include "lib/environment.glsl"
#include "lib/ray.glsl"
#include "shade/lights.glsl"
#include "shade/shadows.glsl"
#include "shade/ground_light.glsl"
#if SURFACE
#include "shade/opaque_surface.glsl"
#else
#include "shade/diffuse_light.glsl"
#endif

in float axial;
in vec3 world_normal;
in vec3 from_eye;
in vec3 from_center;
#if SURFACE
in vec2 surface_uv;
#if VERTEX_COLORS
in vec4 vertex_color;
#else
const vec4 vertex_color = vec4(1.0);
#endif
#endif

#if DIFFUSED && !DEPTH_ONLY
uniform vec4 opaque_map[5];  // of `IrradianceMap`, the layer beside the corner, and whether it is lit

IrradianceMap own_map() {
    return IrradianceMap(opaque_map[0].xyz, opaque_map[1].xyz, opaque_map[2].xyz, opaque_map[3].xyz, opaque_map[4].xyz, opaque_map[0].w, opaque_map[1].w);
}
#else
IrradianceMap own_map() { return NO_IRRADIANCE_MAP; }
#endif

layout(location = 0) out float opaque_axial_depth;
#if !DEPTH_ONLY
layout(location = 1) out vec4 radiance;
#endif

#if !SURFACE && !DEPTH_ONLY
vec3 diffuse_radiance(vec3 normal) {
    vec3 irradiance = surrounding_irradiance(own_map(), from_center, normal);
    for (int light = 0; light < light_count; ++light) {
        vec3 sent = light_irradiance_on(light, from_center, normal);
        if (sent != vec3(0.0)) { irradiance += sent * light_reaching(light, from_center, normal); }
    }
    return color.rgb / PI * irradiance;
}
#endif

void main() {
#if SURFACE
    OpaqueSurface surface = opaque_surface_at(color.rgb, world_normal, from_eye, surface_uv, vertex_color);
    if (surface.is_hole || (opaque_one_sided == 1.0 && !gl_FrontFacing)) { discard; }
#endif
    opaque_axial_depth = axial * axial_depth_scale + axial_depth_start;
#if !PROJECTED_DEPTH
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    gl_FragDepth = clamp((opaque_axial_depth - opaque_range.x) * opaque_range.y, 0.0, 1.0);
#endif
#if !DEPTH_ONLY
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
#if SURFACE
    ray = normalize(ray);
    // Interpolated normals may look away from the eye where the faces do not: then the surface is viewed edge-on.
    vec3 normal = gl_FrontFacing ? surface.normal : -surface.normal;
    float facing = dot(normal, ray);
    normal = facing > -1e-3 ? normalize(normal - (facing + 1e-3) * ray) : normal;
    surface.map = own_map();
    vec3 light = opaque_radiance_of(surface, normal, ray, from_center);
#else
    vec3 normal = normalize(world_normal);
    vec3 light = diffuse_radiance(dot(normal, ray) > 0.0 ? -normal : normal);
#endif
    radiance = vec4(min(light, vec3(NOTHING)), 1.0);
#endif
}
