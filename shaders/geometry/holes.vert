// Vertices of a sheet with holes: as in body.vert, flat, with what decides where the holes are.

#include <Body>

in vec3 offset;
in vec3 normal;
in vec2 uv;
#if VERTEX_COLORS
in vec4 corner_color;
out vec4 vertex_color;
#endif

out float axial;
out vec3 world_normal;
out vec2 surface_uv;

invariant gl_Position;

void main() {
    gl_Position = clip_from_offset * vec4(offset, 1.0);
    axial = dot(axis.xyz, offset) + axis.w;
    world_normal = mat3(world_from_normal) * normal;
    surface_uv = uv;
#if VERTEX_COLORS
    vertex_color = corner_color;
#endif
}
