// Rough interfaces as mirrors and lenses of one random microfacet for each sample of a pixel. Needs <Surfaces> and
// interaction.glsl; MICROFACETS. ROUGH: some body is.

#if MICROFACETS
uniform int sample_number;           // of a pixel
uniform float blurred_fraction;         // of the variance of microfacets, that blurs what they reflect; the rest is sampled

// Random numbers for the microfacet at an interface of a path: an additive recurrence in four dimensions over the samples of
// a pixel (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"), two for every other interface, from a
// random start for each pixel and path (Jarzynski & Olano 2020, "Hash functions for GPU rendering").
vec2 microfacet_numbers(uvec2 pixel, int depth, uint branch_code) {
    uint state = (pixel.x * 1664525u + pixel.y * 22695477u + uint(depth) * 2654435761u + branch_code * 40503u) * 747796405u + 2891336453u;
    state = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    state = (state >> 22u) ^ state;
    vec2 step = depth % 2 == 0 ? vec2(0.8566749, 0.7338919) : vec2(0.6287067, 0.5385973);
    return fract(vec2(state & 0xffffu, state >> 16) / 65536.0 + float(sample_number) * step);
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
