// From the accumulated path to what the frame holds: thickness, optical depth, transmittance, radiance, and the mask.
// Row 0 of the output is the top row.
// SPECTRAL: 0: sums are of paths in one medium; 1: of optical depths, with paths beside; 2, 3: of paths in so many media, apart.
// COMPACT: outputs are radiance, and thickness whose sign bit marks what is not valid. All else follows from these, but for
// optical depths in several media.

// What is alike for all pixels, from uniform blocks: see transmittance.vert.
flat in vec4 frame_size;
flat in vec4 ray_right;
flat in vec4 ray_up;
flat in vec4 ray_forward;
flat in vec4 extinction;
flat in vec4 emission;
flat in vec4 balance;
#define coverage_floor extinction.w
#define rounding emission.w
#define expected_count balance.xy
#define count_share balance.z
#if SPECTRAL > 1
flat in vec3 first_extinction;
flat in vec3 second_extinction;
flat in vec3 third_extinction;
#endif
#if SEEN_KIND
flat in vec4 span;
#endif
#if MAP
flat in vec4 corner_and_ahead;
#endif

#include "lib/optics.glsl"
#include "lib/ray.glsl"
#include "thickness/balance.glsl"
#if !SURFACES && !MAP
flat in vec4 beyond;
flat in vec4 seen_first;
flat in vec4 seen_second;
flat in vec4 seen_other;
#define seen_tiles seen_first.w
#define seen_turn seen_second.w
#define seen_scale seen_other.x
// What the environment is like, where that is known beforehand, and 0 where not.
#if SEEN_KIND
#define seen_kind (SEEN_KIND - 1)
#else
#define seen_kind int(seen_other.y)
#endif
#define seen_checkerboard (seen_kind == ENVIRONMENT_CHECKERBOARD)
#include "shade/background.glsl"
#endif

#if ORDERED
uniform sampler2D ordered_depth;
uniform sampler2D ordered_emitted;
uniform sampler2D ordered_layers;
#endif
#if ACCUMULATED
uniform sampler2D accumulated;
#if SPECTRAL == 1
uniform sampler2D accumulated_path;
#endif
#endif
#if FALLBACK
uniform sampler2D fallback;
#if SPECTRAL == 1
uniform sampler2D fallback_path;
#endif
#endif
#if UNLIT
uniform sampler2D unlit;  // paths in media that scatter light which nothing follows
#if SPECTRAL == 1
uniform sampler2D unlit_path;
#endif
#endif
#if SPECTRAL > 1
uniform sampler2D accumulated_second;
#if SPECTRAL == 3
uniform sampler2D accumulated_third;
#endif
#endif
#if MAP
#if OPAQUE
uniform sampler2D opaque_axial_depth;
#endif
layout(location = 0) out vec4 out_sums;
layout(location = 1) out float out_end;
#elif COMPACT
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out float out_marked_thickness;
#if SPECTRAL
layout(location = 2) out vec4 out_optical_depth;
#endif
#else
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;
#if !AVERAGE
layout(location = 2) out vec4 out_optical_depth;
layout(location = 3) out float out_thickness;
layout(location = 4) out float out_flags;
#endif
#endif

struct Path {
    float thickness;
    vec3 optical_depth;
    float count;
};

// advance: metres along the ray per metre along the camera's forward axis.
#if ACCUMULATED || FALLBACK || UNLIT
#if SPECTRAL > 1
#define PATH_OF(sums, lengths) path_of(texelFetch(sums, texel, 0).rg, texel, advance)
Path path_of(vec2 first, ivec2 texel, float advance) {
    vec2 second = texelFetch(accumulated_second, texel, 0).rg;
#if SPECTRAL == 3
    vec2 third = texelFetch(accumulated_third, texel, 0).rg;
#else
    const vec2 third = vec2(0.0);
#endif
    vec3 lengths = vec3(first.r, second.r, third.r) * advance;
    vec3 depth = first_extinction * lengths.r + second_extinction * lengths.g + third_extinction * lengths.b;
    return Path(lengths.r + lengths.g + lengths.b, depth, first.g + second.g + third.g);
}
#elif SPECTRAL == 1
#define PATH_OF(sums, lengths) path_of(texelFetch(sums, texel, 0), texelFetch(lengths, texel, 0).r, advance)
Path path_of(vec4 sum, float lengths, float advance) {
    return Path(lengths * advance, sum.rgb * advance, sum.a);
}
#else
#define PATH_OF(sums, lengths) path_of(texelFetch(sums, texel, 0).rg, advance)
Path path_of(vec2 sum, float advance) {
    return Path(sum.r * advance, sum.r * advance * extinction.rgb, sum.g);
}
#endif
#endif

