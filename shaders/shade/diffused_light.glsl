// Subsurface light: what leaves bodies in which light has diffused. Needs <ObjectRow> and interface_light.glsl. DIFFUSED: there are such bodies.

#if DIFFUSED
#include "lib/diffusion.glsl"
#include "shade/diffused_texture.glsl"

// Fluence, and flux that enters with its mean cosine inside, at a point of a surface: of each side as much as the normal looks there.
// travel: mean direction of that light along the axes of the grid, shorter than 1 where it comes from several; 0 if unknown.
void light_at_surface(ObjectRow row, vec3 point, vec3 normal, out vec3 fluence, out vec4 entering, out vec3 travel) {
    vec3 texels = vec3(textureSize(diffused_light, 0));
    vec3 place = point - row.grid_low;
    vec3 at = vec3(dot(place, row.grid_x), dot(place, row.grid_y), dot(place, row.grid_z));
    at = clamp(at, vec3(0.5), row.grid_size - 0.5) + vec3(0.0, 0.0, row.first_layer);
    vec3 towards = vec3(dot(normal, row.grid_x), dot(normal, row.grid_y), dot(normal, row.grid_z));
    float total = dot(towards, towards);
    vec3 part = total > 0.0 ? towards * towards / total : vec3(1.0 / 3.0);
    fluence = vec3(0.0);
    entering = vec4(0.0);
    travel = vec3(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        if (part[axis] == 0.0) { continue; }
        vec3 side = vec3(towards[axis] < 0.0 ? row.grid_size.x : 0.0, float(axis) * row.grid_size.y, 0.0);
        fluence += part[axis] * textureLod(diffused_light, (at + side) / texels, 0.0).rgb;
        side.z += row.grid_size.z;
        entering += part[axis] * textureLod(diffused_light, (at + side) / texels, 0.0);
        if (row.turned > 0.0) {
            side.z += row.grid_size.z;
            travel += part[axis] * (textureLod(diffused_light, (at + side) / texels, 0.0).rgb - 1.0);
        }
    }
}

// Point of the surface above the place where light that leaves at a point, against a ray in a `direction`, was scattered last. As
// entering light is first scattered beside where it enters. path: in metres through the object, with an optical depth.
vec3 above_last_event(ObjectRow row, vec3 point, vec3 normal, vec3 direction, float path, vec3 optical_depth) {
    float depth = dot((1.0 - row.ahead) * optical_depth, vec3(1.0 / 3.0));
    vec3 along = (direction - dot(direction, normal) * normal) * (path * last_event_fraction(depth));
    return point + along * (MOST_BESIDE / max(length(along) * length(row.grid_x), MOST_BESIDE));
}

// Basic radiance L / n^2 inside an object, below a point of its surface and against a ray there in a `direction`. normal: outwards,
// or 0 deep inside; cosine: between both; path, optical_depth: back through the object, on which it has been scattered.
vec3 subsurface_exitance(int object, vec3 point, vec3 normal, vec3 direction, float cosine, float path, vec3 optical_depth) {
    ObjectRow row = object_table_row(object);
    if (row.diffuses < 0.5) { return vec3(0.0); }
    if (normal != vec3(0.0)) { point = above_last_event(row, point, normal, direction, path, optical_depth); }
    vec3 fluence;
    vec4 entering;
    vec3 travel;
    light_at_surface(row, point, normal, fluence, entering, travel);
    float m = clamp(entering.a, LEAST_ENTERING_COSINE, 1.0);
    vec3 emergent = emergent_radiance(fluence, entering.rgb, row.albedo, row.conductance, m, cosine);
    // Scaled so that the flux that leaves is that of the diffusion.
    vec3 flux = vec3(0.0);
    for (int i = 0; i < 3; ++i) {
        flux += row.exit_weights[i] * emergent_radiance(fluence, entering.rgb, row.albedo, row.conductance, m, row.exit_cosines[i]);
    }
    float together = length(travel);
    vec3 outwards = vec3(dot(normal, row.grid_x), dot(normal, row.grid_y), dot(normal, row.grid_z)) / length(row.grid_x);
    // What comes through the body and goes on ahead is found by ahead_from_lights.
    vec3 once = entering.rgb * (1.0 - min(max(dot(travel, outwards), 0.0) / max(cosine, LEAST_ENTERING_COSINE), 1.0));
    if (row.turned > 0.0 && together > 0.0) {
        // Light from several directions is scattered as by a phase function with smaller moments: even light, whose mean direction is
        // 2 / 3 long, as by one without any.
        vec4 phase = row.phase * vec4(vec2(clamp(3.0 * together - 2.0, 0.0, 1.0)), 1.0, 1.0);
        vec3 scale = 1.0 / (row.albedo + (1.0 - row.albedo) * row.turned);
        vec3 back = normalize(vec3(dot(direction, row.grid_x), dot(direction, row.grid_y), dot(direction, row.grid_z)));
        emergent += once / (cosine + m) * first_events_excess(phase, scale, -dot(travel, back) / together);
        for (int i = 0; i < 3; ++i) {
            float up = row.exit_cosines[i];
            flux += row.exit_weights[i] * once / (up + m) * mean_first_events_excess(phase, scale, m, up);
        }
    }
    vec3 scale = row.exit_share * fluence / max(flux, vec3(1e-30));
    return emergent * scale * opacity((1.0 - row.ahead) * optical_depth) / (4.0 * PI * row.ior * row.ior);
}

