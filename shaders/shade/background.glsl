// What is behind the media: opaque surfaces, or the environment. Needs <constants>, <View> and <Environment>. SEEN_MAP: the
// environment is no picture (0), one of its own (1), or the one that lights (2). seen_checkerboard: it is a checkerboard.

#include "lib/environment.glsl"
#include "shade/light_map.glsl"

#if OPAQUE
uniform sampler2D opaque_axial_depth;
uniform sampler2D opaque_radiance;
#endif
#if SEEN_MAP == 1
uniform sampler2D seen_map;
#endif
#if SEEN_MAP == 2
#define seen_map light_map
#endif

// Radiance of the environment as the background. at: position in the picture, right and down, in its heights; ray: unit vector.
vec3 background_radiance(vec2 at, vec3 ray) {
#if SEEN_MAP
    return seen_scale * textureLod(seen_map, equirectangular_uv(ray, seen_turn), 0.0).rgb;
#else
    // A constant one is a gradient between equal radiances.
    float fraction = seen_checkerboard ? checkerboard_share(at, seen_tiles) : gradient_share(ray);
    return seen_scale * mix(seen_first.rgb, seen_second.rgb, fraction);
#endif
}

// Position of a pixel in the picture, right and down, in heights of all of it: the frame may be a part.
vec2 in_heights(vec2 pixel) {
    return (pixel + beyond.xy) / (frame_size.y + beyond.w);
}

// Radiance along a straight ray behind the media.
vec3 background(vec2 pixel, vec3 ray, ivec2 texel) {
#if OPAQUE
    if (texelFetch(opaque_axial_depth, texel, 0).r < NOTHING) {
        return texelFetch(opaque_radiance, texel, 0).rgb;
    }
#endif
    return background_radiance(in_heights(pixel), normalize(ray));
}
