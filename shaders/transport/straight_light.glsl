// Light of the scene's lights that comes straight to a place: through media, and interfaces that bend nothing. No path finds
// what polished interfaces bend of it. Needs shade/lights.glsl, <Surfaces>, <View>, place.glsl and what that needs.

// Transmittance of the straight way to a light. skipped: metres between the place and the origin, which lies beside a
// surface that is not to be met.
vec3 straight_transmittance(vec3 origin, float skipped, uvec4 record, vec3 towards, float distance_m, int channel) {
    vec3 share = vec3(1.0);
    for (int surface = 0; surface < MOST_STEPS; ++surface) {
        int before = dominant_body(record);
        vec3 extinction = filling_of(record, before).extinction;
        Hit hit = nearest_hit(origin, towards, 0.0, distance_m, uvec4(0u));
        if (hit.object < 0) {
            // Out of closed bodies no way leads but through their surfaces: it has passed an edge by rounding.
            return distance_m < NOTHING ? share * transmittance(extinction * (distance_m + skipped)) : share;
        }
        share *= transmittance(extinction * (hit.path + skipped));
        if (share == vec3(0.0)) { return share; }
        bool sound = true;
        Place place = place_at(origin, towards, record, 0.0, hit, before, channel, sound);
        TracedBody body = traced_body(place.object);
        int kind = int(body.kind);
        share *= place.coat;
        if (kind == KIND_OPAQUE && (place.outside || body.one_sided == 0.0)) { return vec3(0.0); }
        int after = dominant_body(place.record);
        if (kind == KIND_SHEET || alters_light(before, after, channel)) {
            float ior = kind == KIND_SHEET ? body.ior : index_of(after, channel);
            if (ior != index_of(before, channel)) { return vec3(0.0); }
            share *= body.transmission * (kind == KIND_SHEET || place.object == after ? body.color : vec3(1.0));
            if (kind == KIND_SHEET) {
                vec3 glow = vec3(0.0);
                pass_film(body, -dot(place.face_normal, towards), glow, share);
            }
        }
        float offset = SURFACE_OFFSET * surface_reach;
        skipped = offset / max(abs(dot(place.face_normal, towards)), 1e-2);
        origin += place.path * towards - offset * place.face_normal;
        distance_m = max(distance_m - place.path - skipped, 0.0);
        record = place.record;
    }
    return vec3(0.0);
}
