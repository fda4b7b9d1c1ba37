// Rays of traced_interfaces.frag that a polished ground has mirrored, for MIRROR: bodies in its coat. Drawn apart, and added to
// the picture: the light along one ray, reflected at a microfacet of the coat, takes the place of that of the environment, which
// the ground is shaded with. It is the program of the first interfaces, so that there is one to compile.

uniform int mirrored;        // 1: these rays, and not those of the first interfaces
uniform vec4 mirror_plane;   // of the ground: unit normal upwards, and metres along it from the center of the media
uniform vec2 mirror_surface; // roughness and ior of its coat
uniform vec4 mirror_metal;   // reflectance of its metal, and the fraction that is metal

// The ray of a pixel in which the ground is visible, and the fraction of the light that its coat reflects; false elsewhere.
bool begin_in_mirror(Pixel pixel, out Ray ray, out vec3 reflectance) {
    vec3 direction = pixel.direction, normal = mirror_plane.xyz;
    vec3 point = point_at(pixel.center, texelFetch(opaque_axial_depth, pixel.texel, 0).r);
    float cosine = -dot(normal, direction);
    // Nothing is that far off, either.
    if (cosine <= 0.0 || !(abs(dot(normal, point) - mirror_plane.w) <= MIRROR_TOLERANCE * surface_reach)) { return false; }
    point += (dot(normal, point) - mirror_plane.w) / cosine * direction;  // where the rasterizer does not quite see it
    float alpha = mirror_surface.x * mirror_surface.x;
    vec3 facet = normal;
    if (blurred_fraction < 1.0) { facet = microfacet_normal(normal, direction, sqrt(1.0 - blurred_fraction) * alpha, microfacet_numbers(pixel.number, 0, 1u)); }
    vec3 reflected = reflected_direction(direction, facet);
    if (dot(reflected, normal) <= 0.0) { return false; }
    float step = (mirror_surface.y - 1.0) / (mirror_surface.y + 1.0);
    vec2 entry = reflectance_entry(cosine, mirror_surface.x);
    reflectance = mix(layer_of(vec3(step * step), entry).albedo, layer_of(mirror_metal.rgb, entry).albedo, mirror_metal.a);
    ray = Ray(point + MIRROR_MARGIN * surface_reach * normal, 0.0, reflected, blurred_fraction * alpha * alpha, reflectance,
        packed_state(1, mirror_metal.a > 0.0 ? FORKS : 0, true, MOST_INTERACTIONS), 1u, uvec4(0u), -normal, no_footprint(), NONE_AHEAD);
    return true;
}
