// Photons of a light, the next surface of each live one: the CPU has found what they hit, and lists those that hit anything. Each
// has a place of its own, so nothing depends on the order in which invocations run. BEGINS: they begin.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

#include <View>
#include <Surfaces>
#include <ObjectRow>
#include "transport/photon_step.glsl"

layout(std430, binding = PHOTONS_BINDING) buffer Photons { uint photons[]; };               // rows of the state of each place
layout(std430, binding = LIVE_PHOTONS_BINDING) readonly buffer LivePhotons { int live_photons[]; };  // rows: place, object and triangle of its hit
layout(std430, binding = PHOTON_SEGMENTS_BINDING) writeonly buffer PhotonSegments { float photon_segments[]; };  // origins, then directions: 0 where it ends

layout(rgba32f) uniform writeonly restrict image2D landed_point;  // from the center of the media; w: 1 where it has landed
layout(rgba32f) uniform writeonly restrict image2D landed_power;
layout(rgba32f) uniform writeonly restrict image2D landed_normal;

uniform uint first_photon;   // number of that in the first place, among all of the aim
uniform int first_live, live_count;  // of those that this run is of, and the last of them + 1
uniform int photon_room;     // places

void put(int row, int place, uint word) { photons[row * photon_room + place] = word; }
void put(int row, int place, vec3 vector) { for (int axis = 0; axis < 3; ++axis) { put(row + axis, place, floatBitsToUint(vector[axis])); } }
uint taken(int row, int place) { return photons[row * photon_room + place]; }
vec3 taken_vector(int row, int place) { return uintBitsToFloat(uvec3(taken(row, place), taken(row + 1, place), taken(row + 2, place))); }

const uint BENT = 1u << 31;

void store(int place, Photon photon, vec3 power, Draws draws) {
    put(0, place, photon.origin);
    put(3, place, photon.direction);
    put(6, place, photon.throughput);
    put(9, place, power);
    put(12, place, floatBitsToUint(photon.skipped));
    put(13, place, draws.count | (photon.bent ? BENT : 0u));
    put(14, place, floatBitsToUint(photon.choice));
#if ONE_OBJECT
    put(15, place, packed_interior(photon.interior));
#else
    for (int word = 0; word < 4; ++word) { put(15 + word, place, photon.interior[word]); }
#endif
}

Photon stored_photon(int place, out vec3 power, inout Draws draws) {
    uint counted = taken(13, place);
    draws.count = counted & ~BENT;
    power = taken_vector(9, place);
    Photon photon = Photon(taken_vector(0, place), uintBitsToFloat(taken(12, place)), taken_vector(3, place), taken_vector(6, place),
        uintBitsToFloat(taken(14, place)), uvec4(0u), (counted & BENT) != 0u, false);
#if ONE_OBJECT
    photon.interior = unpacked_interior(taken(15, place));
#else
    for (int word = 0; word < 4; ++word) { photon.interior[word] = taken(15 + word, place); }
#endif
    return photon;
}

void main() {
    int at = first_live + int(gl_GlobalInvocationID.x);
    if (at >= live_count) { return; }
    read_bodies();
#if BEGINS
    uint number = first_photon + uint(at);
    Draws draws = Draws(number, aim, 0u);
    vec3 power;
    Photon photon = begun(number, draws, power);
    bool lives = power != vec3(0.0);
    store(at, photon, power, draws);
#else
    int place = live_photons[at];
    uint number = first_photon + uint(place);
    Draws draws = Draws(number, aim, 0u);
    vec3 power;
    Photon photon = stored_photon(place, power, draws);
    Hit hit = known_hit(live_photons[photon_room + at], live_photons[2 * photon_room + at], photon.origin, photon.direction);
    Landing landing = Landing(vec3(0.0), vec3(0.0), false);
    bool lives = follow(photon, hit, channel_of(number), draws, landing);
    if (landing.there) {
        ivec2 texel = ivec2(uint(place) % PHOTON_WIDTH, uint(place) / PHOTON_WIDTH);
        imageStore(landed_point, texel, vec4(landing.point, 1.0));
        imageStore(landed_power, texel, vec4(power * photon.throughput, 1.0));
        imageStore(landed_normal, texel, vec4(landing.normal, 0.0));
    }
    if (lives) { store(place, photon, power, draws); }
#endif
    vec3 direction = lives ? photon.direction : vec3(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        photon_segments[3 * at + axis] = photon.origin[axis];
        photon_segments[3 * (photon_room + at) + axis] = direction[axis];
    }
}
