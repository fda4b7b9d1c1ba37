// The nearest surface on a ray, by bounding volume hierarchies: one of each mesh, in coordinates of its own, under one of
// the objects. Nodes lie depth-first with skip links (Smits 1998), so that no stack is needed; their bounds are counted in
// steps of a grid of 16 bits, rounded outwards. Triangles are tested watertight against shared edges (Woop, Benthin &
// Wald 2013, "Watertight Ray/Triangle Intersection"). Written by gpu/hierarchies.py. Needs <constants> and <ObjectRow>.

uniform usampler2D hierarchy_nodes;      // bounds, and link: where to go on, or the triangles of a leaf
uniform usampler2D hierarchy_triangles;  // three texels each: corners, and their normals packed
uniform int object_nodes;                // nodes of the hierarchy of objects, in each order
uniform vec4 objects_frame;              // center and scale of its coordinates

#if ONE_OBJECT
ObjectRow only_body;  // read once for all rays of a pixel
void read_bodies() { only_body = object_table_row(0); }
ObjectRow traced_body(int object) { return only_body; }
#else
void read_bodies() {}
ObjectRow traced_body(int object) { return object_table_row(object); }
#endif

// Half sides of a mesh beyond which a ray starts where it is nearest to the middle instead: farther off, its start is rounded
// to more than the steps by which bounds are larger, and to more than small triangles.
const float FAR_AWAY = 4.0;

struct Hit {
    float path;      // metres; NOTHING where there is none
    int object;
    int triangle;
    vec2 weights;    // of the second and the third corner
};

ivec2 hierarchy_texel(int index) {
    return ivec2(index & ((1 << HIERARCHY_WIDTH_BITS) - 1), index >> HIERARCHY_WIDTH_BITS);
}

// A ray in the coordinates of a hierarchy, whose bounds reach from -1 to 1.
struct LocalRay {
    vec3 start;     // origin in steps of the grid
    vec3 inverse;   // of the direction, in steps
};

float largest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

LocalRay local_ray(vec3 origin, vec3 direction) {
    vec3 away = vec3(direction.x < 0.0 ? -1.0 : 1.0, direction.y < 0.0 ? -1.0 : 1.0, direction.z < 0.0 ? -1.0 : 1.0);
    // As a fraction of the largest: in the coordinates of a huge mesh all are small.
    vec3 inverse = away / max(abs(direction), vec3(1e-12 * largest(abs(direction))));
    return LocalRay((origin + 1.0) * HIERARCHY_STEPS, inverse / HIERARCHY_STEPS);
}

// Order of nodes, one of eight, for the octant of a ray: nearer nodes come first, and so do their bounds.
int octant_of(vec3 direction) {
    return (direction.x < 0.0 ? 1 : 0) + (direction.y < 0.0 ? 2 : 0) + (direction.z < 0.0 ? 4 : 0);
}

// Whether a ray hits the bounds of a node between two distances.
bool hits_bounds(uvec4 node, LocalRay ray, float start, float path) {
    vec3 near = (vec3(node.x & 0xffffu, node.x >> 16, node.y & 0xffffu) - ray.start) * ray.inverse;
    vec3 far = (vec3(node.y >> 16, node.z & 0xffffu, node.z >> 16) - ray.start) * ray.inverse;
    return max(max(near.x, near.y), max(near.z, start)) <= min(min(far.x, far.y), min(far.z, path));
}

// Axes in an order in which the last is the one that the ray goes along most.
vec3 along_last(vec3 v, int axis) {
    return axis == 0 ? v.yzx : axis == 1 ? v.zxy : v;
}

vec3 triangle_corner(int triangle, int corner) {
    return uintBitsToFloat(texelFetch(hierarchy_triangles, hierarchy_texel(3 * triangle + corner), 0).xyz);
}

