// Light that leaves a body in which it diffuses. Pure. Fluence and flux in W/m^2 for radiance in W/(m^2 sr). Each function is
// the float32 twin of the same name in translucent/formulas/diffusion.py, where the source is cited: Eddington 1926.

// Radiance times 4 pi, inside a body below its surface and towards it, of light that has been scattered: fluence phi at the
// surface, flux E that enters there times the albedo w, conductance c of the interface, mean cosine m of entering light.
vec3 emergent_radiance(vec3 fluence, vec3 entering, vec3 albedo, float conductance, float mean_cosine, float cosine) {
    vec3 once = entering / (cosine + mean_cosine);
    return albedo * (fluence * (1.0 + 3.0 * conductance * cosine) - 3.0 * once * cosine * cosine) + once;
}
