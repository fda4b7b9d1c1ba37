// Directions of random paths at opaque surfaces: of one lobe of the bsdf, chosen by chance. Needs shade/opaque_light.glsl and random.glsl.

// Direction in which microfacets reflect, drawn among the visible ones (Heitz 2018); away: (1 - cos)^5 of the angle to the facet;
// returns the fraction that others do not mask.
float sampled_facet(vec3 normal, float alpha, float cos_view, vec2 numbers, inout vec3 direction, out float away) {
    vec3 facet = microfacet_normal(normal, direction, alpha, numbers);
    away = pow(1.0 - clamp(-dot(facet, direction), 0.0, 1.0), 5.0);
    direction = reflected_direction(direction, facet);
    return masking_ratio(cos_view, dot(normal, direction), alpha);
}

// The direction of a path behind an opaque surface, and the factor of its throughput: the bsdf times the cosine over the density of the
// direction, for a lobe that is as likely as the light that it reflects. transmitted: it goes on behind the surface.
vec3 sampled_opaque(OpaqueBsdf bsdf, vec3 normal, vec3 throughput, vec3 numbers, inout vec3 direction, out bool transmitted) {
    float below = 1.0 - bsdf.coated, cos_view = clamp(-dot(normal, direction), 1e-3, 1.0);
    vec4 lobes = vec4(dot(throughput, below * bsdf.base), dot(throughput, below * bsdf.passed),
        dot(throughput, below * mix(bsdf.dielectric.albedo, bsdf.metal.albedo, bsdf.metallic)), dot(throughput, vec3(bsdf.coated)));
    float total = lobes.x + lobes.y + lobes.z + lobes.w, at = numbers.x * total, away;
    transmitted = false;
    if (total <= 0.0) { return vec3(0.0); }
    if (at < lobes.x + lobes.y) {
        transmitted = at >= lobes.x;
        direction = turned_by(transmitted ? -normal : normal, sqrt(numbers.y), numbers.z);
        return transmitted ? below * bsdf.passed * (total / lobes.y) : below * bsdf.base * (total / lobes.x);
    }
    if (at < lobes.x + lobes.y + lobes.z) {
        float unmasked = sampled_facet(normal, bsdf.alpha, cos_view, numbers.yz, direction, away);
        vec3 reflected = mix(layer_reflectance(bsdf.dielectric, away), layer_reflectance(bsdf.metal, away), bsdf.metallic);
        return below * reflected * (unmasked * total / lobes.z);
    }
    float unmasked = sampled_facet(normal, bsdf.coat_alpha, cos_view, numbers.yz, direction, away);
    return bsdf.coat_weight * layer_reflectance(bsdf.coat, away) * (unmasked * total / max(lobes.w, 1e-30));
}
