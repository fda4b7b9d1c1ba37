// A walk along a ray from crossing to crossing: what fills each segment, and what it does to light.
// Max 1995, "Optical models for direct volume rendering": a segment of length d with constant extinction and emission
// passes T = exp(-sigma_t d) and adds q / sigma_t (1 - T).

#include "lib/optics.glsl"
#include "intervals/crossing.glsl"
#include "intervals/slots.glsl"
#if SCATTER
#include "volume/in_scatter.glsl"
#endif
#if MARCH
#include "volume/march.glsl"
#endif

#if SLOTS < 1
#error a walk needs a slot
#endif

struct Walk {
    uint axial_step;         // of `axial_steps` to the end of the media
    int winding[SLOTS];      // how often the bodies of each slot are wound around this point
    vec3 optical_depth;
    vec3 emitted;            // radiance: towards the start for a walk that goes on, from the end for one that comes back
    float thickness;
    float inside_out;        // metres with a negative winding number, beyond what silhouettes explain
#if MARCH && SCATTERS_AGAIN
    vec3 turned;             // radiance as emitted, of light that events ahead do not dim
    vec3 straight;           // depth of events ahead
    vec3 ahead;              // depth of scattering in media whose scattering ahead is followed
    int ahead_slot;          // of the last of these, or -1
#endif
};

struct Contents {
    vec3 extinction;
    vec3 emission;
    float count;             // how often thickness counts this point
    bool inside_out;
};

Contents contents(int winding[SLOTS]) {
    Contents mix = Contents(vec3(0.0), vec3(0.0), 0.0, false);
    for (int slot = 0; slot < SLOTS; ++slot) {
        mix.inside_out = mix.inside_out || winding[slot] < 0;
        float weight = float(slot_weight(winding, slot));
        mix.extinction += weight * slot_extinction[slot].rgb;
        mix.emission += weight * slot_emission[slot].rgb;
#if UNION
        mix.count = max(mix.count, weight);
#else
        mix.count += weight;
#endif
    }
    return mix;
}

void add_segment(inout Walk walk, float metres, bool backwards) {
    Contents mix = contents(walk.winding);
    vec3 depth = mix.extinction * metres;
#if EMISSION || SCATTER
    vec3 added = emitted_radiance(mix.emission, mix.extinction, metres);
#if SCATTER
    if (mix.count > 0.0) {
        ViewRay ray = ray_from(float(walk.axial_step) / float(axial_steps()));
        float weights[SLOTS] = slot_weights(walk.winding);
#if MARCH
#if SCATTERS_AGAIN
        vec3 before = transmittance(walk.optical_depth - walk.straight);
#else
        vec3 before = transmittance(walk.optical_depth);
#endif
        Marched march = marched(weights, ray, metres, mix.extinction, mix.emission, before);
        added = march.color;
        depth = march.depth;
#if SCATTERS_AGAIN
        walk.turned = backwards ? walk.turned * transmittance(depth - march.straight) + march.turned : walk.turned + before * march.turned;
        walk.straight += march.straight;
        walk.ahead += march.ahead;
        walk.ahead_slot = max(walk.ahead_slot, march.slot);
#endif
#else
        added += in_scattered(weights, ray, metres, mix.extinction);
#endif
    }
#endif
    if (backwards) {
        walk.emitted = walk.emitted * transmittance(depth) + added;
    } else {
        walk.emitted += transmittance(walk.optical_depth) * added;
    }
#endif
    walk.optical_depth += depth;
    walk.thickness += mix.count * metres;
    walk.inside_out += mix.inside_out ? metres : 0.0;
}

// Goes to a crossing, and over it as many times as there are faces alike.
void cross_surface(inout Walk walk, uint word, int times, bool backwards, float metres_per_step) {
    uint axial_step = crossing_step(word);
    uint steps = backwards ? walk.axial_step - axial_step : axial_step - walk.axial_step;
    if (steps > 0u) {
        add_segment(walk, float(steps) * metres_per_step, backwards);
    }
    walk.axial_step = axial_step;
    int change = crossing_leaves(word) == backwards ? times : -times;
    int crossed = crossing_slot(word);
    for (int slot = 0; slot < SLOTS; ++slot) {
        walk.winding[slot] += slot == crossed ? change : 0;
    }
}

// A walk that starts with the given excess of exits over entries ahead, from which an unknown start is found. As many
// metres as the rasterizer may have misplaced a surface are no surface inside out: next to a silhouette, the two faces that
// join there change their order.
Walk walk_from_start(int excess[SLOTS], float misplaced) {
    Walk walk;
    walk.axial_step = 0u;
    walk.optical_depth = vec3(0.0);
    walk.emitted = vec3(0.0);
    walk.thickness = 0.0;
    walk.inside_out = -misplaced;
#if MARCH && SCATTERS_AGAIN
    walk.turned = vec3(0.0);
    walk.straight = vec3(0.0);
    walk.ahead = vec3(0.0);
    walk.ahead_slot = -1;
#endif
    for (int slot = 0; slot < SLOTS; ++slot) {
        walk.winding[slot] = clamp(excess[slot], int(slot_extinction[slot].w), int(slot_emission[slot].w));
    }
    return walk;
}

float metres_of_a_step(float advance) {
    return media_length * advance / float(axial_steps());
}

// How far two faces may have changed their order, by how much axial depth the steepest of the ray may be misplaced.
float misplaced_metres(float axial_depth, float advance) {
    return 2.0 * axial_depth * media_length * advance;
}

bool is_outside(Walk walk) {
    for (int slot = 0; slot < SLOTS; ++slot) {
        if (walk.winding[slot] != 0) { return false; }
    }
    return true;
}
