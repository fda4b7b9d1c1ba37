// How dense the medium of each slot is at a point, where that varies, and on the mean along a line. Points count from the
// center of the media, positions are those in the unit box of the slot's body.

#include <Density>
#include <constants>
#include "lib/density.glsl"

uniform sampler3D density_grids;  // all of them, one behind the other along z

bool slot_varies(int slot) {
    return density_profile[slot].x != 0.0;
}

vec3 position_in_box(int slot, vec3 point) {
    vec4 here = vec4(point, 1.0);
    return vec3(
        dot(density_rows[3 * slot], here), dot(density_rows[3 * slot + 1], here), dot(density_rows[3 * slot + 2], here)
    );
}

// The corners of the cell of voxels whose lower corner is the center of this voxel. Filters of hardware have but 8 bits.
void grid_corners(int slot, ivec3 voxel, out vec4 low, out vec4 high) {
    ivec3 size = ivec3(density_grid[slot].xyz);
    ivec3 behind = ivec3(0, 0, int(density_grid[slot].w));
    ivec3 a = clamp(voxel, ivec3(0), size - 1) + behind;
    ivec3 b = clamp(voxel + 1, ivec3(0), size - 1) + behind;
    low = vec4(
        texelFetch(density_grids, ivec3(a.x, a.y, a.z), 0).r, texelFetch(density_grids, ivec3(a.x, a.y, b.z), 0).r,
        texelFetch(density_grids, ivec3(a.x, b.y, a.z), 0).r, texelFetch(density_grids, ivec3(a.x, b.y, b.z), 0).r
    );
    high = vec4(
        texelFetch(density_grids, ivec3(b.x, a.y, a.z), 0).r, texelFetch(density_grids, ivec3(b.x, a.y, b.z), 0).r,
        texelFetch(density_grids, ivec3(b.x, b.y, a.z), 0).r, texelFetch(density_grids, ivec3(b.x, b.y, b.z), 0).r
    );
}

float density_at(int slot, vec3 position) {
    vec4 profile = density_profile[slot];
    if (profile.x == DENSITY_LINEAR) { return linear_density(position[int(profile.y)], profile.z, profile.w); }
    if (profile.x == DENSITY_EXPONENTIAL) { return exponential_density(position[int(profile.y)], profile.z, profile.w); }
    vec3 size = density_grid[slot].xyz;
    vec3 voxels = clamp(position * size - 0.5, vec3(0.0), size - 1.0);
    vec4 low, high;
    grid_corners(slot, ivec3(voxels), low, high);
    return trilinear(low, high, voxels - floor(voxels));
}

// Mean density of a grid on a straight line. Between the planes through the centers of voxels it is a cubic of the position
// on the line, which two Gauss points integrate exactly.
float grid_mean(int slot, vec3 start, vec3 end) {
    vec3 size = density_grid[slot].xyz;
    vec3 last = size - 1.0;
    vec3 from = start * size - 0.5;
    vec3 along = end * size - 0.5 - from;
    vec3 per_voxel = 1.0 / max(abs(along), vec3(1e-30));
    // The next planes on the line. Beyond the outermost there is none.
    vec3 plane = mix(max(floor(from) + 1.0, 0.0), min(ceil(from) - 1.0, last), lessThan(along, vec3(0.0)));
    float sum = 0.0;
    float t = 0.0;
    // Each turn passes a plane or reaches the end.
    int most = int(size.x + size.y + size.z) + 1;
    for (int turn = 0; turn < most && t < 1.0; ++turn) {
        vec3 at = mix(abs(plane - from) * per_voxel, vec3(2.0), notEqual(plane, clamp(plane, vec3(0.0), last)));
        float next = min(min(at.x, at.y), min(at.z, 1.0));
        vec3 middle = from + along * (0.5 * (t + next));
        vec3 aside = along * ((next - t) * 0.28867513);  // 1 / (2 sqrt 3)
        vec3 cell = floor(clamp(middle, vec3(0.0), last));
        vec4 low, high;
        grid_corners(slot, ivec3(cell), low, high);
        float before = trilinear(low, high, clamp(middle - aside, vec3(0.0), last) - cell);
        float after = trilinear(low, high, clamp(middle + aside, vec3(0.0), last) - cell);
        sum += 0.5 * (next - t) * (before + after);
        t = next;
        plane += sign(along) * vec3(lessThanEqual(at, vec3(next)));
    }
    return sum;
}

// Mean density on a straight line between two positions; exact for each kind of density.
float mean_density(int slot, vec3 start, vec3 end) {
    vec4 profile = density_profile[slot];
    int axis = int(profile.y);
    if (profile.x == DENSITY_LINEAR) {
        return 0.5 * (linear_density(start[axis], profile.z, profile.w) + linear_density(end[axis], profile.z, profile.w));
    }
    if (profile.x == DENSITY_EXPONENTIAL) {
        return exponential_density_mean(start[axis], end[axis], profile.z, profile.w);
    }
    return grid_mean(slot, start, end);
}
