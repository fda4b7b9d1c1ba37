// Photons as points of the picture, where it shows the surfaces on which they have landed. What each adds to the irradiance
// of its pixels is its power, over the area that a pixel covers of the plane in which it lies.
//
// Each photon is a square that is as large as some photons take where they land, up to a pixel wide. Photons start on a
// lattice, and without a width they would show its moire in even light. In a focus they have almost no width. The area that a
// photon takes there is its footprint (photon differentials, Schjoeth et al. 2007, "Photon differentials"; Frisvad et al. 2014,
// "Photon differential splatting for rendering caustics"), here from differences to photons that start beside it. Of the two
// that start on opposite sides, the nearer one counts, as the other may have taken another path.
//
// Pixels count photons in all of their area. So their squares stay where they are, wherever a sample is taken in them:
// counted in squares around the points of several samples, a focus would be blurred by one more pixel.

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"

uniform sampler2D landed_point;        // from the center of the media; w: 1 where it has landed
uniform sampler2D landed_power;
uniform sampler2D landed_normal;       // of the face, unit, to the side on which it lies
uniform sampler2D opaque_axial_depth;
uniform int landed_count;
uniform vec2 counted_around;  // middle of the squares in which photons are counted, from the centers of pixels
uniform ivec2 beside;     // differences of number between photons that start side by side, in two directions
uniform float footprint;  // area of some photons, as a fraction of the parallelogram to these two neighbors

flat out vec3 irradiance;
flat out vec4 parts;        // of the photon: in its pixel, beside it, above or below, and aside of both
flat out ivec2 own_texel;

const float STEEPEST_FACE = 0.1;  // sine of the angle between faces of one curved surface within a pixel
const float WIDEST = 1.0;         // pixels
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

bool is_inside(vec2 corner) {
    return all(greaterThanEqual(corner, vec2(0.0))) && all(lessThan(corner, frame_size.xy));
}

ivec2 place_of(int number) {
    return ivec2(uint(number) % PHOTON_WIDTH, uint(number) / PHOTON_WIDTH);
}

// Finds the offset to the nearer of two photons that start on opposite sides of a photon; false if neither has landed.
bool to_neighbor(int number, vec3 point, int by, out vec3 nearest) {
    bool found = false;
    nearest = vec3(0.0);
    for (int other = number - by; other <= number + by; other += 2 * by) {
        if (other < 0 || other >= landed_count) { continue; }
        vec4 landed = texelFetch(landed_point, place_of(other), 0);
        vec3 towards = landed.xyz - point;
        if (landed.w != 1.0 || (found && dot(towards, towards) > dot(nearest, nearest))) { continue; }
        nearest = towards;
        found = true;
    }
    return found;
}

// Side of a photon's square in pixels. pixels: number of pixels that a square metre of its plane covers in the picture.
float photon_width(int number, vec3 point, vec3 normal, float pixels) {
    vec3 one, other;
    if (!to_neighbor(number, point, beside.x, one) || !to_neighbor(number, point, beside.y, other)) { return WIDEST; }
    return clamp(sqrt(abs(dot(cross(one, other), normal)) * footprint * pixels), 1e-4, WIDEST);
}

// Fractions of a photon in its pixel and the next ones. Where a neighboring pixel shows another surface, the photon's own pixel
// gets its part.
vec4 parts_of(vec2 corner, vec2 off, float size, vec3 point, vec3 normal, float along) {
    vec2 beyond = max(0.5 + (abs(off) - 0.5) / size, 0.0);
    vec4 found = vec4(1.0, 0.0, 0.0, 0.0);
    if (beyond == vec2(0.0)) { return found; }
    for (int i = 1; i < 4; ++i) {
        vec2 aside = vec2(i & 1, i >> 1);
        vec2 both = mix(1.0 - beyond, beyond, aside);
        vec2 other = corner + sign(off) * aside;
        bool behind;
        if (both.x * both.y == 0.0 || !is_inside(other) || !shows_plane(other, point, normal, along, behind)) { continue; }
        found[i] = both.x * both.y;
        found[0] -= found[i];
    }
    return found;
}

void main() {
    ivec2 place = place_of(gl_VertexID);
    gl_Position = NOWHERE;
    gl_PointSize = 1.0;
    irradiance = vec3(0.0);
    parts = vec4(1.0, 0.0, 0.0, 0.0);
    own_texel = ivec2(0);
    vec4 point = texelFetch(landed_point, place, 0);
    if (point.w != 1.0) { return; }
    vec3 normal = texelFetch(landed_normal, place, 0).xyz;
    vec2 projected = picture_position(point.xyz).xy - counted_around;
    vec2 corner = floor(projected);
    if (!is_inside(corner)) { return; }

    // Metres along the camera's axis for which the picture grows by its half extent; 1 where rays are parallel.
    bool perspective = surface_right.w == 1.0;
    float spread = perspective ? metres_ahead_of(point.xyz) + surface_ahead.z : 1.0;
    vec3 from_eye = point.xyz + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    vec3 view = perspective ? from_eye / spread : ray_forward.xyz;
    float facing = -dot(normal, view);
    if (facing <= 0.0) { return; }  // the eye sees the other side
    vec2 pixel = 2.0 * vec2(length(surface_right.xyz), length(surface_up.xyz)) * spread / frame_size.xy;
    float along = max(pixel.x, pixel.y) * length(view) / facing;
    float pixels = facing / (pixel.x * pixel.y);
    irradiance = texelFetch(landed_power, place, 0).rgb * pixels;
    vec2 off = projected - corner - 0.5;
    bool behind;
    if (shows_plane(corner, point.xyz, normal, along, behind)) {
        parts = parts_of(corner, off, photon_width(gl_VertexID, point.xyz, normal, pixels), point.xyz, normal, along);
    } else {
        if (behind) { return; }
        // It is visible at the edge of its surface, where its pixel shows what is beyond: the nearest one has it, which
        // shows that surface all over.
        vec2 aside = abs(off.x) > abs(off.y) ? vec2(sign(off.x), 0.0) : vec2(0.0, sign(off.y));
        vec2 edge = corner;
        for (int side = 0; side < 4; ++side) {
            vec2 other = corner + (side < 2 ? aside : aside.yx) * (side % 2 == 0 ? 1.0 : -1.0);
            if (is_inside(other) && shows_plane(other, point.xyz, normal, along, behind)) {
                edge = other;
                break;
            }
        }
        if (edge == corner) { return; }
        corner = edge;
    }
    own_texel = stored(ivec2(corner));
    vec2 middle = vec2(own_texel) + 0.5;
    if (parts.x < 1.0) {  // a point of 2 x 2 pixels
        middle += 0.5 * sign(off) * vec2(1.0, -1.0);
        gl_PointSize = 2.0;
    }
    gl_Position = vec4(middle / frame_size.xy * 2.0 - 1.0, 0.0, 1.0);
}
