// Rays of traced_interfaces.frag that a polished ground has mirrored, for MIRROR: bodies in its coat. Drawn apart, and added to
// the picture: the light along one ray, reflected at a microfacet of the coat, takes the place of that of the environment, which
// the ground is shaded with. It is the program of the first interfaces, so that there is one to compile.

uniform int mirrored;        // 1: these rays, and not those of the first interfaces
uniform vec4 mirror_plane;   // of the ground: unit normal upwards, and metres along it from the center of the media
uniform vec2 mirror_finish;  // roughness and ior of its coat

// The ray of a pixel in which the ground is seen, and the share of the light that its coat mirrors; false elsewhere.
bool begin_in_mirror(vec2 pixel, ivec2 texel, vec3 direction, out Ray ray, out Seen seen, out vec3 share) {
    vec3 point = point_at(pixel, texelFetch(opaque_axial_depth, texel, 0).r), normal = mirror_plane.xyz;
    float cosine = -dot(normal, direction);
    // Nothing is that far off, either.
    if (cosine <= 0.0 || !(abs(dot(normal, point) - mirror_plane.w) <= MIRROR_TOLERANCE * surface_reach)) { return false; }
    point += (dot(normal, point) - mirror_plane.w) / cosine * direction;  // where the rasterizer does not quite see it
    float alpha = mirror_finish.x * mirror_finish.x;
    vec3 facet = normal;
    if (blurred_share < 1.0) { facet = microfacet_normal(normal, direction, sqrt(1.0 - blurred_share) * alpha, microfacet_shares(0, 1)); }
    vec3 way = reflected_direction(direction, facet);
    if (dot(way, normal) <= 0.0) { return false; }
    ray = Ray(point + MIRROR_MARGIN * surface_reach * normal, 0.0, way, vec3(1.0), uvec4(0u), 1, 0, true, blurred_share * alpha * alpha,
        1, -normal
#if FOOTPRINTS
        , Footprint(mat2x3(0.0), mat2x3(0.0))
#endif
    );
    seen.object = AIR;
    seen.point = ray.origin;
    seen.normal = normal;
    vec2 table = textureLod(reflectance_table, reflectance_coordinate(cosine, mirror_finish.x), 0.0).rg;
    float step = (mirror_finish.y - 1.0) / (mirror_finish.y + 1.0);
    share = layer_of(vec3(step * step), table).mirrored;
    return true;
}
