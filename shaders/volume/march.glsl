// Ray marching through a segment: a sum over steps of what a source sends from each (Max 1995, section 4). A step from
// begin to end with its sample at s adds S(s) w e^(-sigma_t (s - begin)), dimmed by the segment up to its beginning.

#include "volume/in_scatter.glsl"
#if SCATTERS_AGAIN
#include "volume/scattered_light.glsl"
#endif

uniform int march_steps;
uniform int march_rule;
uniform int march_seed;
uniform int march_jitter;

int marched_segments = 0;

// A random number in 0..1 of a pixel, the same on all machines (pcg3d, Jarzynski & Olano 2020).
float hashed(uint number) {
    uvec3 v = uvec3(uint(gl_FragCoord.x + beyond.x), uint(frame_size.y - gl_FragCoord.y + beyond.y), number + 2654435769u * uint(march_seed));
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return float(v.x >> 8) / 16777216.0;
}

// Shares of the segment where a step begins and ends, and where its sample is.
vec3 step_fractions(int i) {
    float n = float(march_steps);
    if (march_rule == MARCH_GAUSS) {
        float begin = 0.0;
        for (int k = 0; k < i; ++k) { begin += gauss[k].y; }
        return vec3(begin, begin + gauss[i].y, gauss[i].x);
    }
    float offset = march_rule == MARCH_LEFT ? 0.0 : 0.5;
    if (march_rule == MARCH_JITTERED) { offset = hashed(uint(marched_segments * march_steps + i)); }
    if (march_jitter == 1) { offset = hashed(0u); }
    return vec3(float(i), float(i + 1), float(i) + offset) / n;
}

// Metres along the segment at a fraction of it, and their derivative by it there: equal angles for a point light.
vec2 metres_at_fraction(float fraction, int light, ViewRay ray, float metres) {
    vec4 position = light < 0 ? vec4(0.0) : light_position[light];
    if (march_rule != MARCH_EQUIANGULAR || position.w == 0.0) { return vec2(fraction, 1.0) * metres; }
    float closest = dot(position.xyz - ray.start, ray.direction);
    float height = max(length(position.xyz - ray.start - closest * ray.direction), 1e-6 * metres);
    float first = atan(-closest, height);
    float angle = atan(metres - closest, height) - first;
    float tangent = tan(first + angle * fraction);
    return vec2(clamp(closest + height * tangent, 0.0, metres), angle * height * (1.0 + tangent * tangent));
}

#if SCATTERS_AGAIN
// Radiance per metre that is scattered towards the beginning of a ray. Events ahead dim what is peaked, as any others do; what
// was turned from the peak has as much scattered into it by them as out of it.
struct Scattered {
    vec3 peaked;
    vec3 turned;
};

// From one light at a point of the ray, however often it was scattered ahead before.
Scattered scattered_from_light(float weights[SLOTS], int light, vec3 point, vec3 direction) {
    LightSample arriving = light_at(light, point);
    if (arriving.irradiance == vec3(0.0)) { return Scattered(vec3(0.0), vec3(0.0)); }
    LightDepth path = light_depth(light, point);
    float cos_scatter = dot(arriving.towards, direction);
    Scattered sum = Scattered(transmittance(path.depth) * scattering_phase(weights, cos_scatter), vec3(0.0));
    vec4 source = light_position[light];
    float metres = dot(path.behind, vec3(1.0)) / max(dot(path.ahead, vec3(1.0)), 1e-30);
    float lever = source.w == 0.0 ? 1.0 : max(1.0 - metres / max(length(point - source.xyz), 1e-30), 0.0);
    for (int slot = 0; slot < SLOTS; ++slot) {
        if (weights[slot] > 0.0 && scattered_ahead[slot].x > 0.0) {
            float g = scattered_ahead[slot].x;
            float straight = scattered_ahead[slot].y;
            vec3 scattering = weights[slot] * slot_scattering[slot].rgb;
            vec3 again = phase_after_scattering(cos_scatter, g, straight, path.ahead, lever);
            sum.peaked += scattering * transmittance(path.depth - path.ahead) * again;
            vec3 turned = scattering * transmittance(path.depth - straight * path.ahead);
            float broad = min(phase_value(slot_phase[slot], cos_scatter), scattered_ahead[slot].w);
            float second = 1.5 * cos_scatter * cos_scatter - 0.5;
            float even = (1.0 - straight + 3.0 * (g - straight) * cos_scatter + 5.0 * max(g * g - straight, 0.0) * second) / (4.0 * PI);
            sum.turned += turned * broad;
            sum.peaked -= turned * (broad + straight * path.ahead * (broad - even));
        }
    }
    vec3 reaching = path.visible * arriving.irradiance;
    return Scattered(reaching * sum.peaked, reaching * sum.turned);
}
#endif

struct Marched {
    vec3 color;  // at the segment's beginning
    vec3 depth;
#if SCATTERS_AGAIN
    vec3 turned;    // of color, by light that events ahead do not dim
    vec3 straight;  // of depth, that by events ahead
    vec3 ahead;     // of depth, that of scattering in media whose scattering ahead is followed
    int slot;       // of the last of these, or -1
#endif
};

