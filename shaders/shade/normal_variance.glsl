// Highlights of what is smaller than a sample of a pixel: the normals within one are a part of the roughness. Without that, a bent
// mirror shows a light in some pixels and misses it in others, and glitters when it moves. Needs <View> and lib/ray.glsl.
// Kaplanyan et al. 2016, "Filtering distributions of normals for shading antialiasing", but in the projection of normals along
// the view ray: of a ball, that is linear in the picture up to the silhouette, where normals themselves turn infinitely fast.

#include "shade/packed_variance.glsl"

// What the normals within a sample add to the squared alpha of its microfacets, less the half vectors of a far light, as a symmetric
// matrix (xx, xy, yy) in `projection`. w: square of the sample's width across the ray, filtered alike. Takes derivatives. normal: as
// interpolated over the face, not normalized; position: in any frame that does not turn.
vec4 normal_variance(vec3 normal, vec3 position) {
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    mat3x2 axes = projection(ray);
    // A half vector h turns by minus (1 - h h^T) / (2 cos) of what the view ray does.
    vec2 middle = axes * normal;
    float facing = -dot(normal, ray), half_turn = 0.5 * facing / max(facing * facing, 1e-6);
    vec2 right = axes * dFdx(ray), up = axes * dFdy(ray);
    right = axes * dFdx(normal) + half_turn * (right - dot(right, middle) * middle);
    up = axes * dFdy(normal) + half_turn * (up - dot(up, middle) * middle);
    vec3 variance = vec3(right.x * right.x + up.x * up.x, right.x * right.y + up.x * up.y, right.y * right.y + up.y * up.y);
    float area = abs(determinant(mat2(axes * dFdx(position), axes * dFdy(position))));
    return sample_alpha() * vec4(variance, area);
}
