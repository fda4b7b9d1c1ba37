// Opaque objects as rays and paths find them. Needs <View>, <Surfaces>, <ObjectRow>, shade/opaque_light.glsl, and surface_hit.glsl.

// The surface of an opaque object at a point, without textures that rays do not read.
OpaqueSurface opaque_surface(ObjectRow body, vec3 normal, vec3 point) {
    // What has no surface is a diffuse base alone.
    float ior = body.plain == 1.0 ? 1.0 : body.ior;
    IrradianceMap map = IrradianceMap(body.grid_low, body.grid_x, body.grid_y, body.grid_z, body.grid_size, body.first_layer, body.diffuses);
    return OpaqueSurface(base_color(body, point), body.metallic, body.roughness, ior, body.passed, body.passed_share, body.emissive,
        normal, NO_FILTER, 1.0, 1.0, false, body.film, vec2(body.clearcoat, body.clearcoat_roughness), map);
}

// Radiance of an opaque object along a ray, lit as where it is visible directly.
vec3 opaque_light(ObjectRow body, vec3 normal, vec3 direction, vec3 point) {
    return opaque_radiance_of(opaque_surface(body, normal, point), normal, direction, point);
}
