// The picture that paths have made so far, with the transmittance of straight rays. Row 0 is the top row.

uniform sampler2D path_mean;
uniform sampler2D straight_transmittance;

layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    out_radiance = vec4(texelFetch(path_mean, texel, 0).rgb, 1.0);
    out_transmittance = vec4(texelFetch(straight_transmittance, texel, 0).rgb, 1.0);
}
