// Photons of the pixels around one, on the surface that it shows. Needs <constants>, <View>, <Surfaces> and in_picture.glsl.

uniform sampler2D photon_irradiance;   // a: how many photons
uniform sampler2D opaque_axial_depth;
uniform sampler2D receiver_normal;

const int WIDEST_SPREAD = 3;        // pixels to each side
const float STEEPEST_SURFACE = 0.1; // sine of the angle between a surface and the direction to its neighbors

struct Receiver {
    vec3 point;
    vec3 normal;
    bool there;
};

Receiver receiver_at(ivec2 texel) {
    float depth = texelFetch(opaque_axial_depth, texel, 0).r;
    vec2 pixel = vec2(texel.x, frame_size.y - 1.0 - float(texel.y)) + 0.5 + frame_size.zw;
    return Receiver(point_at(pixel, depth), texelFetch(receiver_normal, texel, 0).xyz, depth < NOTHING);
}

bool is_in_picture(ivec2 texel) {
    return all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(vec2(texel), frame_size.xy));
}

// Whether two pixels show one surface; the same in either order.
bool same_surface(Receiver one, Receiver other) {
    vec3 offset = other.point - one.point;
    float off = max(abs(dot(offset, one.normal)), abs(dot(offset, other.normal)));
    return one.there && other.there && dot(one.normal, other.normal) > 0.9
        && off <= STEEPEST_SURFACE * length(offset) + SURFACE_OFFSET * surface_reach;
}
