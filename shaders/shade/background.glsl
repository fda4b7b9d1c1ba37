// What is behind the media: opaque surfaces, or the environment. Needs <constants>, <View> and <Environment>. SEEN_MAP: the
// environment is no picture (0), one of its own (1), or the one that lights (2).

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

// The environment as it is seen. at: position in the picture, right and down, in its heights; ray: unit vector.
vec3 seen_environment(vec2 at, vec3 ray) {
#if SEEN_MAP
    return seen_scale * textureLod(seen_map, equirectangular_uv(ray, seen_turn), 0.0).rgb;
#else
    float share = 0.0;
    if (seen_kind == ENVIRONMENT_GRADIENT) {
        share = gradient_share(ray);
    } else if (seen_kind == ENVIRONMENT_CHECKERBOARD) {
        share = checkerboard_share(at, seen_tiles);
    }
    return seen_scale * mix(seen_first.rgb, seen_second.rgb, share);
#endif
}

// Position of a pixel in the picture, right and down, in heights of all of it: the frame may be a part.
vec2 in_heights(vec2 pixel) {
    return (pixel + beyond.xy) / (frame_size.y + beyond.w);
}

// What a straight ray meets.
vec3 background(vec2 pixel, vec3 ray, ivec2 texel) {
#if OPAQUE
    if (texelFetch(opaque_axial_depth, texel, 0).r < NOTHING) {
        return texelFetch(opaque_radiance, texel, 0).rgb;
    }
#endif
    return seen_environment(in_heights(pixel), normalize(ray));
}
