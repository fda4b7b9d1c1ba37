// Surfaces that a ray hits in one place: of solids, thin walls and opaque objects. Needs <constants>, <Surfaces>, <ObjectRow>,
// lib/optics.glsl, lib/interface.glsl, hierarchy.glsl and interior_list.glsl. FROM_EYE: rays may start inside bodies, or before
// others without an interface. THIN_WALLS: some objects are thin walls, or absorb as such. ONE_SURFACE: the hit is given, and no surface of another object lies there.

#if FROM_EYE
uniform uvec4 start_interior;  // the bodies that the eye is in
#endif

const int MOST_STEPS = 512;

// Metres along a ray within which surfaces lie in one place.
float path_within(vec3 direction, vec3 face_normal) {
    return SURFACE_OFFSET * surface_reach / max(abs(dot(direction, face_normal)), 1e-2);
}

float body_index(ObjectRow body, int channel) {
#if DISPERSION
    return channel_iors(body.ior, body.dispersion)[channel];
#else
    return body.ior;
#endif
}

float index_of(int body, int channel) {
    if (body == AIR) { return 1.0; }
    return body_index(traced_body(body), channel);
}

// Base color of an opaque object at a point, as far as it is no texture's.
vec3 base_color(ObjectRow body, vec3 point) {
    if (body.fading.z == 0.0) { return body.color; }
    vec3 offset = point - vec3(body.local_x.w, body.local_y.w, body.local_z.w);
    float radius = length(vec3(dot(body.local_x.xyz, offset), dot(body.local_y.xyz, offset), dot(body.local_z.xyz, offset)));
    return body.color * (1.0 - body.fading.z * smoothstep(body.fading.x, body.fading.y, radius));
}

// All surfaces that a ray hits in one place; solids are crossed together, and their interface is one.
struct SurfaceHit {
    int object;          // whose interface it is: of the solid that is entered, else of that left, else of a thin wall; or opaque
    bool outside;        // its outer side is hit
    int triangle;
    vec2 weights;        // of its second and third corner
    vec3 smooth_normal;  // towards the ray, as is face_normal
    vec3 face_normal;
    uvec4 interior;      // list beyond
    float path;          // to the last of its surfaces
    vec3 transmittance;  // of absorbers that lie there
    vec3 emitted;        // radiance that these add
};

// The interior list beyond a surface of a solid. sound: not yet unbalanced, nor longer than a list can be.
uvec4 crossed_interior(uvec4 interior, int object, bool enters, inout bool sound) {
    bool missing = false;
    uvec4 crossed = enters ? entered_interior(interior, object) : left_interior(interior, object, missing);
    sound = sound && !missing && !(enters && is_full(interior));
    return crossed;
}

// Normals of a surface, turned to face the ray that hits it, and whether that is on its outer side.
void hit_sides(Hit hit, vec3 direction, out vec3 smooth_normal, out vec3 face_normal, out bool outside) {
    hit_normals(hit, smooth_normal, face_normal);
    outside = dot(face_normal, direction) < 0.0;
    if (!outside) {
        face_normal = -face_normal;
        smooth_normal = -smooth_normal;
    }
}

// Whether the step from one medium to another does anything to light.
bool alters_light(int before, int after, int channel) {
    if (before == after) { return false; }
    float ior = 1.0;
    bool plain = true;
    if (before != AIR) {
        ObjectRow body = traced_body(before);
        ior = body_index(body, channel);
        plain = body.plain != 0.0;
    }
    float ior_after = 1.0;
    if (after != AIR) {
        ObjectRow body = traced_body(after);
        ior_after = body_index(body, channel);
        plain = plain && body.plain != 0.0;
    }
    return ior != ior_after || !plain;
}

bool is_thin_wall(ObjectRow body) {
#if THIN_WALLS
    return int(body.type) == TYPE_THIN_WALL;
#else
    return false;
#endif
}

// Thin wall that only absorbs and emits.
void pass_absorber(ObjectRow wall, float cosine, inout vec3 emitted, inout vec3 throughput) {
    float through = 1.0 / max(refracted_cosine(cosine, wall.ior), MIN_THIN_LAYER_COSINE);
#if EMISSION == 1
    emitted += throughput * emitted_radiance(wall.emission, wall.extinction, through);
#endif
    throughput *= transmittance(wall.extinction * through);
}

#if !ONE_SURFACE
uniform vec3 contact_low;   // bounds of all places in which surfaces of two objects may lie together
uniform vec3 contact_high;

bool may_touch(vec3 point) {
    return all(greaterThanEqual(point, contact_low)) && all(lessThanEqual(point, contact_high));
}
#endif

const int UNKNOWN = -2;  // object of a hit that is still to be found

