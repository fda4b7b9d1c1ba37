// The environment along rays that have left a body. Positions count from the center of the media. Needs <View>, <Surfaces>,
// background.glsl and environment_light.glsl. CHECKERBOARD: the background is one.

#include "shade/in_picture.glsl"

#if CHECKERBOARD
// The squares of a checkerboard, averaged over a box of this width in squares.
float blurred_checkerboard_fraction(vec2 at, float tiles, float width) {
    vec2 cell = at * tiles;
    vec2 to_edge = 0.5 - abs(fract(cell) - 0.5);
    vec2 side = 1.0 - 2.0 * mod(floor(cell), 2.0);
    vec2 wave = side * clamp(2.0 * to_edge / max(width, 1e-6), 0.0, 1.0) * clamp(2.0 - width, 0.0, 1.0);
    return 0.5 - 0.5 * wave.x * wave.y;
}
#endif

// The environment along a ray that has left a body. A checkerboard stands behind the bodies as a wall across the view.
vec3 environment_beyond(vec3 point, vec3 direction, float roughness) {
#if SEEN_LIGHTS
    return environment_light(direction, roughness);
#elif CHECKERBOARD
    float towards = metres_ahead_of(direction);
    if (towards < 1e-2) { return seen_scale * mix(seen_first.rgb, seen_second.rgb, 0.5); }
    float path = max(surface_ahead.w - metres_ahead_of(point), 0.0) / towards;
    vec3 wall = picture_position(point + path * direction);
    float whole = (frame_size.y + beyond.w) / frame_size.y;
    float heights = roughness * roughness * path / (whole * length(surface_up.xyz) * (surface_right.w == 1.0 ? surface_ahead.w + surface_ahead.z : 1.0));
    float fraction = blurred_checkerboard_fraction(in_heights(wall.xy), seen_tiles, heights * seen_tiles);
    return seen_scale * mix(seen_first.rgb, seen_second.rgb, fraction);
#else
    return seen_scale * mix(seen_first.rgb, seen_second.rgb, gradient_share(direction));
#endif
}

#if OPAQUE
// Opaque surfaces around a point of the picture, and how much of it they fill. width: of the blur, in pixels.
vec4 blurred_opaque(vec2 pixel, float width) {
    vec2 at = (pixel - frame_size.zw) / frame_size.xy;
    at.y = 1.0 - at.y;  // stored with row 0 at the bottom
    // Four squares of half the width, so that the steps between the texels of a coarse level do not show.
    vec2 aside = 0.25 * width / frame_size.xy;
    float level = max(log2(0.5 * width), 0.0);
    return 0.25 * (textureLod(opaque_radiance, at + aside, level) + textureLod(opaque_radiance, at - aside, level)
        + textureLod(opaque_radiance, at + vec2(aside.x, -aside.y), level)
        + textureLod(opaque_radiance, at + vec2(-aside.x, aside.y), level));
}

// Width in pixels of the blur of what a ray hits at a point, some metres behind a mirror with microfacets of this alpha.
float blur_width(float alpha, float path, vec3 point) {
    float spread = surface_right.w == 1.0 ? metres_ahead_of(point) + surface_ahead.z : 1.0;
    float pixel = 2.0 * length(surface_up.xyz) * spread / frame_size.y;
    return 4.0 * alpha * path / max(pixel, 1e-30);
}
#endif
