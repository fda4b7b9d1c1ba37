// Some rasterizers interpolate between vertices as they moved them onto their grid of sub-pixels. What a pixel then shows is
// a point of the face, but one that is up to half a step of that grid off its ray. This finds where the ray itself hits
// the plane of the face: to second order, and half a step of a grid is small.

// along: of the visible point, metres along the camera's axis; missing: pixels from it to the center of the pixel;
// step_of_grid: in pixels; longest: metres. x: along on the ray itself; y: snapping(along, step_of_grid). Before any branch,
// since derivatives ask the neighboring pixels. A face is nearly edge-on, and narrower than a pixel, if its plane is further
// off than longest: the ray passes beside it, and the visible point is the best that there is.
vec2 recentered(float along, vec2 missing, float step_of_grid, float longest) {
    vec2 slope = vec2(dFdx(along), dFdy(along));
    float most = (abs(slope.x) + abs(slope.y)) * step_of_grid;
    // The second part: the grid stretches and rotates small faces, and their slopes.
    vec2 steps = missing + dFdx(missing) * missing.x + dFdy(missing) * missing.y;
    float change = clamp(dot(steps, slope), -most, most);
    return vec2(abs(change) > longest ? along : along + change, most);
}
