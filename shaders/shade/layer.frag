// A layer that covers a fraction of what is behind it, and shows what an opaque object would (Porter & Duff 1984, `over`);
// or EMITS: light that the interface of a body adds where a ray first enters it. Painted object by object, far ones first.
// What is behind the first body on a ray is kept apart; BODIES: there are some.

#include <constants>
#include <View>
#include <Body>
#include <Environment>
#include "lib/ray.glsl"
#include "shade/opaque_surface.glsl"
#if OPAQUE
#include "intervals/last_axial.glsl"
#endif
#if EMITS
uniform sampler2D entered;  // w: axial depth of the interface where a ray first enters a body
#elif BODIES
uniform sampler2D fronts;   // axial depth where a ray first hits one
#endif
#if !EMITS
uniform float layer_opacity;
#endif

in float axial;
in vec3 world_normal;
in vec3 from_eye;
in vec3 from_center;
in vec2 surface_uv;
#if VERTEX_COLORS
in vec4 vertex_color;
#else
const vec4 vertex_color = vec4(1.0);
#endif

layout(location = 0) out vec4 in_front;  // multiplied by its coverage; w: that coverage
layout(location = 1) out vec4 behind;

void main() {
    // All that takes derivatives comes first: they are undefined where a neighbor has been discarded.
    OpaqueSurface surface = opaque_surface_at(color.rgb, world_normal, from_eye, surface_uv, vertex_color);
    if (surface.is_hole || axial < axial_start) { discard; }
#if OPAQUE
    // What lies on an opaque surface is visible, also where rounding puts it behind.
    if (axial > last_axial() + sheet_tolerance) { discard; }
#endif
    float axial_depth = axial * axial_depth_scale + axial_depth_start;
    // A scene that is flat has no length to count axial depths by.
    float touching = TOUCHING + sheet_tolerance * axial_depth_scale;
    in_front = behind = vec4(0.0);
#if EMITS
    if (abs(axial_depth - texelFetch(entered, ivec2(gl_FragCoord.xy), 0).w) > touching) { discard; }
    in_front.rgb = min(surface.emitted, vec3(NOTHING));
#else
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    // Interpolated normals may look away from the eye where the faces do not: then the surface is viewed edge-on.
    vec3 normal = gl_FrontFacing ? surface.normal : -surface.normal;
    float facing = dot(normal, ray);
    normal = facing > -1e-3 ? normalize(normal - (facing + 1e-3) * ray) : normal;
    float coverage = layer_opacity * surface.opacity;
    vec4 covering = vec4(coverage * min(opaque_radiance_of(surface, normal, ray, from_center), vec3(NOTHING)), coverage);
#if BODIES
    if (axial_depth > texelFetch(fronts, ivec2(gl_FragCoord.xy), 0).r + touching) {
        behind = covering;
        return;
    }
#endif
    in_front = covering;
#endif
}
