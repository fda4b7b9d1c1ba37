// Rough interfaces: a random walk of light among the microfacets of a GGX surface, which loses none (Heitz et al. 2016,
// "Multiple-scattering microfacet BSDFs with the Smith model"). Heights are not correlated, and evenly spread from 0 to 1.
// translucent/reference/microfacets.py is the same in float64. Needs lib/interface.glsl, shade/interface_bsdf.glsl and random.glsl.

const int MOST_FACETS = 100;  // that light interacts with; at a roughness of 1 one path in a million gets as far
const float LEVEL = 1e-6;       // largest slope of directions that stay at their height

// Smith's Lambda of GGX, upwards and downwards.
float microfacet_slope(float z, float alpha) {
    float up = clamp(abs(z), LEVEL, 1.0);
    float sine = alpha * alpha * (1.0 - up) * (1.0 + up);
    float upwards = 0.5 * sine / (up * (sqrt(up * up + sine) + up));
    return z > 0.0 ? upwards : -1.0 - upwards;
}

// Moves light to the height of the next microfacet ahead; whether it leaves the surface instead.
bool leaves_surface(vec3 direction, float alpha, float chance, inout float height) {
    float slope = microfacet_slope(direction.z, alpha);
    if (abs(direction.z) < LEVEL) { return false; }
    if (direction.z > 0.0 && (slope == 0.0 || chance <= pow(height, slope))) { return true; }
    height = clamp(height * min(pow(chance, -1.0 / slope), 1e30), 0.0, 1.0);
    return false;
}

// A microfacet that is visible from a direction, from above or from below (Heitz 2018, "Sampling the GGX distribution of
// visible normals").
vec3 visible_facet(vec3 towards, float alpha, vec2 numbers) {
    vec3 stretched = normalize(vec3(alpha * towards.xy, towards.z));
    float across = length(stretched.xy);
    vec3 first = across > 1e-7 ? vec3(-stretched.y, stretched.x, 0.0) / across : vec3(1.0, 0.0, 0.0);
    vec3 second = cross(stretched, first);
    float radius = sqrt(numbers.x);
    float x = radius * cos(2.0 * PI * numbers.y);
    float y = mix(sqrt(max(1.0 - x * x, 0.0)), radius * sin(2.0 * PI * numbers.y), 0.5 * (1.0 + stretched.z));
    vec3 normal = x * first + y * second + sqrt(max(1.0 - x * x - y * y, 0.0)) * stretched;
    return normalize(vec3(alpha * normal.xy, max(normal.z, 0.0)));
}

// Microfacets of an interface, and the film on each.
struct RoughInterface {
    float alpha;
    float ior;         // of the other side relative to this
    float ior_before;  // of this side
    vec3 film;         // as in filmed_reflectance
};

// Density in 1/sr with which microfacets at a height turn light towards a light, unseen by others (Walter et al. 2007,
// eq. 13 to 17).
vec3 turned_to(vec3 to_light, vec3 direction, float height, RoughInterface rough) {
    float ior = rough.ior, alpha = rough.alpha;
    bool back = to_light.z > 0.0;
    float across = back ? 1.0 : ior;
    vec3 half_vector = across * to_light - direction;
    float size = length(half_vector);
    float area = microfacet_slope(direction.z, alpha) * direction.z;
    if (size <= LEVEL || area <= 0.0) { return vec3(0.0); }
    half_vector *= (half_vector.z < 0.0 ? -1.0 : 1.0) / size;
    float cos_half = -dot(direction, half_vector), cos_light = dot(to_light, half_vector);
    if (cos_half <= 0.0 || (cos_light > 0.0) != back) { return vec3(0.0); }
    float base = dot(half_vector.xy, half_vector.xy) + alpha * alpha * half_vector.z * half_vector.z;
    float facets = alpha / base * (alpha / base) / PI;
    float cosine = min(cos_half, 1.0);
    vec3 fresnel = film_over(rough.film, fresnel_dielectric(cosine, ior), cosine, ior, rough.ior_before);
    float leaving = pow(back ? height : 1.0 - height, microfacet_slope(max(abs(to_light.z), LEVEL), alpha));
    return (back ? fresnel : 1.0 - fresnel) * cos_half * facets * across * across * abs(cos_light) / (size * size)
        * leaving / area;
}

// Direction of light that leaves a rough interface; zero where it does not after very many microfacets. Directions are in a
// frame whose third axis is the normal, on the side that light comes from, which has come with a throughput. weight: factor of
// that, as films reflect some colors more than others; light_density: density in 1/sr with which it is scattered to a light.
vec3 scattered_at_microfacets(vec3 direction, RoughInterface rough, vec3 throughput, vec3 to_light, inout Draws draws,
    out vec3 weight, out vec3 light_density) {
    RoughInterface below = RoughInterface(rough.alpha, 1.0 / rough.ior, rough.ior_before * rough.ior, rough.film);
    float alpha = rough.alpha;
    float height = 1.0;
    float side = 1.0;  // below the surface all is as above it, turned upside down
    weight = vec3(1.0);
    light_density = vec3(0.0);
    for (int facet_number = 0; facet_number < MOST_FACETS; ++facet_number) {
        vec4 numbers = random_numbers(draws);
        if (leaves_surface(side * direction, alpha, numbers.x, height)) { return direction; }
        RoughInterface here = below;
        if (side > 0.0) { here = rough; }
#if LIGHTS
        light_density += weight * turned_to(side * to_light, side * direction, height, here);
#endif
        vec3 facet = side * visible_facet(-side * direction, alpha, numbers.yz);
        float cosine = clamp(-dot(direction, facet), 0.0, 1.0);
        float chance = fresnel_dielectric(cosine, here.ior);
        vec3 reflected = film_over(here.film, chance, cosine, here.ior, here.ior_before);
        if (here.film.x > 0.0) {
            vec3 light = throughput * weight;
            chance = dot(light, reflected) / max(dot(light, vec3(1.0)), 1e-30);
        }
        bool passes = numbers.w >= chance;
        if (here.film.x > 0.0) { weight *= passes ? (1.0 - reflected) / max(1.0 - chance, 1e-30) : reflected / max(chance, 1e-30); }
        direction = normalize(passes ? refracted_direction(direction, facet, here.ior) : reflected_direction(direction, facet));
        if (passes) {
            side = -side;
            height = 1.0 - height;  // heights count upwards on either side
        }
    }
    return vec3(0.0);
}
