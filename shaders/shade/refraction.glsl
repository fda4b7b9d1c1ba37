// Light along rays that bend at the interface of a body: through its first interval, and out into what is behind.
// Positions count from the center of the media, so that float32 resolves them. Needs <View>, <Surfaces> and background.glsl.
// After Wyman 2005, "An approximate image-space approach for interactive refraction", whose guess of the path's length a
// search along the refracted ray replaces.

#include "shade/environment_beyond.glsl"

uniform sampler2D entered;      // interface towards the eye: normal, axial depth
#if !ONE_INTERFACE
uniform sampler2D left;         // first interface away from it beyond
#endif

const int EXIT_STEPS = 16;
const int EXIT_HALVINGS = 6;
const int OPAQUE_STEPS = 16;
const int OPAQUE_HALVINGS = 5;

#if !ONE_INTERFACE
// Axial depth where the first interval of a pixel ends: on the far interface, or on an opaque surface inside.
float end_of_interval(ivec2 texel) {
    float last = texelFetch(left, texel, 0).w;
#if OPAQUE
    return min(last, texelFetch(opaque_axial_depth, texel, 0).r);
#else
    return last;
#endif
}

bool is_inside(vec3 point) {
    vec3 projected = picture_position(point);
    if (!in_picture(projected.xy)) { return false; }
    ivec2 texel = stored(texel_of(projected.xy));
    float first = texelFetch(entered, texel, 0).w;
    float last = end_of_interval(texel);
    return last < NOTHING && projected.z <= last && (first > last || projected.z >= first);
}

struct Exit {
    float path;    // metres inside
    vec3 normal;   // unit, to the side that the light comes from
    bool stopped;  // on an opaque surface,
    vec3 stop;     // whose radiance is this
};

// Where a ray inside the body leaves it: the first of equal steps outside, halved down, then where the ray hits the
// plane of the visible interface there.
Exit find_exit(vec3 origin, vec3 direction, float longest, vec3 fallback_normal) {
    float inside = 0.0;
    float outside = longest;
    for (int i = 1; i <= EXIT_STEPS; ++i) {
        float path = longest * float(i) / float(EXIT_STEPS);
        if (!is_inside(origin + path * direction)) {
            outside = path;
            break;
        }
        inside = path;
    }
    float margin = outside - inside;
    for (int i = 0; i < EXIT_HALVINGS; ++i) {
        float middle = 0.5 * (inside + outside);
        if (is_inside(origin + middle * direction)) { inside = middle; } else { outside = middle; }
    }
    vec3 projected = picture_position(origin + inside * direction);
    ivec2 texel = texel_of(projected.xy);
    vec4 exit = texelFetch(left, stored(texel), 0);
    Exit result = Exit(0.5 * (inside + outside), fallback_normal, false, vec3(0.0));
#if OPAQUE
    result.stopped = in_picture(projected.xy) && end_of_interval(stored(texel)) < exit.w;
    if (result.stopped) {
        result.stop = texelFetch(opaque_radiance, stored(texel), 0).rgb;
        return result;
    }
#endif
    if (!in_picture(projected.xy) || exit.w >= NOTHING) { return result; }
    result.normal = dot(exit.xyz, direction) > 0.0 ? -exit.xyz : exit.xyz;
    vec3 on_interface = point_at(vec2(texel) + 0.5 + frame_size.zw, exit.w);
    float path = dot(on_interface - origin, exit.xyz) / min(dot(direction, result.normal), -1e-3)
        * sign(dot(exit.xyz, result.normal));
    if (abs(path - inside) < margin && path > 0.0) { result.path = path; }
    return result;
}
#endif

#if OPAQUE
bool is_behind_opaque(vec3 projected) {
    float axial_depth = texelFetch(opaque_axial_depth, stored(texel_of(projected.xy)), 0).r;
    return axial_depth < NOTHING && projected.z >= axial_depth;
}
#endif

// Radiance along a ray that has left a body: opaque surfaces as far as the picture shows them, else the environment.
// roughness: that of a mirror with the same blur.
vec3 radiance_beyond(vec3 point, vec3 direction, float roughness) {
#if OPAQUE
    float before = 0.0;
    for (int i = 1; i <= OPAQUE_STEPS; ++i) {
        float fraction = float(i) / float(OPAQUE_STEPS);
        float path = surface_reach * fraction * fraction;
        vec3 projected = picture_position(point + path * direction);
        if (!in_picture(projected.xy)) { break; }
        float opaque = texelFetch(opaque_axial_depth, stored(texel_of(projected.xy)), 0).r;
        if (opaque < NOTHING && projected.z >= opaque && (projected.z - opaque) * surface_ahead.y <= 2.0 * (path - before)) {
            for (int halving = 0; halving < OPAQUE_HALVINGS; ++halving) {
                float middle = 0.5 * (before + path);
                if (is_behind_opaque(picture_position(point + middle * direction))) { path = middle; } else { before = middle; }
            }
            projected = picture_position(point + path * direction);
            if (roughness == 0.0) { return texelFetch(opaque_radiance, stored(texel_of(projected.xy)), 0).rgb; }
            // Half of the light is within twice the angle of a microfacet, whose tangent is the roughness squared.
            vec4 blurred = blurred_opaque(projected.xy, blur_width(roughness * roughness, path, point + path * direction));
            return blurred.rgb + (1.0 - blurred.a) * environment_beyond(point, direction, roughness);
        }
        before = path;
    }
#endif
    return environment_beyond(point, direction, roughness);
}
