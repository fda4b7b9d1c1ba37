// Opaque objects as rays see them. Needs <View>, <Surfaces>, <TracedBody>, shade/opaque_light.glsl, place.glsl and a
// `reaching_irradiance`.

// Radiance of an opaque object along a ray, lit as where it is seen directly, but without its textures.
vec3 opaque_light(TracedBody body, vec3 normal, vec3 direction, vec3 point) {
    vec3 color = paint_color(body, point);
    if (body.plain == 1.0) { return color * reaching_irradiance(point, normal) / PI; }
    OpaqueFinish finish = OpaqueFinish(color, body.metallic, body.roughness, body.ior, body.passed, body.passed_share,
        body.emissive, normal, 0.0, 1.0, 1.0, false
#if THIN_FILM
        , body.film
#endif
#if CLEAR_COAT
        , vec2(body.clearcoat, body.clearcoat_roughness)
#endif
    );
    return opaque_radiance_of(finish, normal, direction, point + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz, point);
}
