// Random numbers of paths: a hash of the pixel, the path, how many it has drawn, and a seed (pcg4d of Jarzynski & Olano
// 2020, "Hash functions for GPU rendering"). A path is the same in whatever order and in however many passes it is followed.

uniform uint seed;

struct Draws {
    uint pixel;
    uint path;
    uint count;
};

uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four numbers between 0 and 1, both excluded.
vec4 random_numbers(inout Draws draws) {
    uvec4 bits = pcg4d(uvec4(draws.pixel, draws.path, draws.count, seed));
    ++draws.count;
    return (vec4(bits >> 9u) + 0.5) / 8388608.0;
}

// Unit vectors that make up a right-handed frame with a third one (Duff et al. 2017, "Building an orthonormal basis,
// revisited").
mat3 frame_around(vec3 axis) {
    float side = axis.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (side + axis.z);
    float b = axis.x * axis.y * a;
    return mat3(vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x),
        vec3(b, side + axis.y * axis.y * a, -axis.y), axis);
}

vec3 turned_by(vec3 direction, float cosine, float turn) {
    float sine = sqrt(max((1.0 - cosine) * (1.0 + cosine), 0.0));
    return normalize(frame_around(direction) * vec3(sine * cos(2.0 * PI * turn), sine * sin(2.0 * PI * turn), cosine));
}
