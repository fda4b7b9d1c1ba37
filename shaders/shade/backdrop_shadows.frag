// Shadows of bodies on a picture drawn elsewhere: the fraction of the light there that reaches the visible surfaces, by channel. Its
// normals are those of its depth. EVEN_LIGHT: it was drawn with that light from all around, in place of the environment's.

#include <constants>
#include <View>
#include <Surfaces>
#include <Environment>
#include "lib/environment.glsl"
#include "shade/in_picture.glsl"
#include "shade/diffuse_light.glsl"
#include "shade/shadows.glsl"

uniform sampler2D opaque_axial_depth;
uniform float behind_all;  // axial depth of what is infinitely far
#if EVEN_LIGHT
uniform vec3 even_light;   // radiance
#endif

layout(location = 0) out vec4 unoccluded;

bool is_there(ivec2 texel) {
    return all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, ivec2(frame_size.xy)))
        && texelFetch(opaque_axial_depth, texel, 0).r < behind_all;
}

// Point that a pixel shows; all samples read one picture, which belongs to the centers.
vec3 visible_point(ivec2 texel) {
    vec2 center = vec2(texel) + 0.5;
    return point_at(vec2(center.x, frame_size.y - center.y), texelFetch(opaque_axial_depth, texel, 0).r);
}

// Offset along the surface to the next pixel ahead or back: to the nearer one, which is not beyond an edge. 0: there is none.
vec3 tangent_along(ivec2 texel, ivec2 ahead, vec3 point) {
    vec3 offset = vec3(0.0);
    float shortest = NOTHING;
    for (int side = -1; side <= 1; side += 2) {
        ivec2 next = texel + side * ahead;
        if (!is_there(next)) { continue; }
        vec3 found = float(side) * (visible_point(next) - point);
        if (dot(found, found) < shortest) {
            offset = found;
            shortest = dot(found, found);
        }
    }
    return offset;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    unoccluded = vec4(1.0);
    if (!is_there(texel)) { return; }
    vec3 point = visible_point(texel);
    vec3 from_eye = point + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    vec3 towards_eye = surface_right.w == 1.0 ? -from_eye : -ray_forward.xyz;
    vec3 across = cross(tangent_along(texel, ivec2(1, 0), point), tangent_along(texel, ivec2(0, 1), point));
    // What has no neighbors faces the eye.
    vec3 normal = normalize(dot(across, across) > 0.0 ? across : towards_eye);
    normal = dot(normal, towards_eye) < 0.0 ? -normal : normal;
#if EVEN_LIGHT
    vec3 all_light = PI * even_light;
#else
    vec3 all_light = environment_irradiance(normal);
#endif
    vec3 reaching = all_light * environment_reaching(point, normal);
    for (int light = 0; light < light_count; ++light) {
        vec3 sent = light_irradiance_on(light, point, normal);
        if (sent == vec3(0.0)) { continue; }
        all_light += sent;
        reaching += sent * light_reaching(light, point, normal);
    }
    unoccluded.rgb = mix(vec3(1.0), reaching / max(all_light, vec3(1e-30)), greaterThan(all_light, vec3(0.0)));
}
