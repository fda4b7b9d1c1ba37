// The interface of a body where a ray first enters it, or first leaves one: its normal, axial depth and material.
// BACK: where it leaves; BEYOND: farther than what has been entered, or else ahead of the eye; EXITS: where the intervals
// say that it leaves all bodies. HOLES: of a sheet whose alpha makes some. LIGHTS: highlights need the variance of normals.

#include <constants>
#include <View>
#include <Body>
#include "lib/ray.glsl"
#include "shade/normal_variance.glsl"
#include "shade/surface_textures.glsl"

#if OPAQUE
uniform sampler2D opaque_axial_depth;
#endif
#if BEYOND
uniform sampler2D entered;
#endif
#if EXITS
uniform sampler2D ordered_layers;  // alpha: axial depth where the ray first leaves all bodies
#endif
uniform vec4 surface_color;  // w: transmission
uniform float surface_roughness;

in float axial;
in vec3 world_normal;
in vec3 from_eye;
in vec2 surface_uv;
#if VERTEX_COLORS
in vec4 vertex_color;
#else
const vec4 vertex_color = vec4(1.0);
#endif
#if HOLES
uniform float hole_below;
#endif

layout(location = 0) out vec4 out_normal;  // unit; w: axial depth
layout(location = 1) out vec4 out_surface;  // object, roughness, transmission, variance of normals
#if !BACK
layout(location = 2) out vec4 out_color;  // w: fraction of the light of the environment that reaches it
#endif

void main() {
    // All that takes derivatives comes first: they are undefined where a neighbor has been discarded.
    vec3 normal = mapped_normal(normalize(world_normal), from_eye, surface_uv);
#if LIGHTS
    float variance = packed_variance(sample_filter(SURFACE_TEXTURES == 1 ? normal : world_normal, from_eye).normals);
#else
    const float variance = 0.0;
#endif
    float roughness = surface_roughness * textured_roughness(surface_uv).g;
    float transmission = surface_color.w * textured_transmission(surface_uv);
#if !BACK
    vec4 textured = vertex_color * textured_color(surface_uv);
    vec4 tint = vec4(surface_color.rgb * textured.rgb, unoccluded(surface_uv));
#if HOLES
    if (textured.a < hole_below) { discard; }
#endif
#endif
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    float axial_depth = axial * axial_depth_scale + axial_depth_start;
    ivec2 texel = ivec2(gl_FragCoord.xy);
#if OPAQUE && !BACK
    if (axial_depth > texelFetch(opaque_axial_depth, texel, 0).r) { discard; }
#endif
#if EXITS
    if (axial_depth < texelFetch(ordered_layers, texel, 0).a - TOUCHING) { discard; }
#elif BEYOND
    if (axial_depth < texelFetch(entered, texel, 0).w) { discard; }
#endif
    gl_FragDepth = clamp(axial_depth, 0.0, 1.0);
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    vec3 ray = normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
    // Interpolated normals may look away from the eye where the faces do not: then the interface is viewed edge-on.
    normal = (gl_FrontFacing ? normal : -normal);
    float facing = dot(normal, ray);
    normal = facing > -1e-3 ? normalize(normal - (facing + 1e-3) * ray) : normal;
    out_normal = vec4(normal, axial_depth);
    out_surface = vec4(float(object), clamp(roughness, 0.0, 1.0), transmission, variance);
#if !BACK
    out_color = tint;
#endif
}
