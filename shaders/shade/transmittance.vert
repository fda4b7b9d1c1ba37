// One triangle that covers the frame, with what is alike for all of its pixels: software rasterizers look each uniform up for
// each pixel, which took longer than the shading itself. Varyings that nothing interpolates cost them next to nothing.
// There are few of them, so scalars are in fourth components. Switches are those of transmittance.frag.

#include <View as view>
#include <Shade as shade>
#if !SURFACES && !MAP
#include <Environment as environment>
#endif

flat out vec4 frame_size;
flat out vec4 ray_right;
flat out vec4 ray_up;
flat out vec4 ray_forward;
flat out vec4 extinction;  // w: coverage_floor
flat out vec4 emission;    // w: rounding
flat out vec4 balance;     // expected_count; count_share
#if !SURFACES && !MAP
flat out vec4 beyond;
flat out vec4 seen_first;   // w: seen_tiles
flat out vec4 seen_second;  // w: seen_turn
flat out vec4 seen_other;   // seen_scale, seen_kind
#endif
#if SPECTRAL > 1
uniform mat3 media_extinction;  // a column for each medium, in 1/m
flat out vec3 first_extinction;
flat out vec3 second_extinction;
flat out vec3 third_extinction;
#endif
#if SEEN_KIND
// Of a ray, to the right and down from the camera's axis at distance 1, per pixel and at the corner of the picture.
uniform vec4 view_span;
flat out vec4 span;
#endif
#if MAP
// For a map of shadows: its corner, and metres ahead of the center at axial depth 0, and from there to 1.
uniform vec4 map_place;
flat out vec4 corner_and_ahead;
#endif

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
    frame_size = view.frame_size;
    ray_right = view.ray_right;
    ray_up = view.ray_up;
    ray_forward = view.ray_forward;
    extinction = vec4(shade.extinction.rgb, shade.coverage_floor);
    emission = vec4(shade.emission.rgb, shade.rounding);
    balance = vec4(shade.expected_count, shade.count_share, 0.0);
#if !SURFACES && !MAP
    beyond = view.beyond;
    seen_first = vec4(environment.seen_first.rgb, environment.seen_tiles);
    seen_second = vec4(environment.seen_second.rgb, environment.seen_turn);
    seen_other = vec4(environment.seen_scale, float(environment.seen_kind), 0.0, 0.0);
#endif
#if SPECTRAL > 1
    first_extinction = media_extinction[0];
    second_extinction = media_extinction[1];
    third_extinction = media_extinction[2];
#endif
#if SEEN_KIND
    span = view_span;
#endif
#if MAP
    corner_and_ahead = map_place;
#endif
}
