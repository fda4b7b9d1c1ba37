// Where a ray hits no interface: what is behind, through the media there. Row 0 of the output is the top row.
// REST: beyond the part of the picture that media may cover. In that part, depth lets shade/surfaces.frag pass where there
// is an interface, and nothing is added to a sum there; APART: but for transmittance, and STRAIGHT_LIGHT: but for what media
// add along the straight ray.

#include <constants>
#include <View>
#include <Environment>
#include "lib/optics.glsl"
#include "lib/ray.glsl"
#define seen_checkerboard (seen_kind == ENVIRONMENT_CHECKERBOARD)
#include "shade/background.glsl"
#if STRAIGHT_LIGHT
#include <ObjectRow>
#include "shade/interface_bsdf.glsl"

uniform sampler2D surface_parameters;  // of what is entered: object, roughness, transmission, variance of normals
uniform sampler2D surface_color;
#endif

uniform float weight;  // samples that this one counts as

#if !REST
uniform sampler2D emitted_radiance_sum;
uniform sampler2D straight_transmittance;
uniform sampler2D entered;
#if !ONE_INTERFACE
uniform sampler2D left;
#endif
#endif

layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

void main() {
    vec2 pixel = gl_FragCoord.xy + frame_size.zw;
    ivec2 texel = ivec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y);
    vec3 ray = view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz);
    // The same operations as before a ray is refracted: the two shaders must give one picture.
    vec3 behind = background(pixel, ray / length(ray), texel);
#if REST
    out_radiance = vec4(behind, 1.0);
    out_transmittance = vec4(1.0);
#else
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 emitted = texelFetch(emitted_radiance_sum, here, 0).rgb;
    vec3 through = texelFetch(straight_transmittance, here, 0).rgb;
    vec4 entry = texelFetch(entered, texel, 0);
    float front = entry.w;
#if ONE_INTERFACE
    bool none = front >= NOTHING;
#else
    bool none = front >= NOTHING && texelFetch(left, texel, 0).w >= front;
#endif
    gl_FragDepth = none ? 0.0 : 1.0;
    out_radiance = none ? vec4(behind * through + emitted, 1.0) : vec4(0.0);
#if APART
    out_transmittance = vec4(through, none ? 1.0 : 0.0);
#if STRAIGHT_LIGHT
    vec3 parameters = texelFetch(surface_parameters, texel, 0).rgb, passing = parameters.b * texelFetch(surface_color, texel, 0).rgb;
    ObjectRow row = object_table_row(int(parameters.r + 0.5));
    float cosine = clamp(-dot(entry.xyz, normalize(ray)), 0.0, 1.0);
    if (!none) { out_radiance.rgb = emitted * leaving_fraction(passing, cosine, row.ior, parameters.g, vec2(row.clearcoat, row.clearcoat_roughness)); }
#endif
#else
    out_transmittance = none ? vec4(through, 1.0) : vec4(0.0);
#endif
#endif
    out_radiance *= weight;
    out_transmittance *= weight;
}
