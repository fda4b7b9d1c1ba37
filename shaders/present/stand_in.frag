// What stands in for a body until the programs of its material are compiled: one color that looks like it.
//
// The body is taken for a ball of its mean chord, and light for its mean and its slope along each axis: the first two bands
// of spherical harmonics (Ramamoorthi and Hanrahan 2001). What the medium absorbs and scatters on the chord is Beer and
// Lambert's; scattered light has the diffuse color. The interface mirrors the mean (Schlick 1994).

#include "present/develop.glsl"

uniform vec4 forward;         // unit vector of the view, and 1 for an orthographic camera, 0 for others
uniform vec3 mean_light;      // radiance from all around
uniform vec3 slope_right;     // its slopes along X, Y and Z, as surfaces see them
uniform vec3 slope_up;
uniform vec3 slope_back;
uniform vec3 absorbed;        // along the chord through the middle: optical depths
uniform vec3 scattered;
uniform vec3 diffuse_color;   // of the medium where it is thick; of an opaque object
uniform float mirrored;       // reflectance of the interface, seen straight
uniform float opaque;         // 1 of an opaque object
uniform float stops;

in vec3 place;

layout(location = 0) out vec4 color;

vec3 light_on(vec3 normal) {
    return max(mean_light + slope_right * normal.x + slope_up * normal.y + slope_back * normal.z, vec3(0.0));
}

void main() {
    vec3 view = forward.w > 0.5 ? forward.xyz : normalize(place);
    vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
    if (dot(normal, view) > 0.0) { normal = -normal; }
    float facing = clamp(-dot(normal, view), 0.0, 1.0);
    float fresnel = mirrored > 0.0 ? mirrored + (1.0 - mirrored) * pow(1.0 - facing, 5.0) : 0.0;
    vec3 inside = mix(1.0 - exp(-scattered * facing), vec3(1.0), opaque);
    vec3 through = (1.0 - inside) * exp(-absorbed * facing) * light_on(view);
    vec3 found = (1.0 - fresnel) * (inside * diffuse_color * light_on(normal) + through);
    found += fresnel * light_on(reflect(view, normal));
    color = vec4(develop(found, stops), 1.0);
}
