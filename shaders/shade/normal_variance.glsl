// Highlights of what is smaller than a pixel: the normals within one are a part of the roughness. Without that, a bent
// mirror shows a light in some pixels and misses it in others, and glitters when it moves.
// Tokuyoshi & Kaplanyan 2019, "Improved Geometric Specular Antialiasing", listing 2, with the normal as the half vector.

const float PIXEL_VARIANCE = 0.15915494;  // squared standard deviation of the pixel's filter, 1 / (2 pi)
const float MOST_NORMAL_VARIANCE = 0.18;

// What the normals within a pixel add to the squared alpha of its microfacets. Takes derivatives.
float normal_variance(vec3 normal) {
    vec3 right = dFdx(normal), up = dFdy(normal);
    return min(2.0 * PIXEL_VARIANCE * (dot(right, right) + dot(up, up)), MOST_NORMAL_VARIANCE);
}
