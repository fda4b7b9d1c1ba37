// Light that leaves a body in which it diffuses. Pure. Fluence and flux in W/m^2 for radiance in W/(m^2 sr). Each function is
// the float32 twin of the same name in translucent/formulas/diffusion.py, where it is derived.

// Radiance times 4 pi, inside a body below its surface and towards it, of light that has been scattered: fluence phi at the
// surface, flux E that enters there times the albedo w, conductance c of the interface, mean cosine m of entering light inside.
vec3 emergent_radiance(vec3 fluence, vec3 entering, vec3 albedo, float conductance, float mean_cosine, float cosine) {
    vec3 d = (2.0 - albedo) / 3.0;
    vec3 k = sqrt((1.0 - albedo) / d);
    vec3 slant = 1.0 + k * mean_cosine;
    vec3 own = min(entering / (slant * (conductance + k * d)), fluence);
    vec3 once = entering / (cosine + mean_cosine);
    vec3 gathered = (own + once * (mean_cosine * cosine) / (d * slant)) / (1.0 + k * cosine);
    vec3 rising = 1.0 + conductance * cosine / d + k * k * cosine * cosine;
    return once + albedo * (gathered + (fluence - own) * rising);
}
