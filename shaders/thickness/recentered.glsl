// Some rasterizers interpolate between vertices as they moved them onto their grid of sub-pixels. What a pixel then shows is
// a point of the face, but one that is up to half a step of that grid off its ray. This finds where the ray itself meets
// the plane of the face: to first order, and half a step of a grid is small.

// along: of the point that is shown, metres along the camera's axis; shown: its own place in the picture, in pixels, and
// center: that of the pixel, both from any point near them, which saves digits. Before any branch, since derivatives ask
// the neighboring pixels.
float recentered(float along, vec2 shown, vec2 center) {
    vec2 right = dFdx(shown);
    vec2 up = dFdy(shown);
    vec2 slope = vec2(dFdx(along), dFdy(along));
    vec2 missing = center - shown;
    // Steps of the grid change the size of small faces; edge-on ones have no slope to speak of.
    float area = right.x * up.y - right.y * up.x;
    vec2 steps = vec2(missing.x * up.y - missing.y * up.x, right.x * missing.y - right.y * missing.x) / area;
    return abs(area) > 0.25 && all(lessThan(abs(missing), vec2(0.5))) ? along + dot(steps, slope) : along;
}