// What passes before have found along a ray.
struct Found {
    Path path;
    vec3 emitted;  // radiance
    bool valid;
    bool covered;  // a medium was crossed
};

Found found_along(ivec2 texel, float advance) {
    Found found;
    found.emitted = vec3(0.0);
#if ACCUMULATED
    found.path = PATH_OF(accumulated, accumulated_path);
#else
    found.path = Path(0.0, vec3(0.0), 0.0);
#endif
#if ORDERED
    vec4 ordered = texelFetch(ordered_depth, texel, 0);
    vec4 emitted_and_thickness = texelFetch(ordered_emitted, texel, 0);
    // Thin walls have no place in the order: they dim all of it.
    found.emitted = emitted_and_thickness.rgb * transmittance(found.path.optical_depth);
    found.path.optical_depth += ordered.rgb;
    found.path.thickness += emitted_and_thickness.a;
    bool balanced = ordered.a == 1.0 && texelFetch(ordered_layers, texel, 0).b <= rounding;
    float misplaced = 0.0;
#else
    bool balanced = is_balanced(found.path.count);
    float misplaced = misplaced_length(found.path.count, advance);
#endif
    found.valid = balanced && is_length(found.path.thickness, misplaced);
    found.covered = found.path.thickness > coverage_floor || !found.valid;
    if (!found.valid) {
#if FALLBACK
        found.path = PATH_OF(fallback, fallback_path);
#else
        found.path = Path(0.0, vec3(0.0), 0.0);
#endif
        found.emitted = vec3(0.0);
    }
    found.path.thickness = max(found.path.thickness, 0.0);
    found.path.optical_depth = max(found.path.optical_depth, vec3(0.0));
    return found;
}

#if MAP
void write(Found found, vec2 pixel, vec3 ray, ivec2 texel, float advance) {
#if OPAQUE
    float end = texelFetch(opaque_axial_depth, texel, 0).r;
#else
    const float end = NOTHING;
#endif
    out_sums = vec4(found.path.optical_depth / advance, 0.0);
    out_end = end < NOTHING ? corner_and_ahead.z + end * corner_and_ahead.w : NOTHING;
}
#else
void write(Found found, vec2 pixel, vec3 ray, ivec2 texel, float advance) {
    Path path = found.path;
    vec3 through = transmittance(path.optical_depth), emitted = found.emitted;
#if EMISSION
    emitted = emitted_radiance(emission.rgb, extinction.rgb, path.thickness);
#endif
#if SURFACES
    // What is behind is added where rays are refracted.
    out_radiance = vec4(emitted, 1.0);
#else
    out_radiance = vec4(background(pixel, ray, texel) * through + emitted, 1.0);
#endif
#if COMPACT
    // The larger of -0 and 0 may be either.
    out_marked_thickness = uintBitsToFloat((floatBitsToUint(path.thickness) & 0x7fffffffu) | (found.valid ? 0u : 0x80000000u));
#if SPECTRAL
    out_optical_depth = vec4(path.optical_depth, 1.0);
#endif
#else
    out_transmittance = vec4(through, 1.0);
#if !AVERAGE
    out_optical_depth = vec4(path.optical_depth, 1.0);
    out_thickness = path.thickness;
#if UNLIT
    // Thickness and transmittance are as right as ever, and stay; radiance is not.
    found.valid = found.valid && PATH_OF(unlit, unlit_path).thickness <= coverage_floor;
#endif
    out_flags = ((found.covered ? FLAG_COVERED : 0.0) + (found.valid ? FLAG_VALID : 0.0)) / 255.0;
#endif
#endif
}
#endif

void main() {
#if MAP
    vec2 place = gl_FragCoord.xy - corner_and_ahead.xy;
    vec2 pixel = vec2(place.x, frame_size.y - place.y);
    ivec2 texel = ivec2(place);
#else
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
#endif
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
#if SEEN_KIND
    vec2 across = gl_FragCoord.xy * span.xy + span.zw;
    float advance = sqrt(1.0 + dot(across, across));
#else
    float advance = length(ray);
#endif
    write(found_along(texel, advance), pixel, ray, texel, advance);
}
