// Photons as points of the picture, where it shows the surfaces on which they have landed. What each adds to the irradiance
// of its pixels is its power, over the area that a pixel covers of the plane in which it lies. Each photon is a square half a
// pixel wide, in up to four pixels: photons start on a lattice, and without a width they would show its moire in even light.

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"

uniform sampler2D landed_point;        // from the center of the media; w: 1 where it has landed
uniform sampler2D landed_power;
uniform sampler2D landed_normal;       // of the face, unit, to the side on which it lies
uniform sampler2D opaque_axial_depth;

flat out vec4 irradiance;  // a: fraction of the photon

const float STEEPEST_FACE = 0.1;  // sine of the angle between faces of one curved surface within a pixel
const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);

// Whether a pixel shows the plane of a photon, but for the angle between faces of what is curved. along: metres on the plane
// that a pixel is wide. behind: the pixel shows something nearer to the eye.
bool shows_plane(vec2 corner, vec3 point, vec3 normal, float along, out bool behind) {
    float depth = texelFetch(opaque_axial_depth, stored(ivec2(corner)), 0).r;
    behind = false;
    if (depth >= NOTHING) { return false; }
    float off = dot(point_at(corner + 0.5 + frame_size.zw, depth) - point, normal);
    behind = off > 0.0;
    return abs(off) <= STEEPEST_FACE * along + 10.0 * SURFACE_OFFSET * surface_reach;
}

void main() {
    int width = textureSize(landed_point, 0).x;
    int number = gl_VertexID / 4;
    ivec2 place = ivec2(number % width, number / width);
    gl_Position = NOWHERE;
    irradiance = vec4(0.0);
    vec4 point = texelFetch(landed_point, place, 0);
    if (point.w != 1.0) { return; }
    vec3 normal = texelFetch(landed_normal, place, 0).xyz;
    vec2 projected = picture_position(point.xyz).xy - frame_size.zw;
    vec2 corner = floor(projected);
    if (any(lessThan(corner, vec2(0.0))) || any(greaterThanEqual(corner, frame_size.xy))) { return; }

    // Metres along the camera's axis for which the picture grows by its half extent; 1 where rays are parallel.
    bool perspective = surface_right.w == 1.0;
    float spread = perspective ? metres_ahead_of(point.xyz) + surface_ahead.z : 1.0;
    vec3 from_eye = point.xyz + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    vec3 view = perspective ? from_eye / spread : ray_forward.xyz;
    float facing = -dot(normal, view);
    if (facing <= 0.0) { return; }  // the eye sees the other side
    vec2 pixel = 2.0 * vec2(length(surface_right.xyz), length(surface_up.xyz)) * spread / frame_size.xy;
    float along = max(pixel.x, pixel.y) * length(view) / facing;
    bool behind;
    if (!shows_plane(corner, point.xyz, normal, along, behind)) {
        if (behind) { return; }
        // It is visible at the edge of its surface, where its pixel shows what is beyond: the nearest one has it, which
        // shows that surface all over.
        vec2 away = projected - corner - 0.5;
        vec2 aside = abs(away.x) > abs(away.y) ? vec2(sign(away.x), 0.0) : vec2(0.0, sign(away.y));
        vec2 edge = corner;
        for (int side = 0; side < 4; ++side) {
            vec2 other = corner + (side < 2 ? aside : aside.yx) * (side % 2 == 0 ? 1.0 : -1.0);
            bool inside = all(greaterThanEqual(other, vec2(0.0))) && all(lessThan(other, frame_size.xy));
            if (inside && shows_plane(other, point.xyz, normal, along, behind)) {
                edge = other;
                break;
            }
        }
        if (edge == corner) { return; }
        corner = edge;
    }
    vec2 off = projected - floor(projected) - 0.5;
    ivec2 aside = ivec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1);
    vec2 beyond = max(2.0 * abs(off) - 0.5, 0.0);
    vec2 part = mix(1.0 - beyond, beyond, vec2(aside));
    // Where a neighboring pixel shows another surface, the photon's own pixel gets its part.
    vec2 other = corner + sign(off) * vec2(aside);
    bool inside = all(greaterThanEqual(other, vec2(0.0))) && all(lessThan(other, frame_size.xy));
    if (inside && shows_plane(other, point.xyz, normal, along, behind)) { corner = other; }
    irradiance = part.x * part.y * vec4(texelFetch(landed_power, place, 0).rgb * (facing / (pixel.x * pixel.y)), 1.0);
    gl_Position = vec4((vec2(stored(ivec2(corner))) + 0.5) / frame_size.xy * 2.0 - 1.0, 0.0, 1.0);
}
