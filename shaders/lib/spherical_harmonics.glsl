// Light in nine real spherical harmonics, and the subsurface radiance of a body in it: all that reads `translucent bake --mode scatter`.
// Pure. Coefficient i = l (l + 1) + m; radiance in W/(m^2 sr). Each function is the float32 twin of the same name in
// translucent/formulas/spherical_harmonics.py, where the sources are cited.

#include <constants>
#include "lib/optics.glsl"

// The harmonics in a unit direction. For a far light, times its irradiance, they are the coefficients of its light.
float[9] real_harmonics(vec3 direction) {
    float x = direction.x, y = direction.y, z = direction.z;
    return float[9](HARMONIC_0, HARMONIC_1 * y, HARMONIC_1 * z, HARMONIC_1 * x, HARMONIC_2 * x * y, HARMONIC_2 * y * z,
                    HARMONIC_2_ZONAL * (3.0 * z * z - 1.0), HARMONIC_2 * x * z, 0.5 * HARMONIC_2 * (x * x - y * y));
}

// Mean subsurface radiance of a point of a body. transfer: as baked there; light: coefficients of the radiance that
// arrives from each direction, in the frame of the object.
vec3 scattered_radiance(vec3 transfer[9], vec3 light[9]) {
    vec3 found = vec3(0.0);
    for (int i = 0; i < 9; i++) { found += transfer[i] * light[i]; }
    return max(found, vec3(0.0));
}

// Radiance in a direction as a fraction of that mean. cosine: with the normal, outside; entering: as the bake states it, the
// fraction of diffuse light that the interface lets through.
float exit_lobe(float cosine, float ior, float entering) {
    return (1.0 - fresnel_dielectric(cosine, ior)) / entering;
}