// A ray in the coordinates of a mesh, as triangles are tested.
struct MeshRay {
    vec3 origin;
    vec3 along;
    float ahead;  // metres from where it starts to its origin
    vec3 shear;
    int axis;
};

MeshRay mesh_ray(ObjectRow place, vec3 origin, vec3 direction) {
    vec3 along = vec3(dot(place.local_x.xyz, direction), dot(place.local_y.xyz, direction), dot(place.local_z.xyz, direction));
    // From the middle of the mesh before anything is multiplied: near a tiny body far from the center little is rounded.
    vec3 offset = origin - vec3(place.local_x.w, place.local_y.w, place.local_z.w);
    vec3 local = vec3(dot(place.local_x.xyz, offset), dot(place.local_y.xyz, offset), dot(place.local_z.xyz, offset));
    float ahead = 0.0;
    if (largest(abs(local)) > FAR_AWAY) {
        float most = largest(abs(along));
        vec3 scaled = along / most;
        ahead = max(-dot(local, scaled) / (dot(scaled, scaled) * most), 0.0);
        local += ahead * along;
    }
    vec3 size = abs(along);
    int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    vec3 turned = along_last(along, axis);
    return MeshRay(local, along, ahead, vec3(turned.xy, 1.0) / turned.z, axis);
}

// Weights of the corners of a triangle in the point where a ray passes its plane, not yet of sum 1, and the path there.
vec3 weights_on_plane(int triangle, MeshRay ray, out float path) {
    vec3 a = along_last(triangle_corner(triangle, 0) - ray.origin, ray.axis);
    vec3 b = along_last(triangle_corner(triangle, 1) - ray.origin, ray.axis);
    vec3 c = along_last(triangle_corner(triangle, 2) - ray.origin, ray.axis);
    a.xy -= ray.shear.xy * a.z;
    b.xy -= ray.shear.xy * b.z;
    c.xy -= ray.shear.xy * c.z;
    // Of an edge both its triangles must find the same weight but for the sign, so no product may stay unrounded in a sum.
    precise vec3 weights = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    path = ray.shear.z * dot(weights, vec3(a.z, b.z, c.z)) / (weights.x + weights.y + weights.z);
    return weights;
}

void intersect_triangle(int triangle, int object, MeshRay ray, float start, inout Hit hit) {
    float path;
    vec3 weights = weights_on_plane(triangle, ray, path);
    float sum = weights.x + weights.y + weights.z;
    if ((any(lessThan(weights, vec3(0.0))) && any(greaterThan(weights, vec3(0.0)))) || sum == 0.0) { return; }
    if (path > start && path < hit.path) { hit = Hit(path, object, triangle, weights.yz / sum); }
}

// The hit on a triangle that a ray is known to hit.
Hit known_hit(int object, int triangle, vec3 origin, vec3 direction) {
    MeshRay ray = mesh_ray(traced_body(object), origin, direction);
    float path;
    vec3 weights = weights_on_plane(triangle, ray, path);
    return Hit(path + ray.ahead, object, triangle, weights.yz / (weights.x + weights.y + weights.z));
}

