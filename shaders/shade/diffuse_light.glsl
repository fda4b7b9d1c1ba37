// Light on a surface that reflects diffusely, before anything shadows it. LIGHT_MAP: the environment is an image. Needs
// <constants>, <Environment> and lib/environment.glsl. Normals are unit vectors.

#include "shade/lights.glsl"

#if LIGHT_MAP
uniform sampler2D light_irradiance;
#endif

vec3 environment_irradiance(vec3 normal) {
#if LIGHT_MAP
    return light_scale * textureLod(light_irradiance, equirectangular_uv(normal, light_turn), 0.0).rgb;
#else
    // A backdrop fixed to the picture lights like the mean of its squares.
    float fraction = light_kind == ENVIRONMENT_GRADIENT ? gradient_irradiance_share(normal) : 0.5;
    return light_scale * PI * mix(light_first.rgb, light_second.rgb, fraction);
#endif
}

// From one light; point: of the surface, from the center of the media.
vec3 light_irradiance_on(int light, vec3 point, vec3 normal) {
    LightSample arriving = light_at(light, point);
    return max(dot(arriving.towards, normal), 0.0) * arriving.irradiance;
}
