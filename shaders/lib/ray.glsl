// View rays. Pure. Each function is the float32 twin of the same name in translucent/scene/camera.py.

// Ray through a point of the picture, not normalized: it advances 1 m along the camera's forward axis.
// pixel: right and down from the top left corner, in pixels. right, up: the camera's axes, times half the extent of the
// view at distance 1; zero for an orthographic camera, whose rays are all parallel.
vec3 view_ray(vec2 pixel, vec2 size, vec3 right, vec3 up, vec3 forward) {
    vec2 ndc = 2.0 * pixel / size - 1.0;
    return forward + ndc.x * right - ndc.y * up;
}
