// Light that leaves bodies in which it has diffused. Needs <SurfaceRow>. DIFFUSED: there are such bodies.

#if DIFFUSED
#include "lib/diffusion.glsl"

const float MOST_SCALE = 4.0;

uniform sampler3D diffused_light;    // grids of all bodies: below, the fluence at the surface; above, what enters there

// Basic radiance L / n^2 inside an object, below a point of its surface and towards it; cosine: of the direction there.
vec3 diffused_out(int object, vec3 point, float cosine) {
    SurfaceRow row = surface_table_row(object);
    if (row.diffuses < 0.5) { return vec3(0.0); }
    vec3 texels = vec3(textureSize(diffused_light, 0));
    vec3 at = clamp((point - row.grid_low) * row.cells_per_metre, vec3(0.5), row.grid_size - 0.5);
    at = (at + vec3(0.0, 0.0, row.first_layer)) / texels;
    vec3 fluence = textureLod(diffused_light, at, 0.0).rgb;
    vec3 entering = textureLod(diffused_light, at + vec3(0.0, 0.0, row.grid_size.z / texels.z), 0.0).rgb;
    vec3 emergent = emergent_radiance(fluence, entering, row.albedo, row.conductance, row.mean_cosine, cosine);
    // Scaled so that the flux that leaves is that of the diffusion. Half-spaces need 1 to 2.6; where a lamp is close to the
    // surface the formula may have no flux at all, and no factor would do.
    vec4 shares = row.emergent_fluxes;
    vec3 flux = row.albedo * (fluence * (shares.x + row.conductance * shares.y) - entering * shares.w) + entering * shares.z;
    vec3 leaving = row.exit_share * fluence;
    vec3 scale = leaving / max(flux, max(leaving / MOST_SCALE, vec3(1e-30)));
    return max(emergent * scale, vec3(0.0)) / (4.0 * PI * row.ior * row.ior);
}
#endif
