// Walks along the crossings of up to PEEL_BATCH passes: one walk on from the start, one back from the end. Each pass holds
// two crossings, and the number of faces of the two before. Walks that are not at an end go into textures until the next
// batch; the last batch joins them.

#include <View>
#include "intervals/resolve.glsl"
#include "intervals/peel_faces.glsl"
#include "intervals/peel_state.glsl"

uniform int passes;
uniform int walked;  // of these; the rest only count
uniform sampler2D pass_0;
uniform sampler2D pass_1;
uniform sampler2D pass_2;
uniform sampler2D pass_3;
uniform sampler2D pass_4;
uniform sampler2D pass_5;
uniform sampler2D pass_6;
uniform sampler2D pass_7;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 found[PEEL_BATCH];
    found[0] = texelFetch(pass_0, texel, 0);
    if (passes > 1) { found[1] = texelFetch(pass_1, texel, 0); }
    if (passes > 2) { found[2] = texelFetch(pass_2, texel, 0); }
    if (passes > 3) { found[3] = texelFetch(pass_3, texel, 0); }
    if (passes > 4) { found[4] = texelFetch(pass_4, texel, 0); }
    if (passes > 5) { found[5] = texelFetch(pass_5, texel, 0); }
    if (passes > 6) { found[6] = texelFetch(pass_6, texel, 0); }
    if (passes > 7) { found[7] = texelFetch(pass_7, texel, 0); }
    float advance = ray_advance();
#if BEGIN
    Peel peel = begin_peel(found[0].b, found[0].a, advance);
#else
    Peel peel = read_peel(texel);
#endif
    float metres_per_step = metres_of_a_step(advance);
    for (int i = 0; i < walked; ++i) {
        if (min(found[i].r, found[i].g) >= NOTHING) { break; }
        uint near = word_of_sortable(found[i].r);
        uint far = reversed_word(word_of_sortable(found[i].g));
        float faces_left = peel.counted - peel.kept;
        vec2 faces = is_end(found[i].rg, faces_left)
            ? last_faces(found[i].rg, faces_left)
            : counted_faces(found[min(i + 1, PEEL_BATCH - 1)].a);
#if NEAR
        cross_surface(peel.near, near, int(faces.x), false, metres_per_step);
        peel.kept += faces.x;
#endif
#if FAR
        if (is_one_crossing(found[i].rg)) { break; }
        cross_surface(peel.far, far, int(faces.y), true, metres_per_step);
        peel.kept += faces.y;
#endif
    }
#if END
    Walk walk = join_peel(peel, metres_per_step);
    write_walk(walk, peel.kept == peel.counted && same_windings(peel), peel.counted, peel.kept);
#else
    write_peel(peel);
#endif
}
