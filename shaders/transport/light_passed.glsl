// Transmittance of the straight path from a light to an interface: what bodies in between absorb, and the body itself where it is
// in its own light. Found by one ray, which walks as light travels, so that it knows what it is in: it starts where no body is,
// and counts from the light on. As in shadows, interfaces neither bend nor dim that light; what is opaque is left to the maps.
// Needs <constants>, <Surfaces>, hierarchy.glsl, interior_list.glsl and surface_hit.glsl. DIMMED: there may be something in between.

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
    uvec4 interior = uvec4(0u);
    vec3 passed = vec3(1.0);
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
        int before = effective_medium(interior);
        bool sound = true;
        Hit hit = first_hit(start, -towards, beyond, end);
        SurfaceHit found = surface_hit(start, -towards, interior, beyond, hit, before, 1, sound);
        bool arrives = hit.object < 0;
        float reached = arrives ? end : hit.path;
        bool lit = reached > counted_to;
        if (lit && interior.x != 0u) { passed *= transmittance(medium_in(interior, before).extinction * (reached - counted_to)); }
        if (arrives || passed == vec3(0.0)) { break; }
        if (lit) {
            passed *= found.transmittance;
            ObjectRow body = traced_body(found.object);
            vec3 emitted = vec3(0.0);
            if (is_thin_wall(body)) { pass_absorber(body, dot(found.face_normal, towards), emitted, passed); }
        }
        counted_to = max(found.path, counted_to);
        beyond = found.path + path_within(towards, found.face_normal);
        interior = found.interior;
    }
    return passed;
}
#else
vec3 light_passed(vec3 point, vec3 normal, vec3 towards, float distance_m) { return vec3(1.0); }
#endif
