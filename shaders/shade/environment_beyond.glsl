// Points of the scene in the picture, and the environment along rays that have left a body. Positions count from the center
// of the media. Needs <View>, <Surfaces>, background.glsl and environment_light.glsl.

// Point at an axial depth on the ray through a pixel.
vec3 point_at(vec2 pixel, float axial_depth) {
    vec2 ndc = 2.0 * pixel / frame_size.xy - 1.0;
    float ahead = surface_ahead.x + axial_depth * surface_ahead.y;
    float spread = surface_right.w == 1.0 ? ahead + surface_ahead.z : 1.0;
    return ahead * ray_forward.xyz + spread * (ndc.x * surface_right.xyz - ndc.y * surface_up.xyz) - surface_off_axis.xyz;
}

// Where a point is in the picture: pixels right and down from the top left corner, and axial depth. Behind the eye: outside
// of it, and nearer than all.
vec3 seen_at(vec3 point) {
    float ahead = dot(point, ray_forward.xyz);
    float spread = surface_right.w == 1.0 ? ahead + surface_ahead.z : 1.0;
    vec3 aside = point + surface_off_axis.xyz;
    vec2 ndc = vec2(dot(aside, surface_right.xyz) / dot(surface_right.xyz, surface_right.xyz),
                    -dot(aside, surface_up.xyz) / dot(surface_up.xyz, surface_up.xyz)) / spread;
    return spread > 0.0 ? vec3(0.5 * (ndc + 1.0) * frame_size.xy, (ahead - surface_ahead.x) / surface_ahead.y)
                        : vec3(-1.0, -1.0, -NOTHING);
}

// The squares of a checkerboard, averaged over a box of this width in squares.
float blurred_checkerboard_share(vec2 at, float tiles, float width) {
    vec2 cell = at * tiles;
    vec2 to_edge = 0.5 - abs(fract(cell) - 0.5);
    vec2 side = 1.0 - 2.0 * mod(floor(cell), 2.0);
    vec2 wave = side * clamp(2.0 * to_edge / max(width, 1e-6), 0.0, 1.0) * clamp(2.0 - width, 0.0, 1.0);
    return 0.5 - 0.5 * wave.x * wave.y;
}

// The environment along a ray that has left a body. A checkerboard stands behind the bodies as a wall across the view.
vec3 environment_beyond(vec3 point, vec3 direction, float roughness) {
#if SEEN_LIGHTS
    return environment_light(direction, roughness);
#else
    if (seen_kind != ENVIRONMENT_CHECKERBOARD) { return seen_environment(vec2(0.0), direction); }
    float towards = dot(direction, ray_forward.xyz);
    if (towards < 1e-2) { return seen_scale * mix(seen_first.rgb, seen_second.rgb, 0.5); }
    float path = max(surface_ahead.w - dot(point, ray_forward.xyz), 0.0) / towards;
    vec3 wall = seen_at(point + path * direction);
    float heights = roughness * roughness * path / (length(surface_up.xyz) * (surface_right.w == 1.0 ? surface_ahead.w + surface_ahead.z : 1.0));
    float share = blurred_checkerboard_share(wall.xy / frame_size.y, seen_tiles, heights * seen_tiles);
    return seen_scale * mix(seen_first.rgb, seen_second.rgb, share);
#endif
}

// The nearest texel: samples aside from the centers of pixels reach past the last ones, where nothing may be fetched.
ivec2 texel_of(vec2 pixel) {
    return ivec2(clamp(floor(pixel - frame_size.zw), vec2(0.0), frame_size.xy - 1.0));
}

bool in_picture(vec2 pixel) {
    return all(greaterThanEqual(pixel, vec2(0.0))) && all(lessThan(pixel, frame_size.xy));
}

// Texel of textures that are stored with row 0 at the bottom.
ivec2 stored(ivec2 texel) {
    return ivec2(texel.x, int(frame_size.y) - 1 - texel.y);
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

// Width in pixels of the blur of what a ray meets at a point, some metres behind a mirror with microfacets of this alpha.
float blur_width(float alpha, float path, vec3 point) {
    float spread = surface_right.w == 1.0 ? dot(point, ray_forward.xyz) + surface_ahead.z : 1.0;
    float pixel = 2.0 * length(surface_up.xyz) * spread / frame_size.y;
    return 4.0 * alpha * path / max(pixel, 1e-30);
}
#endif
