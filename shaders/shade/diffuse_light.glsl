// Light on a surface that reflects diffusely, before anything shadows it. LIGHT_MAP: the environment is an image. Needs
// <constants>, <Environment>, <Lights>, lib/environment.glsl and lib/lights.glsl. Normals are unit vectors.

#if LIGHT_MAP
uniform sampler2D light_irradiance;
#endif

vec3 environment_irradiance(vec3 normal) {
#if LIGHT_MAP
    return light_scale * textureLod(light_irradiance, equirectangular_uv(normal, light_turn), 0.0).rgb;
#else
    // A backdrop fixed to the picture lights like the mean of its squares.
    float share = light_kind == ENVIRONMENT_GRADIENT ? gradient_irradiance_share(normal) : 0.5;
    return light_scale * PI * mix(light_first.rgb, light_second.rgb, share);
#endif
}

// From one light; position: of the surface, from the eye.
vec3 lamp_irradiance(int light, vec3 position, vec3 normal) {
    vec4 at = light_position[light];
    vec3 towards = at.xyz - at.w * position;
    float distance_m = max(length(towards), 1e-18);
    float facing = max(dot(towards / distance_m, normal), 0.0);
    facing *= cone_attenuation(-towards / distance_m, light_cone[light]);
    return light_power[light].rgb * (at.w == 0.0 ? facing : facing / distance_m / distance_m);
}
