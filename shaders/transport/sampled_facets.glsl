// Rough interfaces as mirrors and lenses of one random microfacet for each sample of a pixel. Needs <Surfaces> and
// lib/interface.glsl; MICROFACETS.

#if MICROFACETS
uniform int sample_number;           // of a pixel
uniform float blurred_share;         // of the variance of microfacets, that blurs what is seen in them; the rest is sampled

// Random numbers for the microfacet at an interface of a path: an additive recurrence in four dimensions over the samples of
// a pixel (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"), two for every other interface, from a
// random start for each pixel and path (Jarzynski & Olano 2020, "Hash functions for GPU rendering").
vec2 microfacet_shares(int met, int turns) {
    uvec2 at = uvec2(gl_FragCoord.xy + beyond.xy);
    uint state = (at.x * 1664525u + at.y * 22695477u + uint(met / 2) * 2654435761u + uint(turns) * 40503u) * 747796405u + 2891336453u;
    state = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    state = (state >> 22u) ^ state;
    vec2 step = met % 2 == 0 ? vec2(0.8566749, 0.7338919) : vec2(0.6287067, 0.5385973);
    return fract(vec2(state & 0xffffu, state >> 16) / 65536.0 + float(sample_number) * step);
}

// A microfacet of a rough interface as the ray sees it.
vec3 microfacet_normal(vec3 normal, vec3 direction, float alpha, vec2 shares) {
    vec3 aside = normalize(abs(normal.x) < 0.7 ? cross(normal, vec3(1.0, 0.0, 0.0)) : cross(normal, vec3(0.0, 1.0, 0.0)));
    vec3 up = cross(normal, aside);
    vec3 towards = -vec3(dot(direction, aside), dot(direction, up), dot(direction, normal));
    vec3 local = ggx_visible_normal(towards, alpha, shares);
    return local.x * aside + local.y * up + local.z * normal;
}

// Share of the light on a microfacet that leaves the surface: G2 / G1 of Smith's masking, heights correlated (Heitz 2014).
float masking_ratio(float cos_in, float cos_out, float alpha) {
    if (cos_out <= 0.0) { return 0.0; }
    float into = smith_lambda(cos_in, alpha);
    return (1.0 + into) / (1.0 + into + smith_lambda(cos_out, alpha));
}
#endif
