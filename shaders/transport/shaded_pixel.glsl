// Light of a pixel's tree of rays, with that of the lights in its first interface, or of what the ground mirrors. Needs <constants>,
// <View>, ray_step.glsl and first_ray.glsl. adaptive: with the square of its luminance in place of the transmittance. GENERATIONS:
// the light of the rays has been summed up, see step_rays.comp; else they are traced here.

uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;

#if GENERATIONS
layout(std430, binding = TRACED_LIGHT_BINDING) readonly buffer TracedLight { vec4 traced_light[]; };
uniform int summed_row;     // first row of the frame that is there

// The light of a pixel's rays has been summed up.
void trace_channels(Pixel pixel, Ray ray, PrimaryHit primary, float reach) {
    vec4 found = traced_light[(pixel.here.y - summed_row) * int(frame_size.x) + pixel.here.x];
    traced_radiance = found.rgb;
    traced_lost = found.a;
}
#else
const int MOST_SEGMENTS = 4096;

// Light of a tree of rays, and how much of it is lost. No two weaker branches wait that have as many interfaces behind them.
void trace(Ray ray, PrimaryHit primary, float reach, int channel) {
    traced_radiance = vec3(0.0);
    traced_lost = 0.0;
    Ray stack[MOST_FORKED], weaker;
    int stacked = 0, goes_on = ONE;
    for (int segment = 0; segment < MOST_SEGMENTS; ++segment) {
        goes_on = follow(ray, weaker, first_hit(ray.origin, ray.direction, 0.0, reach), primary, channel);
        reach = NOTHING;  // the rasterizer sees some edges a little elsewhere
        if (goes_on == BOTH) {
            stack[stacked++] = weaker;
        } else if (goes_on == NONE && stacked > 0) {
            ray = stack[--stacked];
            goes_on = ONE;
        }
        if (goes_on == NONE) { break; }
    }
    // Not all has been followed, here or where a driver cuts long loops short: Mesa does after 65,535 iterations.
    if (goes_on != NONE) { traced_lost = 1.0; }
}

// Traces a ray, in each channel for itself where indices differ.
void trace_channels(Pixel pixel, Ray ray, PrimaryHit primary, float reach) {
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

#endif

// Radiance of a pixel, and its transmittance; alpha: how many samples this counts as, and the fraction of its light that can be
// trusted.
void shade_pixel(Pixel pixel, out vec4 out_radiance, out vec4 out_transmittance) {
#if EMISSION
    vec3 emitted = texelFetch(emitted_radiance_sum, pixel.here, 0).rgb;
#else
    const vec3 emitted = vec3(0.0);
#endif
    vec3 through = texelFetch(straight_transmittance, pixel.here, 0).rgb;
    Ray ray;
    PrimaryHit primary;
    float reach, variance;
    vec3 reflectance;
    bool is_traced = first_ray(pixel, ray, primary, reach, variance, reflectance);
    out_transmittance = vec4(through, 1.0);  // alpha: fraction of the light that can be trusted
#if MIRROR
    if (mirrored == 1) {
        // Counted where no interface is before what the ground mirrors.
        out_radiance = vec4(0.0, 0.0, 0.0, adaptive == 1 && !has_interface(pixel) ? 1.0 : 0.0);
        out_transmittance = vec4(0.0);
        if (!is_traced) { return; }
#if !FROM_EYE
        through = vec3(1.0);  // nothing is before the ground that has no interface
#endif
    }
#endif
    if (!is_traced) {
        out_radiance = vec4(background(pixel.center, pixel.direction, pixel.texel) * through + emitted, 1.0);
        return;
    }
    trace_channels(pixel, ray, primary, reach);
    vec3 light = traced_radiance;
#if MIRROR
    if (mirrored == 1) {
        vec3 without = environment_radiance(ray.origin, ray.direction, true, ray.blur);
        out_radiance = vec4(through * (min(light, vec3(NOTHING)) - reflectance * without), float(adaptive));
        float level = clamp(luminance(out_radiance.rgb), -1e15, 1e15);
        out_transmittance = vec4(adaptive == 1 ? level * level : 0.0, 0.0, 0.0, -min(traced_lost, 1.0));
        return;
    }
#endif
    out_radiance = vec4(with_lights(light, pixel.direction, primary, emitted, variance, starts_inside()), 1.0);
    out_transmittance.a = 1.0 - min(traced_lost, 1.0);
    if (adaptive == 1) {
        float level = min(luminance(out_radiance.rgb), 1e15);
        out_transmittance.rgb = vec3(level * level, 0.0, 0.0);
    }
}