void intersect_object(int object, vec3 origin, vec3 direction, float start, inout Hit hit) {
    ObjectRow place = traced_body(object);
    MeshRay turned = mesh_ray(place, origin, direction);
    LocalRay ray = local_ray(turned.origin, turned.along);
    start -= turned.ahead;
    Hit own = Hit(hit.path - turned.ahead, -1, -1, vec2(0.0));
    int count = int(place.node_count.x) << 12 | int(place.node_count.y);
    int node = (int(place.first_node.x) << 12 | int(place.first_node.y)) + octant_of(turned.along) * count;
    int end = node + count;
    // Loops are left at the end of their bodies, too: before they find that all rays of a group are through, software rasterizers
    // run a body to its end. (Not by `do` alone: of rays that are through before others Mesa then forgets what they have found.)
    while (node < end) {
        // All rays of a group look for their next leaf, and then test triangles together.
        uint held = 0u;
        while (node < end) {
            uvec4 found = texelFetch(hierarchy_nodes, hierarchy_texel(node), 0);
            bool entered = hits_bounds(found, ray, start, own.path);
            bool leaf = found.w >= 0x80000000u;
            held = leaf && entered ? found.w : 0u;
            node = leaf || entered ? node + 1 : int(found.w);
            if (held != 0u || node >= end) { break; }
        }
        int triangle = int(held & 0x0fffffffu);
        int last = held == 0u ? triangle - 1 : triangle + int(held >> 28 & 7u);
        while (triangle <= last) {
            intersect_triangle(triangle, object, turned, start, own);
            if (++triangle > last) { break; }
        }
        if (node >= end) { break; }
    }
    if (own.object >= 0) { hit = Hit(own.path + turned.ahead, own.object, own.triangle, own.weights); }
}

// Whether an object stands in an interior list (see interior_list.glsl).
bool is_listed(uvec4 list, int object) {
    uvec4 id = uvec4(uint(object + 1));
    return any(equal(list & 0xffffu, id)) || any(equal(list >> 16, id));
}

// The nearest surface between two distances on a ray, of all objects but those in the list `left_out`. Positions count
// from the center of the media.
Hit nearest_hit(vec3 origin, vec3 direction, float start, float end, uvec4 left_out) {
    Hit hit = Hit(end, -1, -1, vec2(0.0));
#if ONE_OBJECT
    intersect_object(0, origin, direction, start, hit);
#else
    LocalRay ray = local_ray((origin - objects_frame.xyz) * objects_frame.w, direction * objects_frame.w);
    int node = octant_of(direction) * object_nodes;
    int last = node + object_nodes;
    while (node < last) {
        int object = -1;
        while (node < last) {
            uvec4 found = texelFetch(hierarchy_nodes, hierarchy_texel(node), 0);
            bool entered = hits_bounds(found, ray, start, hit.path);
            bool leaf = found.w >= 0x80000000u;
            int number = int(found.w & 0x0fffffffu);
            object = leaf && entered && !is_listed(left_out, number) ? number : -1;
            node = leaf || entered ? node + 1 : int(found.w);
            if (object >= 0 || node >= last) { break; }
        }
        if (object >= 0) { intersect_object(object, origin, direction, start, hit); }
        if (node >= last) { break; }
    }
#endif
    return hit;
}

vec3 unpacked_normal(uint packed_normal) {
    vec2 at = (vec2(packed_normal & 0xffffu, packed_normal >> 16) / 32767.5) - 1.0;
    vec3 normal = vec3(at, 1.0 - abs(at.x) - abs(at.y));
    float below = max(-normal.z, 0.0);
    normal.x += normal.x >= 0.0 ? -below : below;
    normal.y += normal.y >= 0.0 ? -below : below;
    return normalize(normal);
}

// Unit normals outwards where a ray has hit: of the smooth surface and of the face.
void hit_normals(Hit hit, out vec3 smooth_normal, out vec3 face_normal) {
    ObjectRow place = traced_body(hit.object);
    uvec4 a = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle), 0);
    uvec4 b = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle + 1), 0);
    uvec4 c = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle + 2), 0);
    vec3 corner = uintBitsToFloat(a.xyz);
    vec3 face = cross(uintBitsToFloat(b.xyz) - corner, uintBitsToFloat(c.xyz) - corner);
    vec3 between = (1.0 - hit.weights.x - hit.weights.y) * unpacked_normal(a.w) + hit.weights.x * unpacked_normal(b.w)
        + hit.weights.y * unpacked_normal(c.w);
    mat3 world = mat3(place.local_x.xyz, place.local_y.xyz, place.local_z.xyz);
    face_normal = place.outwards * normalize(world * normalize(face));
    smooth_normal = place.outwards * normalize(world * between);
}
