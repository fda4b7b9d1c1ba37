// Light of the scene's lights that comes straight to a place: through media, and interfaces that bend nothing. No path finds
// what polished interfaces bend of it. Needs shade/lights.glsl, <Surfaces>, <View>, surface_hit.glsl and what that needs,
// and textured_hit.glsl.

// Transmittance of the straight path to a light. skipped: metres between the place and the origin, which lies beside a
// surface that is not to be hit.
vec3 straight_transmittance(vec3 origin, float skipped, uvec4 interior, vec3 towards, float distance_m, int channel) {
    vec3 passed = vec3(1.0);
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
        int before = effective_medium(interior);
        vec3 extinction = medium_in(interior, before).extinction;
        Hit hit = nearest_hit(origin, towards, 0.0, distance_m, uvec4(0u));
        if (hit.object < 0) {
            // Out of closed bodies no path leads but through their surfaces: it has passed an edge by rounding.
            return distance_m < NOTHING ? passed * transmittance(extinction * (distance_m + skipped)) : passed;
        }
        passed *= transmittance(extinction * (hit.path + skipped));
        if (passed == vec3(0.0)) { return passed; }
        bool sound = true;
        SurfaceHit found = surface_hit(origin, towards, interior, 0.0, hit, before, channel, sound);
        ObjectRow body = body_at(found.object, found.triangle, found.weights, 0.0);
        int type = int(body.type);
        passed *= found.transmittance;
        if (type == TYPE_OPAQUE && (found.outside || body.one_sided == 0.0)) { return vec3(0.0); }
        int after = effective_medium(found.interior);
        if (is_thin_wall(body) || alters_light(before, after, channel)) {
            float ior = is_thin_wall(body) ? body.ior : index_of(after, channel);
            if (ior != index_of(before, channel)) { return vec3(0.0); }
            passed *= body.transmission * (is_thin_wall(body) || found.object == after ? body.color : vec3(1.0));
            if (is_thin_wall(body)) {
                vec3 emitted = vec3(0.0);
                pass_absorber(body, -dot(found.face_normal, towards), emitted, passed);
            }
        }
        float offset = SURFACE_OFFSET * surface_reach;
        skipped = offset / max(abs(dot(found.face_normal, towards)), 1e-2);
        origin += found.path * towards - offset * found.face_normal;
        distance_m = max(distance_m - found.path - skipped, 0.0);
        interior = found.interior;
    }
    return vec3(0.0);
}
