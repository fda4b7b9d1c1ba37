// Light that a segment of a view ray scatters once into it: from each light, Gauss-Legendre points of
// integral T_view(s) sigma_s p(cos) E(s) T_light(s) ds over the segment.
//
// The points are those of a variable in which the exponential is constant, were its exponent linear from end to end (the
// secant): with E(s) = sigma_t s + tau_light(s) and x = E(L) - E(0), s(u) = -(L / x) log(1 - (1 - e^-x) u). Where a
// point light is near, the angle at it takes the place of s (equiangular sampling, Kulla & Fajardo 2012), which
// cancels its 1 / r^2; where it is inside a medium, so that the exponent has a kink next to it, the angle alone. Needs <View>.

#include "intervals/slots.glsl"
#include "lib/phase.glsl"
#include "shade/lights.glsl"
#include "volume/light_views.glsl"

struct ViewRay {
    vec3 start;      // from the center of the media
    vec3 direction;  // of unit length
};

// Right and down of the pixel at hand, from -1 to 1 over the picture.
vec2 pixel_in_picture() {
    return 2.0 * (vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw) / frame_size.xy - 1.0;
}

// The view ray from an axial depth of the walk on. Nothing here is larger than the scene, however far away the eye is.
ViewRay ray_from(float axial_depth) {
    float axial = scatter_near.x + axial_depth * media_length;
    float spread = scatter_near.z == 1.0 ? axial : 1.0;
    vec2 pixel = pixel_in_picture();
    vec3 across = pixel.x * scatter_right.xyz - pixel.y * scatter_up.xyz;
    vec3 along = ray_forward.xyz * (axial_depth * media_length + scatter_near.y);
    return ViewRay(across * spread - scatter_off_axis.xyz + along, normalize(ray_forward.xyz + across * scatter_near.z));
}

// Scattering times phase function of what fills a point, for a cosine between the directions of travel.
vec3 scattering_phase(float weights[SLOTS], float cos_scatter) {
    vec3 sum = vec3(0.0);
    for (int slot = 0; slot < SLOTS; ++slot) {
        if (weights[slot] > 0.0) {
            sum += weights[slot] * slot_scattering[slot].rgb * phase_value(slot_phase[slot], cos_scatter);
        }
    }
    return sum;
}

// One light's radiance at distance s along the segment, per metre, without the transmittances; w: its visibility.
vec4 scattered_here(float weights[SLOTS], int light, ViewRay ray, float s, out vec3 tau) {
    vec3 point = ray.start + s * ray.direction;
    LightSample arriving = light_at(light, point);
    tau = vec3(0.0);
    if (arriving.irradiance == vec3(0.0)) { return vec4(0.0); }  // a spot's view ends with its cone
    LightDepth found = light_depth(light, point);
    tau = found.depth;
    return vec4(arriving.irradiance * scattering_phase(weights, dot(arriving.towards, ray.direction)), found.visible);
}

// Between which distances, within metres, a ray is in a cone; rest is 1 - cos of its half angle. Cones are convex, and
// their edges are where (sin * along the axis)^2 = (cos * across)^2.
vec2 cone_part(vec3 from_light, vec3 direction, vec3 axis, float rest, float metres) {
    vec2 along = vec2(dot(direction, axis), dot(from_light, axis));
    vec3 turning = direction - along.x * axis;
    vec3 across = from_light - along.y * axis;
    float sin2 = rest * (2.0 - rest);
    float cos2 = (1.0 - rest) * (1.0 - rest);
    float a = sin2 * along.x * along.x - cos2 * dot(turning, turning);
    float b = sin2 * along.x * along.y - cos2 * dot(turning, across);
    float c = sin2 * along.y * along.y - cos2 * dot(across, across);
    float square = b * b - a * c;
    if (square < 0.0 && a < 0.0) { return vec2(0.0); }
    float q = -(b + (b < 0.0 ? -1.0 : 1.0) * sqrt(max(square, 0.0)));
    if (abs(q) < 1e-30) { return vec2(0.0, metres); }
    vec2 ends = vec2(q / (abs(a) < 1e-30 ? 1e-30 : a), c / q);
    ends = vec2(min(ends.x, ends.y), max(ends.x, ends.y));
    // Steeper than the cone a ray crosses its mirror image, too; else it is between the edges of one of the two.
    if (a >= 0.0) {
        ends = along.x > 0.0 ? vec2(ends.y, metres) : vec2(0.0, ends.x);
    } else if (along.y + 0.5 * (ends.x + ends.y) * along.x < 0.0) {
        return vec2(0.0);
    }
    return clamp(ends, 0.0, metres);
}

