// Light of photons that opaque objects reflect to the eye, as a larger picture has it for every pixel; each pixel here is one
// of stride x stride of those.

uniform sampler2D photon_light;
uniform int stride;
uniform ivec2 phase;

layout(location = 0) out vec4 radiance;

void main() {
    radiance = vec4(texelFetch(photon_light, ivec2(gl_FragCoord.xy) * stride + phase, 0).rgb, 0.0);
}
