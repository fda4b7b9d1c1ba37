// Relative density that varies in space. Inputs: positions along an axis of a body's unit box, 0 to 1; densities without unit.
// Pure: needs only lib/optics.glsl. Each function is the float32 twin of the same name in translucent/media/density.py.

#include "lib/optics.glsl"

// From start to end, linear; constant beyond.
float linear_density(float along, float start, float end) {
    return mix(start, end, clamp(along, 0.0, 1.0));
}

// Exponential from one end of the axis to the other, where log_ratio is log(end / start). densest: the larger of the two,
// from which the exponential falls, so that nothing overflows.
float exponential_density(float along, float densest, float log_ratio) {
    float u = clamp(along, 0.0, 1.0);
    return densest * transmittance(vec3(abs(log_ratio) * (log_ratio > 0.0 ? 1.0 - u : u))).x;
}

// Mean of exponential_density on a straight line whose ends are at these positions on the axis, in closed form.
float exponential_density_mean(float from, float to, float densest, float log_ratio) {
    float a = clamp(from, 0.0, 1.0);
    float b = clamp(to, 0.0, 1.0);
    float thickest = exponential_density(log_ratio > 0.0 ? max(a, b) : min(a, b), densest, log_ratio);
    return thickest * mean_transmittance(vec3(abs(log_ratio) * abs(a - b))).x;
}

// Between the corners of a cell. low, high: those at its lower and upper end along x, in the order of (y, z) = (low, low),
// (low, high), (high, low), (high, high). share: position in the cell, 0 to 1 along each axis.
float trilinear(vec4 low, vec4 high, vec3 share) {
    vec4 face = mix(low, high, share.x);
    vec2 edge = mix(face.xy, face.zw, share.y);
    return mix(edge.x, edge.y, share.z);
}
