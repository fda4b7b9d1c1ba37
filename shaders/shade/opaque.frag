// Opaque objects: where they are, and what light they reflect. DEPTH_ONLY: no more than where they are.
// Plain ones reflect diffusely (Lambert 1760); SURFACE: as their surface says, lit by filtered maps of the environment.

#include <constants>
#include <View>
#include <Body>
#include <Environment>
#include <Lights>
#include "lib/environment.glsl"
#include "lib/lights.glsl"
#include "lib/ray.glsl"
#include "shade/shadows.glsl"
#if SURFACE
#include "shade/opaque_surface.glsl"
#elif LIGHT_MAP
uniform sampler2D light_irradiance;
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

layout(location = 0) out float opaque_axial_depth;
#if !DEPTH_ONLY
layout(location = 1) out vec4 radiance;
#endif

#if !SURFACE && !DEPTH_ONLY
vec3 environment_irradiance(vec3 normal) {
#if LIGHT_MAP
    return light_scale * textureLod(light_irradiance, equirectangular_uv(normal, light_turn), 0.0).rgb;
#else
    // A backdrop fixed to the picture lights like the mean of its squares.
    float share = light_kind == ENVIRONMENT_GRADIENT ? gradient_irradiance_share(normal) : 0.5;
    return light_scale * PI * mix(light_first.rgb, light_second.rgb, share);
#endif
}

vec3 irradiance_from(int light, vec3 normal) {
    vec4 position = light_position[light];
    vec3 towards = position.xyz - position.w * from_eye;
    float distance_m = max(length(towards), 1e-18);
    float facing = max(dot(towards / distance_m, normal), 0.0);
    facing *= cone_attenuation(-towards / distance_m, light_cone[light]);
    vec3 power = light_power[light].rgb * (position.w == 0.0 ? facing : facing / distance_m / distance_m);
    return facing > 0.0 ? power * light_reaching(light, from_center, normal) : vec3(0.0);
}

vec3 diffuse_radiance(vec3 normal) {
    vec3 irradiance = environment_irradiance(normal) * environment_reaching(from_center, normal);
    for (int light = 0; light < light_count; ++light) {
        irradiance += irradiance_from(light, normal);
    }
    return color.rgb / PI * irradiance;
}
#endif

void main() {
#if SURFACE
    OpaqueFinish finish = opaque_finish_at(color.rgb, normalize(world_normal), from_eye, surface_uv, vertex_color);
    if (finish.is_hole || (opaque_passed.w == 0.0 && !gl_FrontFacing)) { discard; }
#endif
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    opaque_axial_depth = axial * axial_depth_scale + axial_depth_start;
    gl_FragDepth = clamp((opaque_axial_depth - opaque_range.x) * opaque_range.y, 0.0, 1.0);
#if !DEPTH_ONLY
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
#if SURFACE
    ray = normalize(ray);
    // Interpolated normals may look away from the eye where the faces do not: then the surface is seen edge-on.
    vec3 normal = gl_FrontFacing ? finish.normal : -finish.normal;
    float facing = dot(normal, ray);
    normal = facing > -1e-3 ? normalize(normal - (facing + 1e-3) * ray) : normal;
    vec3 light = opaque_radiance_of(finish, normal, ray, from_eye, from_center);
#else
    vec3 normal = normalize(world_normal);
    vec3 light = diffuse_radiance(dot(normal, ray) > 0.0 ? -normal : normal);
#endif
    radiance = vec4(min(light, vec3(NOTHING)), 1.0);
#endif
}
