// Light of photons that opaque objects reflect to the eye.

#include <constants>

uniform sampler2D photon_irradiance;
uniform sampler2D paint;

layout(location = 0) out vec4 radiance;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 reflected = texelFetch(photon_irradiance, texel, 0).rgb * texelFetch(paint, texel, 0).rgb / PI;
    radiance = vec4(min(reflected, vec3(NOTHING)), 0.0);
}
