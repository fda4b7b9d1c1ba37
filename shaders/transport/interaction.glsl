// The interaction of a ray with an interface: where it is, and the lobes of the bsdf there. What follows rays is built on it: the
// tree of traced interfaces, random paths and photons. Needs <constants>, <Surfaces>, <ObjectRow>, interior_list.glsl,
// surface_hit.glsl and shade/interface_bsdf.glsl.

const float EDGE_ON = 1e-3;

struct Interaction {
    int object;          // whose interface it is
    bool outside;        // its outer side is hit
    bool thin_walled;
    bool enters;         // light that goes on enters the object, and takes its base color
    vec3 point;
    vec3 direction;      // of the ray
    vec3 normal;         // for shading, towards the ray, as is face_normal
    vec3 face_normal;
    float ior;           // of the other side, relative to this one
    float ior_before;    // of this side
    float roughness;
    float transmission;  // fraction of the light on the base that it lets pass
    vec3 color;          // base color
};

// A normal for shading that does not look away from the ray.
vec3 facing_normal(vec3 normal, vec3 direction) {
    float facing = dot(normal, direction);
    return facing > -EDGE_ON ? normalize(normal - (facing + EDGE_ON) * direction) : normal;
}

// normal: for shading; before, after: bodies on both sides that decide on the medium.
Interaction interaction_at(SurfaceHit hit, ObjectRow body, vec3 point, vec3 direction, vec3 normal, int before, int after, int channel) {
    bool thin_walled = is_thin_wall(body);
    float ior_before = index_of(before, channel);
    float ior = index_of(thin_walled ? hit.object : after, channel) / ior_before;
    return Interaction(hit.object, hit.outside, thin_walled, thin_walled || hit.object == after, point, direction,
        normal, hit.face_normal, ior, ior_before, body.roughness, body.transmission, body.color);
}

float cosine_of(Interaction at) {
    return clamp(-dot(at.normal, at.direction), 0.0, 1.0);
}

// Factor of light that goes on: what the base lets pass, with its color where it enters.
vec3 passing_base(Interaction at) {
    return at.transmission * (at.enters ? at.color : vec3(1.0));
}

// Lobes of an interface that reflects `bare` without a film on it, without its clear coat and its base. emitted: radiance that
// a thin wall emits towards the ray.
Lobes interface_lobes(Interaction at, ObjectRow body, float bare, out vec3 emitted) {
    float cosine = cosine_of(at);
    vec3 front = film_over(body.film, bare, cosine, at.ior, at.ior_before);
    emitted = vec3(0.0);
#if THIN_WALLS
    if (!at.thin_walled) { return smooth_lobes(front); }
    float through = 1.0 / max(refracted_cosine(cosine, at.ior), MIN_THIN_LAYER_COSINE);
    vec3 depth = body.extinction * through;
#if EMISSION == 1
    emitted = thin_wall_exitance(front, bare, depth) * emitted_radiance(body.emission, body.extinction, through);
#endif
    return thin_wall_lobes(front, bare, depth);
#else
    return smooth_lobes(front);
#endif
}

vec3 reflected_at(Interaction at) {
    return kept_on_side(reflected_direction(at.direction, at.normal), at.face_normal);
}

// Straight on through a thin wall.
vec3 refracted_at(Interaction at) {
    return at.thin_walled ? at.direction : kept_on_side(refracted_direction(at.direction, at.normal, at.ior), -at.face_normal);
}

// Origin of a ray that goes on from a surface: on the side that it goes to, a little off, so that it does not hit the surface
// again. skipped: metres of the segment that lie before it.
vec3 origin_beside(vec3 point, vec3 face_normal, vec3 direction, out float skipped) {
    float offset = SURFACE_OFFSET * surface_reach;
    float across = dot(face_normal, direction);
    skipped = offset / max(abs(across), 1e-2);
    return point + (across < 0.0 ? -offset : offset) * face_normal;
}
