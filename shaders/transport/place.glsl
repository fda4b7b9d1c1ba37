// What a ray meets in one place: all surfaces that lie there, of solids, sheets and opaque objects. Needs <constants>,
// <Surfaces>, <TracedBody>, lib/interface.glsl, lib/optics.glsl, hierarchy.glsl and record.glsl. FROM_EYE: rays may start
// inside bodies, or before others without an interface.

#if FROM_EYE
uniform uvec4 start_record;  // the bodies that the eye is in
#endif

const int KIND_SOLID = 0;
const int KIND_SHEET = 1;
const int KIND_OPAQUE = 2;
const int KIND_UNSEEN = 3;  // drawn over the picture, or from its back
const int KIND_FILM = 4;    // a sheet that only dims and glows
const int MOST_STEPS = 512;

// Metres along a ray within which surfaces lie in one place.
float path_within(vec3 direction, vec3 face_normal) {
    return SURFACE_OFFSET * surface_reach / max(abs(dot(direction, face_normal)), 1e-2);
}

float body_index(TracedBody body, int channel) {
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

// Color of an opaque object at a point, as far as it is no texture's.
vec3 paint_color(TracedBody body, vec3 point) {
    if (body.fading.z == 0.0) { return body.color; }
    vec3 offset = point - vec3(body.local_x.w, body.local_y.w, body.local_z.w);
    float radius = length(vec3(dot(body.local_x.xyz, offset), dot(body.local_y.xyz, offset), dot(body.local_z.xyz, offset)));
    return body.color * (1.0 - body.fading.z * smoothstep(body.fading.x, body.fading.y, radius));
}

// All surfaces that a ray meets in one place; solids are crossed together, and their interface is one.
struct Place {
    int object;          // whose interface it is: of the solid that is entered, else of that left, else of a sheet; or opaque
    bool outside;        // its outer side is met
    vec3 smooth_normal;  // towards the ray, as is face_normal
    vec3 face_normal;
    uvec4 record;        // beyond
    float path;          // to the last of its surfaces
    vec3 coat;           // transmittance of sheets that lie there, and of films
    vec3 glow;           // that these add
};

// The record beyond a surface of a solid. sound: not yet unbalanced, nor beyond what a record holds.
uvec4 crossed_record(uvec4 record, int object, bool enters, inout bool sound) {
    bool missing = false;
    uvec4 crossed = enters ? entered_record(record, object) : left_record(record, object, missing);
    sound = sound && !missing && !(enters && is_full(record));
    return crossed;
}

// Sides of a surface as a ray meets it, turned to face it.
void met_sides(Hit hit, vec3 direction, out vec3 smooth_normal, out vec3 face_normal, out bool outside) {
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
        TracedBody body = traced_body(before);
        ior = body_index(body, channel);
        plain = body.plain != 0.0;
    }
    float ior_after = 1.0;
    if (after != AIR) {
        TracedBody body = traced_body(after);
        ior_after = body_index(body, channel);
        plain = plain && body.plain != 0.0;
    }
    return ior != ior_after || !plain;
}

// Light that passes a sheet which only dims and glows.
void pass_film(TracedBody film, float cosine, inout vec3 light, inout vec3 share) {
    float through = 1.0 / max(refracted_cosine(cosine, film.ior), MIN_THIN_LAYER_COSINE);
#if EMISSION
    light += share * emitted_radiance(film.emission, film.extinction, through);
#endif
    share *= transmittance(film.extinction * through);
}

// The hit for `place_at` to begin with, between two distances on a ray: of several objects it is looked for there, in the loop
// that finds what lies in the same place, so that compilers have one search less to inline.
Hit first_hit(vec3 origin, vec3 direction, float start, float end) {
#if ONE_OBJECT
    return nearest_hit(origin, direction, start, end, uvec4(0u));
#else
    return Hit(end, -1, -1, vec2(0.0));
#endif
}

