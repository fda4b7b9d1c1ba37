// The program of traced_interfaces.frag for MIRROR: bodies in the coat of a polished ground.

uniform vec4 mirror_plane;   // of the ground: unit normal upwards, and metres along it from the center of the media
uniform vec2 mirror_finish;  // roughness and ior of its coat

// What bodies change in the mirror image of a ground: along one ray, reflected at a microfacet of its coat, their light takes the place of
// that of the environment, which the ground is shaded with. Added to the picture.
void main() {
    read_bodies();
    out_radiance = vec4(0.0);
    out_transmittance = vec4(0.0);
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    float depth = texelFetch(opaque_axial_depth, texel, 0).r;
    if (depth >= NOTHING || texelFetch(entered, texel, 0).w < NOTHING) { return; }
    vec3 direction = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    vec3 point = point_at(pixel, depth), normal = mirror_plane.xyz;
    float cosine = -dot(normal, direction);
    if (cosine <= 0.0 || abs(dot(normal, point) - mirror_plane.w) > MIRROR_TOLERANCE * surface_reach) { return; }
    point += (dot(normal, point) - mirror_plane.w) / cosine * direction;  // where the rasterizer does not quite see it
    float alpha = mirror_finish.x * mirror_finish.x;
    vec3 facet = normal;
    if (blurred_share < 1.0) { facet = microfacet_normal(normal, direction, sqrt(1.0 - blurred_share) * alpha, microfacet_shares(0, 1)); }
    vec3 way = reflected_direction(direction, facet);
    if (dot(way, normal) <= 0.0) { return; }
    vec3 origin = point + MIRROR_MARGIN * surface_reach * normal;
    float blur = blurred_share * alpha * alpha;
    Seen nothing;
    nothing.object = AIR;
    nothing.point = origin;
    nothing.normal = normal;
    Sum sum = follow(Ray(origin, 0.0, way, vec3(1.0), uvec4(0u), 1, 0, true, blur, 1, -normal
#if FOOTPRINTS
        , Footprint(mat2x3(0.0), mat2x3(0.0))
#endif
    ), nothing, NOTHING, 1);
    vec2 table = textureLod(reflectance_table, reflectance_coordinate(cosine, mirror_finish.x), 0.0).rg;
    float step = (mirror_finish.y - 1.0) / (mirror_finish.y + 1.0);
    vec3 share = layer_of(vec3(step * step), table).mirrored * texelFetch(straight_transmittance, ivec2(gl_FragCoord.xy), 0).rgb;
    out_radiance = vec4(share * (min(sum.light, vec3(NOTHING)) - environment_seen(origin, way, true, blur)), 0.0);
}
