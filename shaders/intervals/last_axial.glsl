// Where an opaque surface ends this pixel's ray, counted as a fragment's own `axial`. Needs of_body.glsl or <Body>.

uniform sampler2D opaque_axial_depth;

float last_axial() {
    return (texelFetch(opaque_axial_depth, ivec2(gl_FragCoord.xy), 0).r - axial_depth_start) / axial_depth_scale;
}
