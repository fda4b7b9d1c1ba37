// Opaque objects: where they are, and what light they reflect (Lambert 1760). Nothing shadows them.

#include <constants>
#include <View>
#include <Body>
#include <Environment>
#include <Lights>
#include "lib/environment.glsl"
#include "lib/ray.glsl"

in float axial;
in vec3 world_normal;
in vec3 from_eye;

layout(location = 0) out float opaque_place;
layout(location = 1) out vec4 radiance;

vec3 environment_irradiance(vec3 normal) {
    // A backdrop fixed to the picture lights like the mean of its squares.
    float share = environment_kind == ENVIRONMENT_GRADIENT ? gradient_irradiance_share(normal) : 0.5;
    return PI * mix(environment_first.rgb, environment_second.rgb, share);
}

vec3 light_irradiance(int light, vec3 normal) {
    vec4 place = light_place[light];
    vec3 towards = place.xyz - place.w * from_eye;
    float distance_m = max(length(towards), 1e-18);
    float facing = max(dot(towards / distance_m, normal), 0.0);
    return light_power[light].rgb * (place.w == 0.0 ? facing : facing / distance_m / distance_m);
}

void main() {
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    opaque_place = axial * place_scale + place_start;
    gl_FragDepth = clamp((opaque_place - opaque_range.x) * opaque_range.y, 0.0, 1.0);
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
    vec3 normal = normalize(world_normal);
    normal = dot(normal, ray) > 0.0 ? -normal : normal;
    vec3 irradiance = environment_irradiance(normal);
    for (int light = 0; light < light_count; ++light) {
        irradiance += light_irradiance(light, normal);
    }
    radiance = vec4(min(color.rgb / PI * irradiance, vec3(NOTHING)), 1.0);
}
