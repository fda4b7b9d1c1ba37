// Radiance at the ends of rays: of the environment, or of an opaque object. Needs <View>, <Surfaces>, <ObjectRow>,
// shade/environment_light.glsl, shade/environment_beyond.glsl, shade/background.glsl, opaque_objects.glsl, textured_hit.glsl
// and footprint.glsl. AHEAD: some bodies scatter light ahead, for which needs shade/diffused_light.glsl.

// The environment in a polished mirror: as it is defined, where it is no picture.
vec3 polished_environment(vec3 direction) {
#if FOOTPRINTS
    return mirrored_environment(direction);
#else
    return mix(light_first.rgb, light_second.rgb, light_kind == ENVIRONMENT_GRADIENT ? gradient_share(direction) : 0.5);
#endif
}

vec3 environment_radiance(vec3 point, vec3 direction, bool reflected, float blur) {
#if MICROFACETS
    float roughness = sqrt(sqrt(min(blur, 1.0)));
    return reflected ? environment_light(direction, roughness) : environment_beyond(point, direction, roughness);
#elif SEEN_LIGHTS
    return mirrored_environment(direction);
#else
    return reflected ? polished_environment(direction) : environment_beyond(point, direction, 0.0);
#endif
}

// Scattering events on a ray that its light counts as going straight on: see `through_media`. It sees what is at its end as sharp
// as without them by exp(-depth), and else blurred.
struct EventsAhead {
    vec3 depth;        // optical depth of these events
    float path;        // metres from them, on average
    int body;          // in which they were last; AIR for none
};

const EventsAhead NONE_AHEAD = EventsAhead(vec3(0.0), 0.0, AIR);

// The end of a ray that has left the scene, or has hit an opaque object.
struct EscapedRay {
    int object;        // that is opaque; AIR for the environment
    int triangle;      // -1: unknown
    vec2 weights;      // of its second and third corner
    float width;       // metres of the object over which its textures are averaged
    vec3 normal;       // of the object
    vec3 origin;
    vec3 point;        // of the object
    vec3 direction;
    bool reflected;
    float blur;
    Ellipse ellipse;
    EventsAhead ahead;
};

#if OPAQUE
uniform int picture_first;  // 1: the picture has light of opaque objects that rays do not find

// How much the axial depth of a surface may differ between the centers of neighboring pixels.
float depth_within_pixel(vec3 point, vec3 normal) {
    vec3 from_eye = point + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    vec3 view = surface_right.w == 1.0 ? normalize(from_eye) : ray_forward.xyz;
    float facing = abs(dot(view, normal));
    return pixel_metres(dot(from_eye, ray_forward.xyz)) * sqrt(1.0 - min(facing * facing, 1.0)) / max(facing, 1e-3);
}

// Opaque objects as the picture shows them: with their textures, and blurred behind rough interfaces. False where it does not.
bool opaque_in_picture(EscapedRay end, out vec3 light) {
    vec3 projected = picture_position(end.point);
    if (!in_picture(projected.xy)) { return false; }
    ivec2 texel = stored(texel_of(projected.xy));
    float there = texelFetch(opaque_axial_depth, texel, 0).r;
    if (abs(there - projected.z) * surface_ahead.y >= 1e-2 * surface_reach + depth_within_pixel(end.point, end.normal)) { return false; }
#if MICROFACETS
    if (end.blur > 0.0) {
        vec4 blurred = blurred_opaque(projected.xy, blur_width(sqrt(end.blur), length(end.point - end.origin), end.point));
        light = blurred.rgb + (1.0 - blurred.a) * environment_radiance(end.origin, end.direction, end.reflected, end.blur);
        return true;
    }
#endif
    vec4 found = texelFetch(opaque_radiance, texel, 0);
    light = adaptive == 1 ? found.rgb / max(found.a, 1e-3) : found.rgb;  // the mean of samples, some may pass it
    return true;
}
#endif

// The environment averaged over what the pixel sees of it. False for rays that see it as a background, or no picture.
bool environment_in_footprint(EscapedRay end, out vec3 light) {
#if FOOTPRINTS
    if (end.reflected || SEEN_LIGHTS == 1) {
        light = averaged_environment(end.direction, end.blur, end.ellipse);
        return true;
    }
#endif
    return false;
}

#if OPAQUE
// The opaque object at the end of a ray, its textures averaged over what the ray sees of it: by light that is scattered ahead a
// blur as wide as a box of the same variance.
ObjectRow body_at_end(EscapedRay end) {
    if (end.triangle < 0) { return traced_body(end.object); }
    ObjectRow body = body_at(end.object, end.triangle, end.weights, end.width);
#if AHEAD && TEXTURED
    if (end.ahead.body != AIR) {
        // Events ahead have the second Legendre moment g.
        float sine = sqrt(2.0 / 3.0 * (1.0 - object_table_row(end.ahead.body).ahead_cosine));
        float across = end.ahead.path * sine * inversesqrt(1.0 - sine * sine);
        vec3 blurred = body_at(end.object, end.triangle, end.weights, max(end.width, sqrt(6.0) * across)).color;
        body.color = mix(blurred, body.color, transmittance(end.ahead.depth));
    }
#endif
    return body;
}

vec3 radiance_of_opaque(EscapedRay end) {
    vec3 light;
    bool has_textures = picture_first == 0 && reads_all_textures(end.object);
    bool has_light = traced_body(end.object).diffuses > 0.5;  // photons in the picture would count twice
    bool is_known = has_light || (has_textures && end.triangle >= 0 && end.blur == 0.0);
    if (is_known || !opaque_in_picture(end, light)) {
        ObjectRow body = body_at_end(end);
        light = opaque_light(body, end.normal, end.direction, end.point);
    }
    return light;
}
#endif

vec3 radiance_beyond(EscapedRay end) {
    vec3 light;
    if (!environment_in_footprint(end, light)) { light = environment_radiance(end.origin, end.direction, end.reflected, end.blur); }
#if AHEAD
    if (end.ahead.body != AIR) {
#if FOOTPRINTS
        vec3 blurred = blurred_ahead(object_table_row(end.ahead.body), end.direction, end.ahead.depth);
#else
        vec3 blurred = polished_environment(end.direction);  // it has hardly any details
#endif
        light = mix(blurred, light, transmittance(end.ahead.depth));
    }
#endif
    return light;
}

vec3 escaped_radiance(EscapedRay end) {
#if OPAQUE
    if (end.object != AIR) { return radiance_of_opaque(end); }
#endif
    return radiance_beyond(end);
}
