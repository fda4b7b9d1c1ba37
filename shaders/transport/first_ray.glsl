// The first ray of a pixel in the tree of traced interfaces: from the first interface, which the rasterizer has found, or from the
// ground that mirrors it. Needs <constants>, <View>, <Surfaces> and ray_step.glsl. FROM_EYE, MIRROR. PAINTED: what the rasterizer
// finds there is not all in the table of objects.

uniform sampler2D entered;             // interface towards the eye: normal, axial depth
uniform sampler2D surface_parameters;  // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;

uniform int enlarges;  // 1: the picture shows some pixels enlarged, each as a block of pixels
uniform vec2 enlarged_pixels[ENLARGED_ACROSS * ENLARGED_ACROSS];  // columns and rows of these pixels, in the order of their blocks

// A pixel of the frame that is drawn.
struct Pixel {
    ivec2 here;        // in what is drawn, whose row 0 is the top one
    ivec2 texel;       // in what the rasterizer has drawn, whose row 0 is the bottom one
    uvec2 number;      // in all of the picture, for random numbers
    vec2 center;       // to the right and down; its sample may be aside of its center
    vec3 direction;
};

uvec2 pixel_number(ivec2 here) {
    return uvec2(vec2(here) + 0.5 + beyond.xy);
}

Pixel pixel_at(ivec2 here) {
    vec2 center = vec2(here) + 0.5;
    vec2 sampled = center + frame_size.zw;
    if (enlarges == 1) {
        ivec2 block = here / PIXEL_PARTS;
        sampled = enlarged_pixels[block.y * ENLARGED_ACROSS + block.x] + (center - vec2(PIXEL_PARTS * block)) / float(PIXEL_PARTS);
    }
    return Pixel(here, ivec2(center.x, frame_size.y - center.y), pixel_number(here), sampled,
        normalize(view_ray(sampled, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz)));
}

bool starts_inside() {
#if FROM_EYE
    return start_interior.x != 0u;
#else
    return false;
#endif
}

#if MIRROR
#include "transport/mirrored_ground.glsl"
#else
const int mirrored = 0;
#endif

bool has_interface(Pixel pixel) {
    return texelFetch(entered, pixel.texel, 0).w < NOTHING;
}

// The first interface of a pixel; of no object where there is none, and where the ground is what is visible. front: as `entered`
// has it; variance: of normals.
PrimaryHit primary_hit(Pixel pixel, out vec4 front, out float variance) {
    front = texelFetch(entered, pixel.texel, 0);
    bool is_there = mirrored == 0 && front.w < NOTHING;
    vec3 point = point_at(pixel.center, front.w);
    vec4 parameters = texelFetch(surface_parameters, pixel.texel, 0);
    variance = parameters.w;
#if ONE_OBJECT && !PAINTED
    ObjectRow body = traced_body(0);
    return PrimaryHit(is_there ? 0 : AIR, point, front.xyz, body.roughness, body.transmission, body.color, 1.0, pixel.number);
#else
    vec4 tint = texelFetch(surface_color, pixel.texel, 0);
    return PrimaryHit(is_there ? int(parameters.x + 0.5) : AIR, point, front.xyz, parameters.y, parameters.z, tint.rgb, tint.a, pixel.number);
#endif
}

// The first ray of a pixel, which starts a little before what the rasterizer has found; false where none does. reach: how far it
// looks for that; reflectance: of the ground that mirrors it.
bool first_ray(Pixel pixel, out Ray ray, out PrimaryHit primary, out float reach, out float variance, out vec3 reflectance) {
    vec4 front;
    primary = primary_hit(pixel, front, variance);
    reach = NOTHING;
    reflectance = vec3(1.0);
#if MIRROR
    if (mirrored == 1) { return !has_interface(pixel) && begin_in_mirror(pixel, ray, reflectance); }
#endif
    if (front.w >= NOTHING && !starts_inside()) { return false; }
    vec3 eye = point_at(pixel.center, surface_eye_axial_depth);
    float margin = min(1e-3 * surface_reach, distance(primary.point, eye));
    ray = Ray(primary.point - margin * pixel.direction, 0.0, pixel.direction, 0.0, vec3(1.0), packed_state(0, FORKS, false, MOST_INTERACTIONS),
        0u, uvec4(0u), -pixel.direction, footprint_of(pixel.center, front.w), NONE_AHEAD);
#if FROM_EYE
    // Something may lie before the first interface.
    ray.origin = point_at(pixel.center, 0.0);
    ray.footprint = footprint_of(pixel.center, starts_inside() ? surface_eye_axial_depth : 0.0);
    if (starts_inside()) {
        ray.skipped = 2.0 * SURFACE_OFFSET * surface_reach;
        ray.origin = eye + ray.skipped * pixel.direction;
        ray.interior = interior_at_eye(eye, pixel.direction, ray.skipped);
    }
#else
    reach = margin + 1e-3 * surface_reach;
#endif
    return true;
}
