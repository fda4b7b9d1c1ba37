// Light that reaches a point of an opaque surface through everything on the straight path, or an interface past what is opaque: a
// lookup in maps of paths to the first opaque surface on each ray of a light. Transmittance is interpolated between four texels, and a texel counts only if the surface, made
// flat, is not behind what is opaque there (receiver plane, Isidoro 2006): so no surface shadows itself, however it is inclined.
// Needs <constants>. Points count from the center of the media; normals are unit vectors.

#include <Lights>
#include "shade/ground_map.glsl"

#if SHADOW_MAPS
#include <Shadows>
#include <SkyShadows>

uniform sampler2D shadow_sums;  // path, with exits less entries before the end; paths in two media; or of more optical depths; for each metre ahead
uniform sampler2D shadow_ends;  // metres ahead of the center where an opaque surface ends the ray

// A map, and how a point projects into it: from -1 to 1, and metres ahead of the light.
struct ShadowView {
    vec4 right;
    vec4 up;
    vec4 ahead;
    vec2 corner;
    float size;
    bool perspective;
    bool ends;  // opaque objects block some rays
};

ShadowView shadow_view(int number) {
    vec4 place = shadow_views[4 * number + 3];
    return ShadowView(shadow_views[4 * number], shadow_views[4 * number + 1], shadow_views[4 * number + 2], place.xy, place.z,
        mod(place.w, 2.0) == 1.0, place.w >= 2.0);
}

ShadowView sky_view(int number) {
    float numbered = sky_views[4 * number + 3].w;
    int place = int(abs(numbered)) - 1;
    vec2 corner = float(sky_size) * vec2(place % sky_columns, place / sky_columns);
    return ShadowView(sky_views[4 * number], sky_views[4 * number + 1], sky_views[4 * number + 2], corner, float(sky_size),
        false, numbered < 0.0);
}

// Which of the six views of a cube looks at a point, given from the light.
int shadow_cube_face(vec3 from_light) {
    vec3 size = abs(from_light);
    int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    return 2 * axis + (from_light[axis] < 0.0 ? 1 : 0);
}

// Transmittance of a texel's ray down to where it ends, which advances so many metres for each metre ahead.
vec3 texel_transmittance(ivec2 at, float end, float advance) {
#if SHADOW_SPECTRAL
    vec3 optical_depth = texelFetch(shadow_sums, at, 0).rgb;
#else
    vec2 found = texelFetch(shadow_sums, at, 0).rg;
    vec3 optical_depth = shadow_second.w > 0.0
        ? found.r * shadow_extinction.rgb + found.g * shadow_second.rgb
        : (found.r - found.g * end) * shadow_extinction.rgb;
#endif
    return exp(-clamp(optical_depth * advance, 0.0, MAX_OPTICAL_DEPTH));
}

// Transmittance of the path to a point; 1 beyond the map, where nothing is that throws a shadow. If not dimmed, the fraction that
// nothing opaque blocks. aside: metres by which the light is beside where the map looks from, along its right and up, for what
// throws shadows so many metres from it.
vec3 light_through(ShadowView view, vec3 point, vec3 normal, bool dimmed, vec2 aside, float away) {
    vec4 here = vec4(point, 1.0);
    vec3 projected = vec3(dot(view.right, here), dot(view.up, here), dot(view.ahead, here));
    float spread = view.perspective ? projected.z : 1.0;
    vec2 place = projected.xy / spread;
    vec2 spans = inversesqrt(vec2(dot(view.right.xyz, view.right.xyz), dot(view.up.xyz, view.up.xyz)));
    vec2 shift = aside == vec2(0.0) ? aside : aside / spans * max(1.0 / away - 1.0 / spread, 0.0);
    vec2 looked_up = place + shift;
    if (spread <= 0.0 || max(abs(looked_up.x), abs(looked_up.y)) >= 1.0) { return vec3(1.0); }
    // The plane of the surface, in these coordinates.
    vec3 plane = vec3(dot(normal, view.right.xyz) / dot(view.right.xyz, view.right.xyz),
                      dot(normal, view.up.xyz) / dot(view.up.xyz, view.up.xyz), dot(normal, view.ahead.xyz));
    float ahead = dot(view.ahead.xyz, point);
    float texel_metres = 2.0 * spread * spans.x / view.size;
    float steepest = STEEPEST_SHADOW * (texel_metres + spread * spans.x * length(shift));
    vec2 position = (0.5 * looked_up + 0.5) * view.size - 0.5;
    vec2 corner = floor(position);
    vec2 fraction = position - corner;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 step = vec2(i & 1, i >> 1);
        vec2 texel = clamp(corner + step, vec2(0.0), vec2(view.size - 1.0));
        vec2 there = (texel + 0.5) * (2.0 / view.size) - 1.0;
        float tilt = view.perspective ? dot(plane, vec3(there, 1.0)) : plane.z;
        float rise = spread * dot(plane.xy, place - there) / (abs(tilt) > 1e-6 ? tilt : 1e-6);
        ivec2 at = ivec2(view.corner + texel);
        float end = view.ends ? texelFetch(shadow_ends, at, 0).r : 0.0;
        if (view.ends && ahead + clamp(rise, -steepest, steepest) > end + SHADOW_MARGIN * texel_metres) { continue; }
        vec2 weights = mix(1.0 - fraction, fraction, step);
        vec3 passed = dimmed ? texel_transmittance(at, end, view.perspective ? length(vec3(there * spans, 1.0)) : 1.0) : vec3(1.0);
        sum += weights.x * weights.y * passed;
    }
    return sum;
}

