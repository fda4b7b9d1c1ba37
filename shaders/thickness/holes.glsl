// Where the alpha of a sheet's color makes a hole. Takes derivatives.

uniform sampler2D color_texture;
uniform vec3 color_rows[2];  // coordinates in the picture, v upwards, from (u, v, 1)
uniform float hole_below;

in vec2 surface_uv;
#if VERTEX_COLORS
in vec4 vertex_color;
#endif

bool is_hole() {
    float alpha = texture(color_texture, vec2(dot(color_rows[0], vec3(surface_uv, 1.0)),
                                              1.0 - dot(color_rows[1], vec3(surface_uv, 1.0)))).a;
#if VERTEX_COLORS
    alpha *= vertex_color.a;
#endif
    return alpha < hole_below;
}