// Basic radiance of an opaque surface inside an object, by the light that comes to it there.
vec3 inclusion_exitance(int object, vec3 point, vec3 color) {
    ObjectRow row = object_table_row(object);
    vec3 place = point - row.grid_low;
    vec3 at = vec3(dot(place, row.grid_x), dot(place, row.grid_y), dot(place, row.grid_z));
    at = clamp(at, vec3(0.5), row.grid_size - 0.5) + vec3(0.0, 0.0, row.first_layer + (row.turned > 0.0 ? 3.0 : 2.0) * row.grid_size.z);
    vec3 irradiance = textureLod(diffused_light, at / vec3(textureSize(diffused_light, 0)), 0.0).rgb;
    return color * irradiance / (PI * row.ior * row.ior);
}

// Environment in a direction, over what events ahead make of it by a depth of these.
vec3 blurred_ahead(ObjectRow row, vec3 direction, vec3 depth) {
    if (row.ahead_deepest == 0.0) { return environment_light(direction, IN_SCATTERED_ROUGHNESS); }
    vec2 uv = equirectangular_uv(direction, 0.0);
    vec3 size = vec3(textureSize(diffused_light, 0));
    vec2 at = vec2(1.0 + AHEAD_WIDTH * fract(uv.x), clamp(AHEAD_HEIGHT * uv.y, 0.5, AHEAD_HEIGHT - 0.5));
    vec3 level = sqrt(min(depth / row.ahead_deepest, vec3(1.0))) * (AHEAD_DEPTHS - 1.0) + 0.5 + row.ahead_layer;
    return vec3(
        textureLod(diffused_light, vec3(at, level.r) / size, 0.0).r,
        textureLod(diffused_light, vec3(at, level.g) / size, 0.0).g,
        textureLod(diffused_light, vec3(at, level.b) / size, 0.0).b
    );
}

// Radiance that comes along a ray, in a direction inside, by light that is scattered ahead in an object, and which diffusion
// takes for unscattered: of the optical depth on the ray the part by such events does not count. From the environment behind,
// blurred, as if the ray left straight on, and of what is mirrored there. For pictures whose rays are not followed inside.
vec3 ahead_in_scattered(int object, vec3 direction, vec3 optical_depth) {
    ObjectRow row = object_table_row(object);
    vec3 in_scattered = transmittance((1.0 - row.ahead) * optical_depth) - transmittance(optical_depth);
    if (max(in_scattered.r, max(in_scattered.g, in_scattered.b)) <= 0.0) { return vec3(0.0); }
    vec3 depth = row.ahead * optical_depth;
    vec3 mirrored = ahead_mirrored(1.0, row.ior, row.inner_mirror, row.inner_mirror_flux, depth, row.ahead_cosine);
    vec3 found = (1.0 - mirrored) * blurred_ahead(row, direction, depth);
    if (row.ior > 1.0) {
        vec3 far = row.in_scattered_far * environment_light(direction, IN_SCATTERED_ROUGHNESS);
        found += mirrored * (far + row.in_scattered_near * environment_light(-direction, IN_SCATTERED_ROUGHNESS));
    }
    return in_scattered * found;
}

// Fraction of a light that enters at a point of a surface, as the grid knows it: none where the body itself is before the light.
float entering_fraction(ObjectRow row, vec3 point, vec3 normal, vec3 irradiance) {
    vec3 fluence, travel;
    vec4 entering;
    light_at_surface(row, point, normal, fluence, entering, travel);
    vec3 across = entering.rgb / (max(entering.a, LEAST_ENTERING_COSINE) * max(row.albedo, vec3(1e-6)));
    return min(dot(across, vec3(1.0)) / max(dot(irradiance, vec3(1.0)), 1e-30), 1.0);
}

// The same of light of the lights, through a wall whose far side is parallel. normal: outwards where the ray begins inside.
vec3 ahead_from_lights(int object, vec3 far_end, vec3 normal, vec3 direction, vec3 optical_depth) {
    ObjectRow row = object_table_row(object);
    vec3 sum = vec3(0.0);
    float g = row.ahead_cosine;
    if (row.diffuses < 0.5 || g <= 0.0) { return sum; }
    float leaving = -dot(normal, direction);
    for (int light = 0; light < light_count; ++light) {
        LightSample arriving = light_at(light, far_end);
        float down = -dot(normal, arriving.towards);
        if (leaving <= 0.0 || down <= 0.0) { continue; }
        vec3 inside = refracted_direction(-arriving.towards, -normal, row.ior);
        float within = max(dot(normal, inside), LEAST_ENTERING_COSINE);
        arriving.irradiance *= (1.0 - fresnel_dielectric(down, row.ior)) * down / within;
        vec3 depth = optical_depth * (leaving / within);
        vec3 part = scattered_ahead(depth, row.ahead, g, -dot(direction, inside), staying_fraction(leaving, g)) / (4.0 * PI * row.ior * row.ior);
        if (max(part.r, max(part.g, part.b)) <= FAINTEST_HIGHLIGHT) { continue; }
        part *= entering_fraction(row, far_end, direction, arriving.irradiance);
        sum += part * irradiance_reaching(light, arriving, far_end, -normal);
    }
    return sum;
}
#else
vec3 ahead_from_lights(int object, vec3 far_end, vec3 normal, vec3 direction, vec3 optical_depth) { return vec3(0.0); }
vec3 subsurface_exitance(int object, vec3 point, vec3 normal, vec3 direction, float cosine, float path, vec3 optical_depth) { return vec3(0.0); }
vec3 ahead_in_scattered(int object, vec3 direction, vec3 optical_depth) { return vec3(0.0); }
vec3 inclusion_exitance(int object, vec3 point, vec3 color) { return vec3(0.0); }
#endif
