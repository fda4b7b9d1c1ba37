// Rays traced through the meshes wherever interfaces reflect and refract them: a tree of exact branches. The stronger branch is
// always followed, the weaker one FORKS times on a path (the first mirror image is free), else it is looked up in the environment;
// so are both at the last of `most_interfaces`. The rasterizer has found the first interface. adaptive: only samples of a pixel that
// are worth it; with the square of their luminance in place of the transmittance. DEEP: more than 16 interfaces. Row 0 of the output
// is the top row.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D entered;             // interface towards the eye: normal, axial depth
uniform sampler2D surface_parameters;  // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

const int MOST_SEGMENTS = 4096;
#if DEEP
const int MOST_STACKED = 64;
#else
const int MOST_STACKED = 16;
#endif

// Light of a tree of rays, and how much of it is lost. No two weaker branches wait that have as many interfaces behind them.
void trace(Ray ray, PrimaryHit primary, float reach, int channel) {
    traced_radiance = vec3(0.0);
    traced_lost = 0.0;
    Ray stack[MOST_STACKED], weaker;
    int stacked = 0, goes_on = ONE;
    for (int segment = 0; goes_on != NONE && segment < MOST_SEGMENTS; ++segment) {
        goes_on = follow(ray, weaker, first_hit(ray.origin, ray.direction, 0.0, reach), primary, channel);
        reach = NOTHING;  // the rasterizer sees some edges a little elsewhere
        if (goes_on == BOTH) {
            stack[stacked++] = weaker;
        } else if (goes_on == NONE && stacked > 0) {
            ray = stack[--stacked];
            goes_on = ONE;
        }
    }
    // Not all has been followed, here or where a driver cuts long loops short: Mesa does after 65,535 iterations.
    if (goes_on != NONE) { traced_lost = 1.0; }
}

#if MIRROR
#include "transport/mirrored_ground.glsl"
#else
const int mirrored = 0;
#endif

// Traces a ray, in each channel for itself where indices differ.
void trace_channels(Ray ray, PrimaryHit primary, float reach) {
    trace(ray, primary, reach, 1);
#if DISPERSION
    if (mirrored == 1) { return; }
    vec3 light = traced_radiance;
    float lost = traced_lost;
    trace(ray, primary, reach, 0);
    light.r = traced_radiance.r;
    lost += traced_lost;
    trace(ray, primary, reach, 2);
    light.b = traced_radiance.b;
    traced_radiance = light;
    traced_lost = (lost + traced_lost) / 3.0;
#endif
}

void main() {
    read_bodies();
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    ivec2 here = ivec2(gl_FragCoord.xy);
    uvec2 number = uvec2(gl_FragCoord.xy + beyond.xy);
    vec3 direction = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    vec3 emitted = texelFetch(emitted_radiance_sum, here, 0).rgb;
    vec3 through = texelFetch(straight_transmittance, here, 0).rgb;
    vec4 front = texelFetch(entered, texel, 0);
    out_transmittance = vec4(through, 1.0);  // alpha: fraction of the light that can be trusted
#if FROM_EYE
    bool starts_inside = start_interior.x != 0u;
#else
    const bool starts_inside = false;
#endif
    Ray ray;
    PrimaryHit primary;
    float reach = NOTHING;
    vec4 parameters = vec4(0.0);
#if MIRROR
    vec3 reflectance;
    if (mirrored == 1) {
        // Counted where no interface is before what the ground mirrors.
        out_radiance = vec4(0.0, 0.0, 0.0, adaptive == 1 && front.w >= NOTHING ? 1.0 : 0.0);
        out_transmittance = vec4(0.0);
        if (front.w < NOTHING || !begin_in_mirror(pixel, number, texel, direction, ray, primary, reflectance)) { return; }
    } else
#endif
    if (front.w < NOTHING || starts_inside) {
        parameters = texelFetch(surface_parameters, texel, 0);
        begin(pixel, number, direction, front, parameters, texelFetch(surface_color, texel, 0), starts_inside, ray, primary, reach);
    } else {
        out_radiance = vec4(background(pixel, direction, texel) * through + emitted, 1.0);
        return;
    }
    trace_channels(ray, primary, reach);
    vec3 light = traced_radiance;
#if MIRROR
    if (mirrored == 1) {
        vec3 without = environment_radiance(ray.origin, ray.direction, true, ray.blur);
        out_radiance = vec4(reflectance * through * (min(light, vec3(NOTHING)) - without), float(adaptive));
        float level = clamp(luminance(out_radiance.rgb), -1e15, 1e15);
        out_transmittance = vec4(adaptive == 1 ? level * level : 0.0, 0.0, 0.0, -strength(reflectance) / 3.0 * min(traced_lost, 1.0));
        return;
    }
#endif
    out_radiance = vec4(with_lights(light, direction, primary, emitted, parameters.w, starts_inside), 1.0);
    out_transmittance.a = 1.0 - min(traced_lost, 1.0);
    if (adaptive == 1) {
        float level = min(luminance(out_radiance.rgb), 1e15);
        out_transmittance.rgb = vec3(level * level, 0.0, 0.0);
    }
}