// What a ray meets where it has hit a surface first. A sheet that lies on the interface of a solid only dims. first: the hit, or
// that of `first_hit` from `start` on, which it is then found for; of no object where there is none.
Place place_at(vec3 origin, vec3 direction, uvec4 record, float start, inout Hit first, int before, int channel, inout bool sound) {
    Place place = Place(AIR, false, vec3(0.0), vec3(0.0), record, 0.0, vec3(1.0), vec3(0.0));
    Hit hit = first;
    float end = first.path;
    int rank = -1;  // of what decides: 0 a sheet, 1 a solid, 2 what is opaque
    uvec4 met = uvec4(0u);
    for (int surface = 0; surface < RECORD_SIZE; ++surface) {
#if !ONE_OBJECT
        if (hit.object < 0) { hit = nearest_hit(origin, direction, start, end, met); }
        if (surface == 0) { first = hit; }
#endif
        if (hit.object < 0) { break; }
        TracedBody body = traced_body(hit.object);
        int kind = int(body.kind);
        vec3 smooth_normal, face_normal;
        bool outside;
        met_sides(hit, direction, smooth_normal, face_normal, outside);
        float across = -dot(face_normal, direction);
        bool decides = surface == 0;
        if (kind == KIND_SOLID) { place.record = crossed_record(place.record, hit.object, outside, sound); }
        int now = dominant_body(place.record);
        bool altered = alters_light(before, now, channel);
        if (kind == KIND_SOLID) {
            if (rank == 0 && altered) {
                pass_film(traced_body(place.object), -dot(place.face_normal, direction), place.glow, place.coat);
                rank = -1;
            }
            decides = decides || rank < 0 || (rank == 1 && (now == hit.object || (before == hit.object && now != place.object)));
            rank = rank == 0 ? 0 : 1;
        } else if (kind == KIND_OPAQUE && (outside || body.one_sided == 0.0)) {
            decides = true;
            rank = 2;
        } else if (kind == KIND_SHEET && (rank < 0 || (rank == 1 && !altered))) {
            decides = true;
            rank = 0;
        } else if (kind == KIND_SHEET || kind == KIND_FILM) {
            pass_film(body, across, place.glow, place.coat);
        }
        if (decides) {
            place.object = hit.object;
            place.outside = outside;
            place.smooth_normal = smooth_normal;
            place.face_normal = face_normal;
        }
        place.path = max(place.path, hit.path);
#if ONE_OBJECT
        break;
#else
        if (rank == 2) { break; }
        if (surface == 0) {
            float within = path_within(direction, face_normal);
            start = max(hit.path - 0.5 * within, 0.0);
            end = hit.path + within;
        }
        met = entered_record(met, hit.object);
        hit.object = -1;
#endif
    }
    return place;
}

#if FROM_EYE
// The record of a ray that starts a little ahead of the eye: of the bodies that it would have entered from afar, in that
// order. On a surface, rays to one side start inside.
uvec4 record_at_eye(vec3 eye, vec3 direction, float ahead) {
    vec3 behind = eye - surface_reach * direction;
    float path = 0.0, within = SURFACE_OFFSET * surface_reach;
    uvec4 record = uvec4(0u), met = uvec4(0u);
    bool sound = true;
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
#if ONE_OBJECT
        Hit hit = nearest_hit(behind, direction, path, surface_reach + ahead, met);
#else
        Hit hit = nearest_hit(behind, direction, max(path - within, 0.0), surface_reach + ahead, met);
#endif
        if (hit.object < 0) { break; }
        if (int(traced_body(hit.object).kind) == KIND_SOLID) {
            vec3 smooth_normal, face_normal;
            bool outside;
            met_sides(hit, direction, smooth_normal, face_normal, outside);
            record = crossed_record(record, hit.object, outside, sound);
        }
        met = entered_record(hit.path > path + within ? uvec4(0u) : met, hit.object);
        path = max(path, hit.path);
    }
    return sound ? record : start_record;
}
#endif

// Directions that smooth normals turn to the wrong side of a face, mirrored to the right one.
vec3 kept_on_side(vec3 direction, vec3 side) {
    return direction - 2.0 * min(dot(direction, side), 0.0) * side;
}
