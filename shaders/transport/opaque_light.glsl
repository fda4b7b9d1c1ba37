// What opaque objects send along rays that interfaces have bent.

vec3 opaque_light(TracedBody body, vec3 normal, vec3 direction, vec3 point) {
    return body.color * irradiance_on(point, normal, 1.0) / PI;
}
