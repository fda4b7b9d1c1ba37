// Vertices of a body's interface: as in body.vert, with what its surface needs.

#include <Body>

in vec3 offset;
in vec3 corner_normal;  // smooth
in vec2 uv;
#if VERTEX_COLORS
in vec4 corner_color;
out vec4 vertex_color;
#endif

out float axial;
out vec3 world_normal;
out vec3 from_eye;     // world axes
out vec3 from_center;  // of the media
out vec2 surface_uv;

invariant gl_Position;

void main() {
    gl_Position = clip_from_offset * vec4(offset, 1.0);
    axial = dot(axis.xyz, offset) + axis.w;
    world_normal = mat3(world_from_normal) * corner_normal;
    from_eye = (eye_from_offset * vec4(offset, 1.0)).xyz;
    from_center = mat3(eye_from_offset) * offset + anchor_from_center.xyz;
    surface_uv = uv;
#if VERTEX_COLORS
    vertex_color = corner_color;
#endif
}