// Ends of the three parts of a segment, some empty, in which a light shines smoothly: a spot between its outer
// and inner cone, in the inner one, and behind.
vec4 lit_parts(int light, ViewRay ray, float metres) {
    vec4 cone = light_cone[light];
    float size2 = dot(cone.xyz, cone.xyz);
    if (size2 == 0.0) { return vec4(0.0, vec3(metres)); }
    vec3 from_light = ray.start - light_position[light].xyz;
    vec3 axis = cone.xyz * inversesqrt(size2);
    vec2 outer = cone_part(from_light, ray.direction, axis, 0.5 * cone.w / size2, metres);
    if (cone.w < 1.0 + 1e-5) { return outer.xyyy; }
    vec2 inner = cone_part(from_light, ray.direction, axis, 0.5 * (cone.w - 1.0) / size2, metres);
    return inner.x < inner.y ? vec4(outer.x, inner, outer.y) : outer.xyyy;
}

// Where v in 0..1 a fraction u of the integral of e^(-x v) is reached, and dv / du there. A rising exponential is a falling
// one from its other end.
vec2 secant_point(float u, float x) {
    float fall = abs(x);
    float fraction = x < 0.0 ? 1.0 - u : u;
    float q = opacity(vec3(fall)).x;
    vec2 found;
    if (fall < 1e-3) {
        found = vec2(fraction * (1.0 - 0.5 * fall * (1.0 - fraction)), 1.0 - 0.5 * fall * (1.0 - 2.0 * fraction));
    } else {
        found = vec2(-log_one_minus(q * fraction), q / (1.0 - q * fraction)) / fall;
    }
    return x < 0.0 ? vec2(1.0 - found.x, found.y) : found;
}

// From a part of a segment.
vec3 scatter_from_part(float weights[SLOTS], int light, ViewRay ray, vec2 lit, vec3 sigma) {
    float metres = lit.y - lit.x;
    vec3 tau;
    vec3 tau_start = light_depth(light, ray.start + lit.x * ray.direction).depth;
    vec3 tau_end = light_depth(light, ray.start + lit.y * ray.direction).depth;
    vec3 rise = sigma * metres + tau_end - tau_start;

    // Where the light is nearest: at distance closest along the ray, height metres off it.
    vec4 position = light_position[light];
    float closest = dot(position.xyz - ray.start, ray.direction);
    float height = max(length(position.xyz - ray.start - closest * ray.direction), 1e-4 * metres);
    bool angular = position.w == 1.0 && height < NEAR_LIGHT * metres && closest > lit.x - metres && closest < lit.y + metres;
    if (scatter_light_views[light].y < 0.0) {
        angular = true;
        rise = vec3(0.0);
    }
    float first = atan(lit.x - closest, height);
    float angle = atan(lit.y - closest, height) - first;

    vec3 sum = vec3(0.0);
    for (int i = 0; i < gauss_count; ++i) {
        float u = gauss[i].x;
#if GRAY
        const int channels = 1;
#else
        const int channels = 3;
#endif
        for (int channel = 0; channel < channels; ++channel) {
            vec2 warped = secant_point(u, rise[channel]);
            float weight = gauss[i].y * warped.y;
            float s = lit.x + metres * warped.x;
            if (angular) {
                float tangent = tan(first + angle * warped.x);
                s = clamp(closest + height * tangent, lit.x, lit.y);
                weight *= angle * height * (1.0 + tangent * tangent);
            } else {
                weight *= metres;
            }
            vec4 light_here = scattered_here(weights, light, ray, s, tau);
            vec3 here = weight * light_here.a * light_here.rgb * transmittance(sigma * s + tau);
#if GRAY
            sum += here;
#else
            sum[channel] += here[channel];
#endif
        }
    }
    return sum;
}

vec3 in_scattered(float weights[SLOTS], ViewRay ray, float metres, vec3 sigma) {
    vec3 sum = vec3(0.0);
    for (int light = 0; light < scatter_light_count; ++light) {
        vec4 ends = lit_parts(light, ray, metres);
        for (int i = 0; i < 3; ++i) {
            if (ends[i] < ends[i + 1]) { sum += scatter_from_part(weights, light, ray, vec2(ends[i], ends[i + 1]), sigma); }
        }
    }
    return sum;
}
