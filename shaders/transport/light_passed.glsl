// Transmittance of the straight way from a light to an interface: what bodies in between absorb, and the body itself where it is
// in its own light. Found by one ray, which walks as light travels, so that it knows what it is in: it starts where no body is,
// and counts from the light on. As in shadows, interfaces neither bend nor dim that light; what is opaque is left to the maps.
// Needs <constants>, <Surfaces>, hierarchy.glsl, record.glsl and place.glsl. DIMMED: there may be something in between.

#if DIMMED
uniform float bodies_radius;  // metres from the center of the media, within which all bodies are

// normal: of the surface, a unit vector; no surface counts that touches the point.
vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m) {
    float ahead = dot(point, towards);
    float far = sqrt(max(ahead * ahead + bodies_radius * bodies_radius - dot(point, point), 0.0)) - ahead;
    float end = far - 2.0 * path_within(towards, normal);
    vec3 start = point + far * towards;
    float counted_to = max(far - distance_m, 0.0);  // first where the light is
    float beyond = 0.0;                             // where the next surface may be
    uvec4 record = uvec4(0u);
    vec3 share = vec3(1.0);
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
        int before = dominant_body(record);
        bool sound = true;
        Hit hit = first_hit(start, -towards, beyond, end);
        Place place = place_at(start, -towards, record, beyond, hit, before, 1, sound);
        bool arrives = hit.object < 0;
        float reached = arrives ? end : hit.path;
        bool lit = reached > counted_to;
        if (lit && record.x != 0u) { share *= transmittance(filling_of(record, before).extinction * (reached - counted_to)); }
        if (arrives || share == vec3(0.0)) { break; }
        if (lit) {
            share *= place.coat;
            TracedBody body = traced_body(place.object);
            vec3 glow = vec3(0.0);
            if (int(body.kind) == KIND_SHEET) { pass_film(body, dot(place.face_normal, towards), glow, share); }
        }
        counted_to = max(place.path, counted_to);
        beyond = place.path + path_within(towards, place.face_normal);
        record = place.record;
    }
    return share;
}
#else
vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m) { return vec3(1.0); }
#endif
