// Rays of a generation in storage buffers: a record of each, as short as the scene allows, and where it starts, its direction and the
// pixel that it belongs to, which the CPU reads. Needs ray_step.glsl and first_ray.glsl.

layout(std430, binding = RAYS_BINDING) readonly buffer Rays { uint rays[]; };
layout(std430, binding = RAY_SEGMENTS_BINDING) readonly buffer RaySegments { float ray_segments[]; };
layout(std430, binding = BRANCHES_BINDING) writeonly buffer Branches { uint branches[]; };
layout(std430, binding = BRANCH_SEGMENTS_BINDING) writeonly buffer BranchSegments { float branch_segments[]; };
layout(std430, binding = BRANCH_PIXELS_BINDING) writeonly buffer BranchPixels { uint branch_pixels[]; };

const uint NO_RAY = 0xffffffffu;

// Column, row, and channel that alone is traced.
uint packed_pixel(ivec2 here, int channel) {
    return uint(here.x) | uint(here.y) << 15 | uint(channel) << 30;
}

ivec2 pixel_of(uint word) {
    return ivec2(word & 0x7fffu, word >> 15 & 0x7fffu);
}

int channel_of(uint word) {
    return int(word >> 30);
}

uniform int ray_words;   // of a record

void put(inout int at, uint word) { branches[at++] = word; }
void put(inout int at, float number) { put(at, floatBitsToUint(number)); }
void put(inout int at, vec3 vector) { for (int axis = 0; axis < 3; ++axis) { put(at, vector[axis]); } }

void take(inout int at, out uint word) { word = rays[at++]; }
void take(inout int at, out float number) { number = uintBitsToFloat(rays[at++]); }
void take(inout int at, out vec3 vector) { for (int axis = 0; axis < 3; ++axis) { vector[axis] = uintBitsToFloat(rays[at++]); } }

void store(int place, Ray ray) {
    for (int axis = 0; axis < 3; ++axis) {
        branch_segments[6 * place + axis] = ray.origin[axis];
        branch_segments[6 * place + 3 + axis] = ray.direction[axis];
    }
    int at = ray_words * place;
    put(at, ray.throughput);
    put(at, ray.state);
    put(at, ray.skipped);
#if ONE_OBJECT
    put(at, packed_interior(ray.interior));
#else
    for (int word = 0; word < 4; ++word) { put(at, ray.interior[word]); }
#endif
#if MICROFACETS
    put(at, ray.blur);
    put(at, ray.branch_code);
#endif
#if LAYERED || DIFFUSED
    put(at, ray.outwards);
#endif
#if FOOTPRINTS
    for (int side = 0; side < 2; ++side) {
        put(at, ray.footprint.point[side]);
        put(at, ray.footprint.direction[side]);
    }
#endif
}

Ray stored_ray(int place) {
    Ray ray = Ray(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(1.0), 0u, 0u, uvec4(0u), vec3(0.0), no_footprint());
    for (int axis = 0; axis < 3; ++axis) {
        ray.origin[axis] = ray_segments[6 * place + axis];
        ray.direction[axis] = ray_segments[6 * place + 3 + axis];
    }
    int at = ray_words * place;
    take(at, ray.throughput);
    take(at, ray.state);
    take(at, ray.skipped);
#if ONE_OBJECT
    uint count;
    take(at, count);
    ray.interior = unpacked_interior(count);
#else
    for (int word = 0; word < 4; ++word) { take(at, ray.interior[word]); }
#endif
#if MICROFACETS
    take(at, ray.blur);
    take(at, ray.branch_code);
#endif
#if LAYERED || DIFFUSED
    take(at, ray.outwards);
#endif
#if FOOTPRINTS
    for (int side = 0; side < 2; ++side) {
        take(at, ray.footprint.point[side]);
        take(at, ray.footprint.direction[side]);
    }
#endif
    return ray;
}

// Light of rays of one channel, where each is traced for itself.
vec3 of_channel(vec3 light, int channel) {
#if DISPERSION
    if (mirrored == 0) { return light * vec3(equal(ivec3(channel), ivec3(0, 1, 2))); }
#endif
    return light;
}

float lost_of_channel(float lost) {
#if DISPERSION
    if (mirrored == 0) { return lost / 3.0; }
#endif
    return lost;
}
