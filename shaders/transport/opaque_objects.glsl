// Opaque objects as rays see them. Needs <View>, <Surfaces>, <ObjectRow>, shade/opaque_light.glsl, and surface_hit.glsl.

// Radiance of an opaque object along a ray, lit as where it is visible directly, but without its textures.
vec3 opaque_light(ObjectRow body, vec3 normal, vec3 direction, vec3 point) {
    // What has no surface is a diffuse base alone.
    float ior = body.plain == 1.0 ? 1.0 : body.ior;
    OpaqueSurface surface = OpaqueSurface(base_color(body, point), body.metallic, body.roughness, ior, body.passed, body.passed_share,
        body.emissive, normal, 0.0, 1.0, 1.0, false, body.film, vec2(body.clearcoat, body.clearcoat_roughness));
    return opaque_radiance_of(surface, normal, direction, point);
}
