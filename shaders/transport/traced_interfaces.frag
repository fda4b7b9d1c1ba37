// Rays traced through the meshes wherever interfaces reflect and refract them: a tree of exact branches. The stronger branch is
// always followed, the weaker one FORKS times on a path (the first mirror image is free), else it is looked up in the environment;
// so are both at the last of `most_interfaces`. The rasterizer has found the first interface. adaptive: only samples of a pixel that
// are worth it; with the square of their luminance in place of the transmittance. GENERATIONS: the light of the rays has been summed
// up, see step_rays.comp, and pixels without an interface are drawn as well. Row 0 of the output is the top row.

#if (MIRROR || ROUGH) && !MICROFACETS
#error rough interfaces and mirrors of the ground take random microfacets: MICROFACETS is 1
#endif
#if MIRROR && !OPAQUE
#error the ground is an opaque object: OPAQUE is 1
#endif

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/ray_step.glsl"
#include "transport/first_ray.glsl"
#include "transport/shaded_pixel.glsl"

layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_transmittance;

void main() {
    read_bodies();
    shade_pixel(pixel_at(ivec2(gl_FragCoord.xy)), out_radiance, out_transmittance);
}
