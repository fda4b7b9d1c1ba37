// Points of the scene in the picture, and texels of the picture. Positions count from the center of the media. Needs
// <constants>, <View> and <Surfaces>.

// From the camera's axis to the center of the picture, at distance 1 or in metres: it may be a part of a larger one. In
// perspective ray_forward goes to that center, and surface_off_axis begins beside the axis.
vec3 center_aside() {
    return surface_off_axis.w * surface_right.xyz + surface_up.w * surface_up.xyz;
}

// Metres ahead of the center of the media, along the camera's axis.
float metres_ahead_of(vec3 point) {
    return dot(point, surface_right.w == 1.0 ? ray_forward.xyz - center_aside() : ray_forward.xyz);
}

// Metres across a pixel, at a distance from the eye.
float pixel_metres(float away) {
    return 2.0 * length(surface_up.xyz) * (surface_right.w == 1.0 ? away : 1.0) / frame_size.y;
}

// Point at an axial depth on the ray through a pixel.
vec3 point_at(vec2 pixel, float axial_depth) {
    vec2 ndc = 2.0 * pixel / frame_size.xy - 1.0;
    float ahead = surface_ahead.x + axial_depth * surface_ahead.y;
    bool perspective = surface_right.w == 1.0;
    float spread = perspective ? ahead + surface_ahead.z : 1.0;
    vec3 aside = perspective ? vec3(0.0) : center_aside();
    return ahead * ray_forward.xyz + spread * (ndc.x * surface_right.xyz - ndc.y * surface_up.xyz) + aside - surface_off_axis.xyz;
}

// Where a point is in the picture: pixels right and down from the top left corner, and axial depth. Behind the eye: outside
// of it, and nearer than all.
vec3 picture_position(vec3 point) {
    float ahead = metres_ahead_of(point);
    bool perspective = surface_right.w == 1.0;
    float spread = perspective ? ahead + surface_ahead.z : 1.0;
    vec3 aside = point + surface_off_axis.xyz - (perspective ? ahead : 1.0) * center_aside();
    vec2 ndc = vec2(dot(aside, surface_right.xyz) / dot(surface_right.xyz, surface_right.xyz),
                    -dot(aside, surface_up.xyz) / dot(surface_up.xyz, surface_up.xyz)) / spread;
    return spread > 0.0 ? vec3(0.5 * (ndc + 1.0) * frame_size.xy, (ahead - surface_ahead.x) / surface_ahead.y)
                        : vec3(-1.0, -1.0, -NOTHING);
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
