// One photon; blending adds them up.

flat in vec3 irradiance;
flat in vec4 parts;
flat in ivec2 own_texel;

layout(location = 0) out vec4 out_irradiance;  // a: fraction of the photon

void main() {
    ivec2 aside = abs(ivec2(gl_FragCoord.xy) - own_texel);
    out_irradiance = parts[aside.x + 2 * aside.y] * vec4(irradiance, 1.0);
}
