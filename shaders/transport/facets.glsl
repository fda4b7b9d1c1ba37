// Rough interfaces as mirrors and lenses of one random microfacet for each sample of a pixel. Needs <Surfaces> and
// interaction.glsl; MICROFACETS. ROUGH: some body is.

#if MICROFACETS
uniform uvec4 microfacet_points;  // of this sample at every other interface: two Sobol points, digits of 16 bits, the first one lowest
uniform float blurred_fraction;   // of the variance of microfacets, that blurs what they reflect; the rest is sampled

uint microfacet_hash(uint state) {
    state = state * 747796405u + 2891336453u;
    state = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (state >> 22u) ^ state;
}

// A number from 0 to 1 in a random order of all intervals of its base-2 digits (Owen 1995), by the hash of Laine & Karras 2011
// (Burley 2020, "Practical hash-based Owen scrambling"). bits: its digits, the first one lowest.
float scrambled_number(uint bits, uint key) {
    bits += key;
    bits ^= bits * 0x6c50b47cu;
    bits ^= bits * 0xb82f1e52u;
    bits ^= bits * 0xc7afe638u;
    bits ^= bits * 0x8d22f6e6u;
    bits = (bits & 0x00ff00ffu) << 8u | (bits & 0xff00ff00u) >> 8u;
    bits = (bits & 0x0f0f0f0fu) << 4u | (bits & 0xf0f0f0f0u) >> 4u;
    bits = (bits & 0x33333333u) << 2u | (bits & 0xccccccccu) >> 2u;
    bits = (bits & 0x55555555u) << 1u | (bits & 0xaaaaaaaau) >> 1u;
    return (float(bits & 0xffffu) + 0.5) / 65536.0;
}

// Random numbers for the microfacet at an interface of a path: points of a Sobol sequence over the samples of a pixel, scrambled
// for each pixel and interface.
vec2 microfacet_numbers(uvec2 pixel, int depth, uint branch_code) {
    uint key = microfacet_hash(pixel.x * 1664525u + pixel.y * 22695477u + uint(depth) * 2654435761u + branch_code * 40503u);
    uvec2 point = depth % 2 == 0 ? microfacet_points.xy : microfacet_points.zw;
    return vec2(scrambled_number(point.x, key), scrambled_number(point.y, microfacet_hash(key)));
}
#endif

// What a random microfacet takes the place of.
struct Facet {
    vec3 surface_normal;
    float alpha;         // of all microfacets; 0 where the surface itself is smooth, or blurs alone
};

// Turns an interaction to a random microfacet, where some of its roughness is sampled. alpha: squared roughness of what is left.
Facet take_facet(inout Interaction at, inout float alpha, uvec2 pixel, int depth, uint branch_code) {
#if ROUGH
    if (at.roughness > 0.0 && blurred_fraction < 1.0) {
        Facet facet = Facet(at.normal, alpha);
        at.normal = microfacet_normal(at.normal, at.direction, sqrt(1.0 - blurred_fraction) * alpha, microfacet_numbers(pixel, depth, branch_code));
        at.roughness = 0.0;
        alpha *= sqrt(blurred_fraction);
        return facet;
    }
#endif
    return Facet(at.normal, 0.0);
}

// Squared width of the refracted lobe over that of microfacets, as of a mirror: mean of both axes, in directions outside. A normal
// that tilts by d turns the refracted direction by |c' - c / n| d across the plane of incidence and |c' - c / n| / c' d within it,
// with the cosines c and c' before and behind the interface (derivatives of Snell's law); a mirror turns by 2 d.
float refracted_spread(Interaction at, vec3 refracted) {
#if ROUGH
    float ior_inside = max(at.ior, 1.0 / at.ior);
    if (at.thin_walled) { return 0.25 * (ior_inside - 1.0) * (ior_inside - 1.0); }
    float behind = max(-dot(refracted, at.normal), LEAST_ACROSS);
    float turned = behind - cosine_of(at) / at.ior, outside = at.ior > 1.0 ? at.ior : 1.0;
    return 0.25 * turned * turned * outside * outside * 0.5 * (1.0 + 1.0 / (behind * behind));
#else
    return 0.0;
#endif
}

// What other microfacets block comes to more of them, and ends up in the denser medium: of the light outside nine tenths go in, and
// of that inside nine tenths stay (by random walks, Heitz et al. 2016). refracted: direction of the light that goes on.
void mask_lobes(inout Lobes lobes, Facet facet, Interaction at, vec3 refracted) {
#if ROUGH
    if (facet.alpha > 0.0) {
        float towards = -dot(facet.surface_normal, at.direction);
        vec3 reflected = reflected_direction(at.direction, at.normal);
        vec3 back = lobes.reflection * masking_ratio(towards, dot(facet.surface_normal, reflected), facet.alpha);
        vec3 on = lobes.transmission;
        if (!at.thin_walled) { on *= masking_ratio(towards, -dot(facet.surface_normal, refracted), facet.alpha); }
        vec3 blocked = lobes.reflection + lobes.transmission - back - on;
        lobes.reflection = back;
        lobes.transmission = on;
        if (at.thin_walled) { return; }
        if (at.ior > 1.0) { lobes.transmission += blocked; } else { lobes.reflection += blocked; }
    }
#endif
}