// The map of a light that covers a point, for lights with maps.
ShadowView light_view(int light, vec3 point) {
    int first = int(shadow_lights[light].x);
    if (int(shadow_lights[light].y) == 1) { return shadow_view(first); }
    // All six look from the light; the first along +x.
    vec3 from_light = vec3(shadow_views[4 * first + 2].w, shadow_views[4 * (first + 2) + 2].w, shadow_views[4 * (first + 4) + 2].w) + point;
    return shadow_view(first + shadow_cube_face(from_light));
}

// The mean over the disc of a light with a size: of four places on it, turned from light to light so that none fall together.
// One loop, in which a light without size leaves at once: compilers then inline the lookup once.
vec3 disc_through(int light, ShadowView view, vec3 point, vec3 normal, bool dimmed) {
    float radius = light_power[light].w;
    vec2 aside = 0.70710678 * radius * vec2(cos(float(light)), sin(float(light)));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        sum += light_through(view, point, normal, dimmed, aside, shadow_lights[light].z);
        if (radius == 0.0) { return sum; }
        aside = vec2(-aside.y, aside.x);
    }
    return 0.25 * sum;
}

vec3 light_reaching(int light, vec3 point, vec3 normal) {
    if (int(shadow_lights[light].y) == 0) { return vec3(1.0); }
    return disc_through(light, light_view(light, point), point, normal, true);
}

// Share of a light that opaque objects let pass to an interface. What media keep of it transport/light_passed.glsl finds:
// the maps have the paths to the first opaque surface, and not to where an interface is.
float light_unblocked(int light, vec3 point, vec3 normal) {
    if (int(shadow_lights[light].y) == 0) { return 1.0; }
    ShadowView view = light_view(light, point);
    return view.ends ? disc_through(light, view, point, normal, false).r : 1.0;
}

// Irradiance on a surface from one of the directions.
vec3 light_of_sky(int number, vec3 normal) {
    return sky_views[4 * number + 3].rgb * max(-dot(normal, sky_views[4 * number + 2].xyz), 0.0);
}

bool in_sky_map(int number, vec3 point) {
    return max(abs(dot(sky_views[4 * number], vec4(point, 1.0))), abs(dot(sky_views[4 * number + 1], vec4(point, 1.0)))) < 1.0;
}

#if GROUND_SHADOWS
uniform sampler2D ground_shadows;  // fraction of the light of the environment that bodies take from a ground
uniform vec4 ground_rows[2];       // position on the ground, from a point

// Fraction of the light of the environment that reaches a point of the ground.
vec3 ground_reaching(vec3 point) {
    vec2 at = vec2(dot(ground_rows[0], vec4(point, 1.0)), dot(ground_rows[1], vec4(point, 1.0)));
    return 1.0 - textureLod(ground_shadows, 0.5 + 0.5 * squeezed(at), 0.0).rgb;
}
#endif

#if GROUND_SHADOWS == 1
vec3 environment_reaching(vec3 point, vec3 normal) { return ground_reaching(point); }
#else
#if GROUND_SHADOWS
uniform vec4 mapped_ground;        // unit normal upwards, and metres along it from the center of the media

bool on_mapped_ground(vec3 point, vec3 normal) {
    float reach = inversesqrt(dot(ground_rows[0].xyz, ground_rows[0].xyz));
    return abs(dot(mapped_ground.xyz, point) - mapped_ground.w) <= GROUND_TOLERANCE * reach && dot(normal, mapped_ground.xyz) > 0.5;
}
#else
bool on_mapped_ground(vec3 point, vec3 normal) { return false; }
vec3 ground_reaching(vec3 point) { return vec3(1.0); }
#endif

// Share of the light of the environment that reaches a surface.
vec3 environment_reaching(vec3 point, vec3 normal) {
    if (sky_count == 0) { return vec3(1.0); }
    if (on_mapped_ground(point, normal)) { return ground_reaching(point); }
    vec3 all = vec3(0.0), reaching = vec3(0.0), light = vec3(0.0);
    int step = abs(sky_step);
    bool alone = sky_step < 0;
    for (int i = alone ? sky_first : 0; i < sky_count; i += alone ? step : 1) { all += light_of_sky(i, normal); }
    int i = sky_first;
    while (i < sky_count) {
        // All pixels of a group look for their next direction in which anything may be, and then look it up together.
        bool found = false;
        while (i < sky_count && !found) {
            light = light_of_sky(i, normal);
            found = light != vec3(0.0) && in_sky_map(i, point);
            if (!found) {
                reaching += light;
                i += step;
            }
        }
        if (found) { reaching += light * light_through(sky_view(i), point, normal, true, vec2(0.0), 1.0); }
        i += step;
    }
    return mix(vec3(1.0), (alone ? 1.0 : float(step)) * reaching / max(all, vec3(1e-30)), greaterThan(all, vec3(0.0)));
}
#endif
#else
float light_unblocked(int light, vec3 point, vec3 normal) { return 1.0; }
vec3 light_reaching(int light, vec3 point, vec3 normal) { return vec3(1.0); }
vec3 environment_reaching(vec3 point, vec3 normal) { return vec3(1.0); }
#endif
