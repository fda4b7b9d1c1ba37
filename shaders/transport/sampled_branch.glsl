// Branches of random paths and photons at interfaces: one, chosen by chance. Needs interaction.glsl, microfacets.glsl and random.glsl.
// ROUGH: some body is.

const float ALMOST_ONE = 1.0 - 1.0 / 16777216.0;

struct Branch {
    vec3 direction;
    vec3 weight;       // factor of the throughput
    vec3 on_base;      // factor of what comes to the base, of all light or of this branch's
    bool transmitted;
    bool lost;         // among very many microfacets
    bool polished;     // in one direction alone
};

// Whether light walks among microfacets; an interface without a step in ior is smooth.
bool is_rough(Interaction at) {
#if ROUGH
    return at.roughness > 0.0 && at.ior != 1.0;
#else
    return false;
#endif
}

// Fraction that a clear coat, taken for polished, reflects of light that comes from outside.
float coat_at(Interaction at, ObjectRow body) {
    return at.outside || at.thin_walled ? polished_coat_reflectance(body.clearcoat, cosine_of(at)) : 0.0;
}

// Lobes of an interface whose roughness is left out, with a polished clear coat, and the radiance that a thin wall emits.
Lobes polished_lobes(Interaction at, ObjectRow body, out vec3 emitted) {
    float cosine = cosine_of(at);
    Lobes lobes = interface_lobes(at, body, fresnel_dielectric(cosine, at.ior), emitted);
    float coat = coat_at(at, body);
    emitted *= 1.0 - coat;
    lobes = below_coat(lobes, coat);
    lobes.reflection += coat;
    return lobes;
}

// Chooses by a number from 0 to 1 with a chance. The number is then spread from 0 to 1 again, for the next choice.
bool chooses(inout float number, float chance) {
    bool chosen = number < chance;
    number = min(chosen ? number / chance : (number - chance) / (1.0 - chance), ALMOST_ONE);
    return chosen;
}

// A branch by a random number, as likely as the light that it carries. to_light: for rough interfaces, and light_density:
// density in 1/sr with which they scatter light there.
Branch sampled_branch(Interaction at, ObjectRow body, Lobes lobes, vec3 throughput, inout float number, vec3 to_light, inout Draws draws,
    out vec3 light_density) {
    Branch branch;
    branch.lost = false;
    branch.polished = true;
    light_density = vec3(0.0);
    vec3 passing = passing_base(at);
#if ROUGH
    if (is_rough(at) && chooses(number, coat_at(at, body))) {
        branch.transmitted = false;
        branch.weight = vec3(1.0);
        branch.on_base = vec3(0.0);
        branch.direction = reflected_direction(at.direction, at.normal);
    } else if (is_rough(at)) {
        mat3 frame = frame_around(at.normal);
        RoughInterface rough = RoughInterface(at.roughness * at.roughness, at.ior, at.ior_before, body.film);
        vec3 weight;
        vec3 local = scattered_at_microfacets(at.direction * frame, rough, throughput, to_light * frame, draws, weight, light_density);
        branch.lost = local == vec3(0.0);
        branch.polished = false;
        branch.transmitted = local.z < 0.0;
        branch.weight = branch.transmitted ? weight * passing : weight;
        branch.on_base = branch.transmitted ? weight : vec3(0.0);
        branch.direction = frame * local;
    } else
#endif
    {
        vec3 on = lobes.transmission * passing;
        branch.on_base = lobes.transmission;
        float back = dot(throughput, lobes.reflection);
        float chance = back / max(back + dot(throughput, on), 1e-30);
        branch.transmitted = !chooses(number, chance);
        branch.weight = branch.transmitted ? on / (1.0 - chance) : lobes.reflection / max(chance, 1e-30);
        branch.direction = !branch.transmitted ? reflected_direction(at.direction, at.normal)
            : at.thin_walled ? at.direction : refracted_direction(at.direction, at.normal, at.ior);
    }
    branch.direction = kept_on_side(normalize(branch.direction), branch.transmitted ? -at.face_normal : at.face_normal);
    return branch;
}
