// Where an opaque surface ends this pixel's ray, counted as a fragment's own `axial`. Needs <Body>.

uniform sampler2D opaque_place;

float last_axial() {
    return (texelFetch(opaque_place, ivec2(gl_FragCoord.xy), 0).r - place_start) / place_scale;
}
