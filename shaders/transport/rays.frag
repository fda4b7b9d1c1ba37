// The nearest surface on each of many rays: a texel is a ray. Used to check and to measure hierarchies.

#include <constants>
#include <ObjectRow>
#include "transport/hierarchy.glsl"

uniform sampler2D ray_origins;     // from the center of the bodies; w: where the ray starts
uniform sampler2D ray_directions;  // of unit length; w: where it ends

layout(location = 0) out ivec4 out_hit;  // bits of the path; object, -1 where there is none; triangle

void main() {
    read_bodies();
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 origin = texelFetch(ray_origins, texel, 0);
    vec4 direction = texelFetch(ray_directions, texel, 0);
    Hit hit = nearest_hit(origin.xyz, direction.xyz, origin.w, direction.w, uvec4(0u));
    out_hit = ivec4(floatBitsToInt(hit.path), hit.object, hit.triangle, 0);
}