#if SCATTERS_AGAIN
#define NOTHING_MARCHED(depth) Marched(vec3(0.0), depth, vec3(0.0), vec3(0.0), vec3(0.0), -1)
#else
#define NOTHING_MARCHED(depth) Marched(vec3(0.0), depth)
#endif

// What a source sends from a step to its beginning. at: metres of its sample, and their derivative by the fraction.
vec3 sent_by_step(vec3 source, vec3 sigma, float begin, float end, vec2 at, vec3 fractions) {
    return march_rule == MARCH_EXPONENTIAL
        ? emitted_radiance(source, sigma, end - begin)
        : source * at.y * (fractions.y - fractions.x) * transmittance(sigma * (at.x - begin));
}

// The steps of one pass: emission and all lights, for variable = -1; or with equal angles one point light, which the first
// pass then leaves out. before: transmittance from the eye to the segment, of all that is not scattered ahead. Where that of all
// channels falls below LEAST_SEEN, sources are not looked for: what is left out is at most this fraction of what comes from there.
Marched march_pass(float weights[SLOTS], int variable, ViewRay ray, float metres, vec3 sigma, vec3 emission, vec3 before) {
    Marched sum = NOTHING_MARCHED(vec3(0.0));
    for (int i = 0; i < march_steps; ++i) {
        vec3 fractions = step_fractions(i);
        float begin = metres_at_fraction(fractions.x, variable, ray, metres).x;
        float end = metres_at_fraction(fractions.y, variable, ray, metres).x;
        vec2 at = metres_at_fraction(fractions.z, variable, ray, metres);
        vec3 source = emission;
#if SCATTERS_AGAIN
        vec3 peaked = vec3(0.0);
        vec3 straight = vec3(0.0);
#endif
#if VARIES
        float here[SLOTS] = weights;
        sigma = source = vec3(0.0);
        for (int slot = 0; slot < SLOTS; ++slot) {
            if (weights[slot] > 0.0 && slot_varies(slot)) {
                here[slot] *= density_at(slot, position_in_box(slot, ray.start + at.x * ray.direction));
            }
            sigma += here[slot] * slot_extinction[slot].rgb;
            source += here[slot] * slot_emission[slot].rgb;
#if SCATTERS_AGAIN
            vec3 scattering = here[slot] * slot_scattering[slot].rgb;
            if (here[slot] > 0.0 && scattered_ahead[slot].x > 0.0) {
                sum.ahead += (end - begin) * scattering;
                straight += scattered_ahead[slot].y * scattering;
                sum.slot = slot;
            }
            if (here[slot] > 0.0) {
                vec3 arriving = scattered_before(slot, ray.start + at.x * ray.direction, -ray.direction);
                source += (1.0 - scattered_ahead[slot].y) * scattering * arriving;
            }
#endif
        }
#if SCATTERS_AGAIN
        vec3 through = transmittance(sum.depth - sum.straight);
        vec3 peak_through = transmittance(sum.depth);
        sum.straight += straight * (end - begin);
#else
        vec3 through = transmittance(sum.depth);
#endif
#else
        float here[SLOTS] = weights;
        sum.depth = sigma * begin;
        vec3 through = transmittance(sum.depth);
#endif
        sum.depth += sigma * (end - begin);
        vec3 transmitted = through * before;
        if (max(transmitted.r, max(transmitted.g, transmitted.b)) < LEAST_SEEN) { continue; }
        if (variable >= 0) { source = vec3(0.0); }
        for (int light = 0; light < scatter_light_count; ++light) {
            bool angular = march_rule == MARCH_EQUIANGULAR && light_position[light].w != 0.0;
            if (angular ? light != variable : variable >= 0) { continue; }
#if SCATTERS_AGAIN
            Scattered found = scattered_from_light(here, light, ray.start + at.x * ray.direction, ray.direction);
            source += found.turned;
            peaked += found.peaked;
#else
            vec3 tau;
            vec4 lit = scattered_here(here, light, ray, at.x, tau);
            source += lit.a * lit.rgb * transmittance(tau);
#endif
        }
#if SCATTERS_AGAIN
        sum.color += peak_through * sent_by_step(peaked, sigma, begin, end, at, fractions);
        sum.turned += through * sent_by_step(source, sigma - straight, begin, end, at, fractions);
#else
        sum.color += through * sent_by_step(source, sigma, begin, end, at, fractions);
#endif
    }
    return sum;
}

Marched marched(float weights[SLOTS], ViewRay ray, float metres, vec3 sigma, vec3 emission, vec3 before) {
    Marched sum = NOTHING_MARCHED(sigma * metres);
    for (int variable = -1; variable < scatter_light_count; ++variable) {
        bool angular = march_rule == MARCH_EQUIANGULAR && light_position[max(variable, 0)].w != 0.0;
        if (variable >= 0 && !angular) { continue; }
        Marched pass = march_pass(weights, variable, ray, metres, sigma, emission, before);
        sum.color += pass.color;
#if VARIES
        if (variable < 0) { sum.depth = pass.depth; }
#if SCATTERS_AGAIN
        sum.turned += pass.turned;
        if (variable < 0) { sum.straight = pass.straight; sum.ahead = pass.ahead; sum.slot = pass.slot; }
#endif
#endif
    }
    ++marched_segments;
    return sum;
}