// The hit for `surface_hit` to begin with, between two distances on a ray: of several objects it is looked for there, in the loop
// that finds what lies in the same place, so that compilers have one search less to inline.
Hit first_hit(vec3 origin, vec3 direction, float start, float end) {
#if ONE_OBJECT
    return nearest_hit(origin, direction, start, end, uvec4(0u));
#else
    return Hit(end, UNKNOWN, -1, vec2(0.0));
#endif
}

// All surfaces where a ray has hit the first. A thin wall that lies on the interface of a solid only absorbs. first: the hit, of
// whatever has found it, or that of `first_hit`, which is then found from `start` on; of no object where there is none.
SurfaceHit surface_hit(vec3 origin, vec3 direction, uvec4 interior, float start, inout Hit first, int before, int channel, inout bool sound) {
    SurfaceHit found = SurfaceHit(AIR, false, 0, vec2(0.0), vec3(0.0), vec3(0.0), interior, 0.0, vec3(1.0), vec3(0.0));
    Hit hit = first;
    float end = first.path;
    int rank = -1;  // of what decides: 0 a thin wall, 1 a solid, 2 what is opaque
    uvec4 done = uvec4(0u);
    for (int surface = 0; surface < INTERIOR_SIZE; ++surface) {
#if !ONE_SURFACE
        if (hit.object == UNKNOWN) { hit = nearest_hit(origin, direction, start, end, done); }
        if (surface == 0) { first = hit; }
#endif
        if (hit.object < 0) { break; }
        ObjectRow body = traced_body(hit.object);
        int type = int(body.type);
        vec3 smooth_normal, face_normal;
        bool outside;
        hit_sides(hit, direction, smooth_normal, face_normal, outside);
        float across = -dot(face_normal, direction);
        bool decides = surface == 0;
        if (type == TYPE_SOLID) { found.interior = crossed_interior(found.interior, hit.object, outside, sound); }
        int now = effective_medium(found.interior);
        bool altered = alters_light(before, now, channel);
        if (type == TYPE_SOLID) {
#if THIN_WALLS
            if (rank == 0 && altered) {
                pass_absorber(traced_body(found.object), -dot(found.face_normal, direction), found.emitted, found.transmittance);
                rank = -1;
            }
#endif
            decides = decides || rank < 0 || (rank == 1 && (now == hit.object || (before == hit.object && now != found.object)));
            rank = rank == 0 ? 0 : 1;
        } else if (type == TYPE_OPAQUE && (outside || body.one_sided == 0.0)) {
            decides = true;
            rank = 2;
        }
#if THIN_WALLS
        else if (type == TYPE_THIN_WALL && (rank < 0 || (rank == 1 && !altered))) {
            decides = true;
            rank = 0;
        } else if (type == TYPE_THIN_WALL || type == TYPE_ABSORBER) {
            pass_absorber(body, across, found.emitted, found.transmittance);
        }
#endif
        if (decides) {
            found.object = hit.object;
            found.outside = outside;
            found.triangle = hit.triangle;
            found.weights = hit.weights;
            found.smooth_normal = smooth_normal;
            found.face_normal = face_normal;
        }
        found.path = max(found.path, hit.path);
#if ONE_SURFACE
        break;
#else
        if (rank == 2 || (surface == 0 && !may_touch(origin + hit.path * direction))) { break; }
        if (surface == 0) {
            float within = path_within(direction, face_normal);
            start = max(hit.path - 0.5 * within, 0.0);
            end = hit.path + within;
        }
        done = entered_interior(done, hit.object);
        hit.object = UNKNOWN;
#endif
    }
    return found;
}

#if FROM_EYE
// The interior list of a ray that starts a little ahead of the eye: of the bodies that it would have entered from afar, in that
// order. On a surface, rays to one side start inside.
uvec4 interior_at_eye(vec3 eye, vec3 direction, float ahead) {
    vec3 behind = eye - surface_reach * direction;
    float path = 0.0, within = SURFACE_OFFSET * surface_reach;
    uvec4 interior = uvec4(0u), done = uvec4(0u);
    bool sound = true;
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
#if ONE_OBJECT
        Hit hit = nearest_hit(behind, direction, path, surface_reach + ahead, done);
#else
        Hit hit = nearest_hit(behind, direction, max(path - within, 0.0), surface_reach + ahead, done);
#endif
        if (hit.object < 0) { break; }
        if (int(traced_body(hit.object).type) == TYPE_SOLID) {
            vec3 smooth_normal, face_normal;
            bool outside;
            hit_sides(hit, direction, smooth_normal, face_normal, outside);
            interior = crossed_interior(interior, hit.object, outside, sound);
        }
        done = entered_interior(hit.path > path + within ? uvec4(0u) : done, hit.object);
        path = max(path, hit.path);
    }
    return sound ? interior : start_interior;
}
#endif
