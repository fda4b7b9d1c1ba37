// Branches of random paths and photons at interfaces: one, chosen by chance. Needs interaction.glsl, microfacets.glsl and random.glsl.
// ROUGH: some body is.

struct Branch {
    vec3 direction;
    vec3 weight;       // factor of the throughput
    bool transmitted;
    bool lost;         // among very many microfacets
};

// Whether light walks among microfacets; an interface without a step in ior is smooth.
bool is_rough(Interaction at) {
#if ROUGH
    return at.roughness > 0.0 && at.ior != 1.0;
#else
    return false;
#endif
}

// Lobes of an interface whose roughness is left out, with a polished clear coat, and the radiance that a thin wall emits.
Lobes polished_lobes(Interaction at, ObjectRow body, out vec3 emitted) {
    float cosine = cosine_of(at);
    Lobes lobes = interface_lobes(at, body, fresnel_dielectric(cosine, at.ior), emitted);
    float coat = at.outside || at.thin_walled ? polished_coat_reflectance(body.clearcoat, cosine) : 0.0;
    emitted *= 1.0 - coat;
    lobes = below_coat(lobes, coat);
    lobes.reflection += coat;
    return lobes;
}

// A branch by a random number, as likely as the light that it carries. to_light: for rough interfaces, with seen: density in 1/sr
// with which they turn light there.
Branch sampled_branch(Interaction at, Lobes lobes, vec3 throughput, float share, vec3 to_light, inout Draws draws, out float seen) {
    Branch branch;
    branch.lost = false;
    seen = 0.0;
    vec3 passing = passing_base(at);
#if ROUGH
    if (is_rough(at)) {
        mat3 frame = frame_around(at.normal);
        vec3 local = scattered_at_microfacets(at.direction * frame, at.ior, at.roughness * at.roughness, to_light * frame, draws, seen);
        branch.lost = local == vec3(0.0);
        branch.transmitted = local.z < 0.0;
        branch.weight = branch.transmitted ? passing : vec3(1.0);
        branch.direction = frame * local;
    } else
#endif
    {
        vec3 on = lobes.transmission * passing;
        float back = dot(throughput, lobes.reflection);
        float chance = back / max(back + dot(throughput, on), 1e-30);
        branch.transmitted = share >= chance;
        branch.weight = branch.transmitted ? on / (1.0 - chance) : lobes.reflection / max(chance, 1e-30);
        branch.direction = !branch.transmitted ? reflected_direction(at.direction, at.normal)
            : at.thin_walled ? at.direction : refracted_direction(at.direction, at.normal, at.ior);
    }
    branch.direction = kept_on_side(normalize(branch.direction), branch.transmitted ? -at.face_normal : at.face_normal);
    return branch;
}
