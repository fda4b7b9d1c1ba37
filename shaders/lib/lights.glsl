// Lamps. Inputs: unit vectors. Pure. Each function is the float32 twin of the same name in translucent/formulas/lights.py.

// Share of a lamp's intensity in the direction of travel (KHR_lights_punctual): the square of
// (cos - cos_outer) / (cos_inner - cos_outer), within 0 to 1. cone: the lamp's direction times k, with
// k^2 = 1 / (2 (cos_inner - cos_outer)); w: (1 - cos_outer) / (cos_inner - cos_outer). (0, 0, 0, 1): alike in all
// directions. By chords, 1 - cos = |a - b|^2 / 2, whose float32 is good for narrow cones, too.
float cone_attenuation(vec3 travel, vec4 cone) {
    vec3 apart = length(cone.xyz) * travel - cone.xyz;
    float level = clamp(cone.w - dot(apart, apart), 0.0, 1.0);
    return level * level;
}
