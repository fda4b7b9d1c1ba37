// Textures of a surface, over the texture coordinates of its mesh. These functions take derivatives: call them before any discard.
// SURFACE_TEXTURES: the surface has textures; else all factors are 1.

#if SURFACE_TEXTURES
uniform sampler2D color_texture;
uniform sampler2D roughness_texture;
uniform sampler2D transmission_texture;
uniform sampler2D normal_texture;
uniform sampler2D emissive_texture;
#if OCCLUSION
uniform sampler2D occlusion_texture;
#endif
uniform float texture_bias;     // of the mipmap: a sample is narrower than a pixel
uniform vec3 texture_rows[12];  // two for each, in this order: coordinates in the picture, v upwards, from (u, v, 1)

const int COLOR_TEXTURE = 0;
const int ROUGHNESS_TEXTURE = 1;
const int TRANSMISSION_TEXTURE = 2;
const int NORMAL_TEXTURE = 3;
const int EMISSIVE_TEXTURE = 4;
const int OCCLUSION_TEXTURE = 5;

vec2 turned_uv(int number, vec2 uv) {
    return vec2(dot(texture_rows[2 * number], vec3(uv, 1.0)), dot(texture_rows[2 * number + 1], vec3(uv, 1.0)));
}

// Image row 0 is the top, where v = 1.
vec2 texture_coordinate(int number, vec2 uv) {
    vec2 turned = turned_uv(number, uv);
    return vec2(turned.x, 1.0 - turned.y);
}

vec4 textured_color(vec2 uv) { return texture(color_texture, texture_coordinate(COLOR_TEXTURE, uv), texture_bias); }
vec4 textured_roughness(vec2 uv) { return texture(roughness_texture, texture_coordinate(ROUGHNESS_TEXTURE, uv), texture_bias); }
float textured_transmission(vec2 uv) { return texture(transmission_texture, texture_coordinate(TRANSMISSION_TEXTURE, uv), texture_bias).r; }
vec3 textured_emission(vec2 uv) { return texture(emissive_texture, texture_coordinate(EMISSIVE_TEXTURE, uv), texture_bias).rgb; }

// Fraction of the light of the environment that reaches a point.
float unoccluded(vec2 uv) {
#if OCCLUSION
    return texture(occlusion_texture, texture_coordinate(OCCLUSION_TEXTURE, uv)).r;
#else
    return 1.0;
#endif
}

// A normal map's normal, by the directions in which the picture's coordinates grow on the surface (Schueler 2013).
// normal: unit, to either side; position: of the point, from the eye.
vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv) {
    vec3 mapped = texture(normal_texture, texture_coordinate(NORMAL_TEXTURE, uv)).rgb * 2.0 - 1.0;
    vec2 turned = turned_uv(NORMAL_TEXTURE, uv);
    vec3 along_x = dFdx(position), along_y = dFdy(position);
    vec2 uv_x = dFdx(turned), uv_y = dFdy(turned);
    vec3 across_x = cross(normal, along_x), across_y = cross(along_y, normal);
    vec3 tangent = across_y * uv_x.x + across_x * uv_y.x;
    vec3 bitangent = across_y * uv_x.y + across_x * uv_y.y;
    float longest = max(dot(tangent, tangent), dot(bitangent, bitangent));
    if (!(longest > 0.0)) { return normal; }  // no texture coordinates to speak of
    // Where the normal looks away from the eye, the two directions on the picture turn around it in the other sense.
    float scale = inversesqrt(longest) * (dot(cross(along_x, along_y), normal) < 0.0 ? -1.0 : 1.0);
    return normalize(tangent * scale * mapped.x + bitangent * scale * mapped.y + normal * max(mapped.z, 1e-3));
}
#else
vec4 textured_color(vec2 uv) { return vec4(1.0); }
vec4 textured_roughness(vec2 uv) { return vec4(1.0); }
float textured_transmission(vec2 uv) { return 1.0; }
vec3 textured_emission(vec2 uv) { return vec3(1.0); }
float unoccluded(vec2 uv) { return 1.0; }
vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv) { return normal; }
#endif
