// Photons as points of the picture, where it shows the surfaces on which they have landed. What each adds to the irradiance
// of its pixel is its power, over the area that the pixel covers of the plane in which it lies.

#include <constants>
#include <View>
#include <Surfaces>
#include "shade/in_picture.glsl"

uniform sampler2D landed_point;        // from the center of the media; w: 1 where it has landed
uniform sampler2D landed_power;
uniform sampler2D landed_normal;       // of the face, unit, to the side on which it lies
uniform sampler2D opaque_axial_depth;

flat out vec3 irradiance;

const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);

void main() {
    int width = textureSize(landed_point, 0).x;
    ivec2 place = ivec2(gl_VertexID % width, gl_VertexID / width);
    gl_Position = NOWHERE;
    irradiance = vec3(0.0);
    vec4 point = texelFetch(landed_point, place, 0);
    if (point.w != 1.0) { return; }
    vec3 normal = texelFetch(landed_normal, place, 0).xyz;
    vec3 seen = seen_at(point.xyz);
    vec2 corner = floor(seen.xy - frame_size.zw);
    if (any(lessThan(corner, vec2(0.0))) || any(greaterThanEqual(corner, frame_size.xy))) { return; }
    ivec2 texel = stored(ivec2(corner));
    float depth = texelFetch(opaque_axial_depth, texel, 0).r;
    if (depth >= NOTHING) { return; }

    // Metres along the camera's axis for which the picture grows by its half extent; 1 where rays are parallel.
    bool perspective = surface_right.w == 1.0;
    float ahead = dot(point.xyz, ray_forward.xyz);
    float spread = perspective ? ahead + surface_ahead.z : 1.0;
    vec3 from_eye = point.xyz + surface_off_axis.xyz + surface_ahead.z * ray_forward.xyz;
    float facing = -dot(normal, perspective ? from_eye / spread : ray_forward.xyz);
    if (facing <= 0.0) { return; }  // the eye sees the other side
    vec2 pixel = 2.0 * vec2(length(surface_right.xyz), length(surface_up.xyz)) * spread / frame_size.xy;

    // What the pixel shows is on the plane of the photon, as exactly as a curved surface is flat within it.
    vec3 shown = point_at(corner + 0.5 + frame_size.zw, depth);
    float off = abs(dot(shown - point.xyz, normal));
    if (off > max(pixel.x, pixel.y) + SURFACE_OFFSET * 10.0 * surface_reach) { return; }

    irradiance = texelFetch(landed_power, place, 0).rgb * (facing / (pixel.x * pixel.y));
    gl_Position = vec4((vec2(texel) + 0.5) / frame_size.xy * 2.0 - 1.0, 0.0, 1.0);
}
