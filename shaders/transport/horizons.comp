// The horizon of each triangle of a mesh: the sine of an elevation above its plane, outwards, such that rays that start on it and rise
// more steeply hit nothing of the mesh. An upper bound: of sines over all points of the triangle and all others. 1: unknown.

#include <constants>

layout(local_size_x = COMPUTE_GROUP) in;

// As in hierarchy.glsl, one order of nodes: software rasterizers read buffers in a tenth of the time that textures take.
layout(std430, binding = MESH_NODES_BINDING) readonly buffer MeshNodes { uvec4 mesh_nodes[]; };
layout(std430, binding = MESH_TRIANGLES_BINDING) readonly buffer MeshTriangles { uvec4 mesh_triangles[]; };
layout(std430, binding = HORIZONS_BINDING) writeonly buffer Horizons { float horizons[]; };

uniform int node_count, triangle_count;
uniform float outwards;        // 1, or -1 where the normals of faces point inwards

const float LOWEST = 0.1;      // horizon: below it few rays leave
const float HIGHEST = 0.8;     // above it few do, and it takes long to find
const float SLACK = 0.05;      // of bounds that are not made tighter
const int SAMPLES = 352;       // corners of the mesh whose sines are found first
const float ROUNDING = 1e-6;   // of corners, which are within -1 to 1; rays start farther above their triangle (SURFACE_OFFSET)

// The triangle: its outward normal, and height along it; middle, and radius around it; the directions in its plane that point out across
// an edge or a corner, and how far it reaches along each. Not one struct: that lies in memory, and takes ten times as long.
vec3 normal, middle, across[6];
float height, radius, reach[6];

vec3 triangle_corner(int triangle, int corner) {
    return uintBitsToFloat(mesh_triangles[3 * triangle + corner].xyz);
}

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

vec3 corner_values(vec3 direction, mat3 corners) {
    return direction * corners;
}

float largest_distance(vec3 point, mat3 corners) {
    return max(distance(point, corners[0]), max(distance(point, corners[1]), distance(point, corners[2])));
}

mat3 corners_of(int triangle) {
    return mat3(triangle_corner(triangle, 0), triangle_corner(triangle, 1), triangle_corner(triangle, 2));
}

void read_triangle(int triangle) {
    mat3 corners = corners_of(triangle);
    normal = outwards * normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
    middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    height = dot(normal, middle) + ROUNDING;
    radius = largest_distance(middle, corners) + ROUNDING;
    vec3 turned = outwards * normal;
    across[0] = normalize(cross(corners[1] - corners[0], turned));
    across[1] = normalize(cross(corners[2] - corners[1], turned));
    across[2] = normalize(cross(corners[0] - corners[2], turned));
    across[3] = normalize(across[0] + across[1]);
    across[4] = normalize(across[1] + across[2]);
    across[5] = normalize(across[2] + across[0]);
    for (int k = 0; k < 6; ++k) { reach[k] = largest(corner_values(across[k], corners)); }
}

// Bound of the sines from a triangle to all points of another, which lies wholly across one of its edges or corners: there these points
// rise no more steeply than its corners do. heights: of the corners; away: less than its distance.
float steepest(mat3 corners, vec3 heights, float away) {
    float slope = 1e6;
    for (int k = 0; k < 6; ++k) {
        vec3 gaps = corner_values(across[k], corners) - reach[k];
        bool beyond = all(greaterThanEqual(gaps, vec3(-ROUNDING)));
        if (beyond) { slope = min(slope, largest(max(heights, vec3(0.0)) / max(gaps - 0.5 * ROUNDING, vec3(1e-9)))); }
    }
    float sine = slope * inversesqrt(1.0 + slope * slope);
    return away > 0.0 ? min(sine, largest(heights) / away) : sine;
}

// The horizon of a triangle, no less than `least`, by all others whose bounds rise above it.
float highest(int triangle, float least) {
    int node = 0, end = node_count;
    float horizon = least;
    while (node < end) {
        uint held = 0u;
        while (node < end) {
            uvec4 found = mesh_nodes[node];
            vec3 low = vec3(found.x & 0xffffu, found.x >> 16, found.y & 0xffffu), high = vec3(found.y >> 16, found.z & 0xffffu, found.z >> 16);
            vec3 half_size = 0.5 * (high - low) / HIERARCHY_STEPS, center = 0.5 * (low + high) / HIERARCHY_STEPS - 1.0;
            float top = dot(normal, center) + dot(abs(normal), half_size) - height;
            float away = length(max(abs(middle - center) - half_size, vec3(0.0))) - radius;
            bool entered = top > 0.0 && top > horizon * away;
            bool leaf = found.w >= 0x80000000u;
            held = leaf && entered ? found.w : 0u;
            node = leaf || entered ? node + 1 : int(found.w);
            if (held != 0u || node >= end) { break; }
        }
        int other = int(held & 0x0fffffffu);
        int last = held == 0u ? other - 1 : other + int(held >> 28 & 7u);
        while (other <= last) {
            mat3 corners = corners_of(other);
            vec3 heights = corner_values(normal, corners) - height, other_middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            float away = distance(other_middle, middle) - largest_distance(other_middle, corners) - radius;
            if (other != triangle && largest(heights) > max(horizon * away, 0.0)) {
                horizon = max(horizon, steepest(corners, heights, away));
            }
            if (++other > last) { break; }
        }
        if (node >= end || horizon > HIGHEST) { break; }
    }
    return horizon;
}

void main() {
    int triangle = int(gl_GlobalInvocationID.x);
    if (triangle >= triangle_count) { return; }
    read_triangle(triangle);
    float least = 0.0;
    for (int other = 0; other < triangle_count; other += max(triangle_count / SAMPLES, 1)) {
        vec3 offset = triangle_corner(other, 0) - middle;
        least = max(least, dot(normal, offset) * inversesqrt(dot(offset, offset) + 1e-12));
    }
    float horizon = max(LOWEST, least + SLACK);
    if (horizon <= HIGHEST) { horizon = highest(triangle, horizon); }
    horizons[triangle] = horizon <= HIGHEST ? 1.001 * horizon : 1.0;  // of a degenerate triangle NaN
}
