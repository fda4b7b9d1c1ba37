// What is opaque as another renderer drew it: its depth buffer as axial depths, and its encoded colors as radiance.

uniform sampler2D backdrop_color;
uniform sampler2D backdrop_depth;
uniform float near;  // metres along the camera's forward axis at depth 0
#if !INFINITE
uniform float far;  // and at depth 1
#endif
uniform float media_near;  // metres along the same axis at axial depth 0
uniform float media_length;  // from axial depth 0 to 1
uniform float gamma;
uniform float behind_all;  // axial depth of what is infinitely far

layout(location = 0) out float opaque_axial_depth;
layout(location = 1) out vec4 radiance;

// A sum of positive terms: the form with a difference loses the digits of what is far.
float metres_ahead(float depth) {
#if ORTHOGRAPHIC
    return near * (1.0 - depth) + far * depth;
#elif INFINITE
    return near / (1.0 - depth);
#else
    return near * far / (far * (1.0 - depth) + near * depth);
#endif
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(backdrop_depth, texel, 0).r;
    opaque_axial_depth = depth < 1.0 ? (metres_ahead(depth) - media_near) / media_length : behind_all;
    radiance = vec4(pow(texelFetch(backdrop_color, texel, 0).rgb, vec3(gamma)), 1.0);
}
