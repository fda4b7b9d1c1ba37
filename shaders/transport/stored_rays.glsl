// Rays of a generation in storage buffers: a record of each, as short as the scene allows, and its segment and the pixel that it
// belongs to, which the CPU reads. A segment is where it starts, metres skipped, its direction, and its state. Needs ray_step.glsl and first_ray.glsl.

layout(std430, binding = RAYS_BINDING) readonly buffer Rays { uvec4 rays[]; };
layout(std430, binding = RAY_SEGMENTS_BINDING) readonly buffer RaySegments { vec4 ray_segments[]; };
layout(std430, binding = BRANCHES_BINDING) writeonly buffer Branches { uvec4 branches[]; };
layout(std430, binding = BRANCH_SEGMENTS_BINDING) writeonly buffer BranchSegments { vec4 branch_segments[]; };
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

uniform int ray_vectors;  // of four words, of a record

// A record that is written or read word by word, and in memory vector by vector: software rasterizers go there once for each access.
struct Record {
    int first;      // vector in memory
    int words;
    uvec4 vector;   // the one of the last word
};

void put(inout Record record, uint word) {
    record.vector[record.words & 3] = word;
    if ((++record.words & 3) == 0) { branches[record.first + (record.words >> 2) - 1] = record.vector; }
}
void put(inout Record record, float number) { put(record, floatBitsToUint(number)); }
void put(inout Record record, vec3 vector) { for (int axis = 0; axis < 3; ++axis) { put(record, vector[axis]); } }

void end_record(Record record) {
    if ((record.words & 3) != 0) { branches[record.first + (record.words >> 2)] = record.vector; }
}

void take(inout Record record, out uint word) {
    if ((record.words & 3) == 0) { record.vector = rays[record.first + (record.words >> 2)]; }
    word = record.vector[record.words++ & 3];
}
void take(inout Record record, out float number) {
    uint word;
    take(record, word);
    number = uintBitsToFloat(word);
}
void take(inout Record record, out vec3 vector) { for (int axis = 0; axis < 3; ++axis) { take(record, vector[axis]); } }

void store(int place, Ray ray) {
    branch_segments[2 * place] = vec4(ray.origin, ray.skipped);
    branch_segments[2 * place + 1] = vec4(ray.direction, uintBitsToFloat(ray.state));
    Record at = Record(ray_vectors * place, 0, uvec4(0u));
    put(at, ray.throughput);
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
#if AHEAD
    put(at, ray.ahead.depth);
    put(at, ray.ahead.path);
    put(at, intBitsToFloat(ray.ahead.body));
#endif
#if FOOTPRINTS
    for (int side = 0; side < 2; ++side) {
        put(at, ray.footprint.point[side]);
        put(at, ray.footprint.direction[side]);
    }
#endif
    end_record(at);
}

Ray stored_ray(int place) {
    Ray ray = Ray(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(1.0), 0u, 0u, uvec4(0u), vec3(0.0), no_footprint(), NONE_AHEAD);
    vec4 start = ray_segments[2 * place], along = ray_segments[2 * place + 1];
    ray.origin = start.xyz;
    ray.skipped = start.w;
    ray.direction = along.xyz;
    ray.state = floatBitsToUint(along.w);
    Record at = Record(ray_vectors * place, 0, uvec4(0u));
    take(at, ray.throughput);
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
#if AHEAD
    float body;
    take(at, ray.ahead.depth);
    take(at, ray.ahead.path);
    take(at, body);
    ray.ahead.body = floatBitsToInt(body);
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
