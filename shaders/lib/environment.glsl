// The procedural environments, as fractions between two radiances, and texture coordinates in pictures of all directions. Pure.
// Each function is the float32 twin of the same name in translucent/scene/environment.py.

#include <constants>

// Share of a gradient's top in a unit direction, +Y up: (1 + y) / 2.
float gradient_share(vec3 direction) {
    return 0.5 + 0.5 * direction.y;
}

// Share of a gradient's top in what a surface with a unit normal receives: the mean of y over its hemisphere, weighted by
// the cosine, is 2/3 of the normal's.
float gradient_irradiance_share(vec3 normal) {
    return 0.5 + normal.y / 3.0;
}

// 1 in the second squares of a checkerboard, else 0. backdrop: right and down from the top left corner of the picture,
// in heights of the picture.
float checkerboard_share(vec2 backdrop, float tiles) {
    vec2 cell = floor(backdrop * tiles);
    return mod(cell.x + cell.y, 2.0);
}

// Texture coordinates of a direction in an equirectangular picture, right and down, 0 to 1; u wraps around. Straight up (+Y) is v = 0,
// -Z is u = 1/2. turn: of the picture about +Y, as a fraction of a full turn, counterclockwise from above.
vec2 equirectangular_uv(vec3 direction, float turn) {
    float away = length(direction.xz);
    float longitude = away > 0.0 ? atan(direction.x, -direction.z) : 0.0;
    return vec2(0.5 + longitude / (2.0 * PI) + turn, atan(away, direction.y) / PI);
}
