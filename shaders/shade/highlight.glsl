// Alpha of the microfacets in which lights are mirrored. variance: of the normals within the pixel, see normal_variance.glsl.

float highlight_alpha(float roughness, float variance) {
    float alpha = max(roughness * roughness, SMALLEST_HIGHLIGHT);
    return sqrt(min(alpha * alpha + variance, 1.0));
}
