// Highlights of what is smaller than a sample of a pixel: the normals within one are a part of the roughness. Without that, a bent
// mirror shows a light in some pixels and misses it in others, and glitters when it moves. Needs <View> and lib/ray.glsl.
// Kaplanyan et al. 2016, "Filtering distributions of normals for shading antialiasing", but in the projection of normals along
// the view ray: of a ball, that is linear in the picture up to the silhouette, where normals themselves turn infinitely fast.

#include "shade/packed_variance.glsl"

// Squared alpha of the filter of one sample in the middle of each pixel, which finds the light of a smaller light with a standard
// error of 4 %. So do several at low-discrepancy points, at most 5 %, if their filters have four times their area.
const float OVERLAP = 4.0;
const float MOST_NORMAL_VARIANCE = 0.18;

// Filter of a sample; takes derivatives. normal: as interpolated over the face, not normalized; position: from the eye.
SampleFilter sample_filter(vec3 normal, vec3 position) {
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    mat3x2 axes = projection(normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz)));
    vec2 right = axes * dFdx(normal), up = axes * dFdy(normal);
    vec3 variance = vec3(right.x * right.x + up.x * up.x, right.x * right.y + up.x * up.y, right.y * right.y + up.y * up.y);
    variance *= PIXEL_ALPHA * min(OVERLAP * sample_area, 1.0);
    variance *= min(1.0, MOST_NORMAL_VARIANCE / max(variance.x + variance.z, 1e-30));
    float width = filter_width() * sqrt(abs(determinant(mat2(axes * dFdx(position), axes * dFdy(position)))));
    return SampleFilter(variance, width, ray_up.xyz == vec3(0.0) ? 0.0 : width / length(position));
}
