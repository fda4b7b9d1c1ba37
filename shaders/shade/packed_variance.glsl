// What a sample averages highlights over, and a symmetric matrix of two rows as a picture stores it in one number.

// Filters of one sample in the middle of each pixel, in pixels. Samples find the light of a smaller light with a standard error of
// 4 % by GGX of this squared alpha (2 / pi), and of 0.7 % by (1 - r^2)^3 of this radius.
const float PIXEL_ALPHA = 0.6366198;
const float PIXEL_RADIUS = 1.2;

uniform float sample_area;  // in pixels

// Filter of the highlights of a sample. All zero: none.
struct SampleFilter {
    vec3 normals;  // squared alpha of the normals within it, as a symmetric matrix (xx, xy, yy) in `projection`
    float width;   // of the filter of half vectors, in metres across the ray: that of a pixel for one sample
    float turn;    // the same as an angle between rays, in radians
};

const SampleFilter NO_FILTER = SampleFilter(vec3(0.0), 0.0, 0.0);

// Width of the filter of half vectors, in pixels. Of several samples at low-discrepancy points it has eight times their area: its
// standard error is then at most 2 %.
float filter_width() { return sqrt(min(8.0 * sample_area, 1.0)); }

const float LEAST_PACKED = 24.0;  // octaves below 1

// Projection along a ray onto the plane across it, in two axes.
mat3x2 projection(vec3 ray) {
    vec3 right = normalize(abs(ray.x) < 0.7 ? cross(ray, vec3(1.0, 0.0, 0.0)) : cross(ray, vec3(0.0, 1.0, 0.0)));
    return transpose(mat2x3(right, cross(ray, right)));
}

// By 8 bits each: logarithm of the larger eigenvalue, root of the ratio of both, and the angle of the axis.
float packed_variance(vec3 variance) {
    float middle = 0.5 * (variance.x + variance.z), aside = 0.5 * (variance.x - variance.z), off = length(vec2(aside, variance.y));
    if (middle < exp2(-LEAST_PACKED)) { return 0.0; }
    float larger = clamp((log2(middle + off) / LEAST_PACKED + 1.0) * 255.0, 1.0, 255.0);
    float ratio = sqrt(clamp((middle - off) / (middle + off), 0.0, 1.0)) * 255.0;
    float angle = off > 0.0 ? fract(0.5 * atan(variance.y, aside) / PI) * 256.0 : 0.0;
    // An angle that rounds to half a turn is that of none: carried over, it would turn a round average into a line.
    return dot(vec3(floor(vec2(larger, ratio) + 0.5), mod(floor(angle + 0.5), 256.0)), vec3(65536.0, 256.0, 1.0));
}

vec3 unpacked_variance(float stored) {
    if (stored == 0.0) { return vec3(0.0); }
    vec3 bytes = mod(floor(stored * vec3(1.0 / 65536.0, 1.0 / 256.0, 1.0)), 256.0);
    float larger = exp2((bytes.x / 255.0 - 1.0) * LEAST_PACKED), smaller = larger * bytes.y * bytes.y / (255.0 * 255.0);
    vec2 axis = vec2(cos(bytes.z * PI / 256.0), sin(bytes.z * PI / 256.0));
    return vec3(smaller, 0.0, smaller) + (larger - smaller) * vec3(axis.x * axis.x, axis.x * axis.y, axis.y * axis.y);
}
