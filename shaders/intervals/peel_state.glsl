// The two walks of a peel: how they begin, wait in textures, and join. Needs intervals/resolve.glsl.

struct Peel {
    Walk near;      // from the start of the ray
    Walk far;       // back from its end
    float counted;  // crossings that there are
    float kept;     // crossings that the walks have passed
};

#if !BEGIN
uniform sampler2D near_depth;
uniform sampler2D near_emitted;
uniform sampler2D far_depth;
uniform sampler2D far_emitted;
uniform sampler2D layers;
uniform usampler2D near_winding;
uniform usampler2D far_winding;
#endif

#if !END
layout(location = 3) out vec4 out_far_depth;
layout(location = 4) out vec4 out_far_emitted;
layout(location = 5) out uvec4 out_near_winding;
layout(location = 6) out uvec4 out_far_winding;
#endif

// The walks before the first crossing; alpha of the first pass is what is ahead, blue how steep it is at most.
Peel begin_peel(float steepest, float alpha, float advance) {
    float excess = floor(alpha / PEEL_UNIT);
    int excesses[SLOTS];
    int none[SLOTS];
    for (int slot = 0; slot < SLOTS; ++slot) {
        excesses[slot] = int(excess);
        none[slot] = 0;
    }
    Peel peel;
    peel.near = walk_from_start(excesses, misplaced_metres(max(-steepest, 0.0), advance));
    peel.far = peel.near;
    peel.far.inside_out = 0.0;
    peel.far.winding = none;
    peel.far.axial_step = axial_steps() - 1u;
    peel.counted = alpha - PEEL_UNIT * excess;
    peel.kept = 0.0;
    return peel;
}

bool same_windings(Peel peel) {
    for (int slot = 0; slot < SLOTS; ++slot) {
        if (peel.near.winding[slot] != peel.far.winding[slot]) { return false; }
    }
    return true;
}

// One walk from start to end; the segment between the two is left out where they do not agree what fills it.
Walk join_peel(Peel peel, float metres_per_step) {
    Walk walk = peel.near;
    if (same_windings(peel) && peel.far.axial_step > walk.axial_step) {
        add_segment(walk, float(peel.far.axial_step - walk.axial_step) * metres_per_step, false);
    }
    walk.emitted += transmittance(walk.optical_depth) * peel.far.emitted;
    walk.optical_depth += peel.far.optical_depth;
    walk.thickness += peel.far.thickness;
    walk.inside_out += peel.far.inside_out;
    return walk;
}

#if !END
// Sixteen numbers of 8 bits, each offset by 128.
uvec4 pack_windings(int winding[SLOTS]) {
    uvec4 bits = uvec4(0u);
    for (int slot = 0; slot < SLOTS; ++slot) {
        bits[slot / 4] |= uint(clamp(winding[slot], -127, 127) + 128) << uint(8 * (slot % 4));
    }
    return bits;
}

void write_peel(Peel peel) {
    out_optical_depth = vec4(peel.near.optical_depth, sortable(peel.near.axial_step));
    out_emitted = vec4(peel.near.emitted, peel.near.thickness);
    out_layers = vec4(peel.counted, peel.kept, peel.near.inside_out, peel.far.inside_out);
    out_far_depth = vec4(peel.far.optical_depth, sortable(peel.far.axial_step));
    out_far_emitted = vec4(peel.far.emitted, peel.far.thickness);
    out_near_winding = pack_windings(peel.near.winding);
    out_far_winding = pack_windings(peel.far.winding);
}
#endif

#if !BEGIN
Walk read_walk(vec4 depth, vec4 emitted, uvec4 bits, float inside_out) {
    Walk walk;
    walk.axial_step = word_of_sortable(depth.a);
    for (int slot = 0; slot < SLOTS; ++slot) {
        walk.winding[slot] = int((bits[slot / 4] >> uint(8 * (slot % 4))) & 255u) - 128;
    }
    walk.optical_depth = depth.rgb;
    walk.emitted = emitted.rgb;
    walk.thickness = emitted.a;
    walk.inside_out = inside_out;
    return walk;
}

Peel read_peel(ivec2 texel) {
    vec4 counts = texelFetch(layers, texel, 0);
    Peel peel;
    peel.near = read_walk(texelFetch(near_depth, texel, 0), texelFetch(near_emitted, texel, 0), texelFetch(near_winding, texel, 0), counts.b);
    peel.far = read_walk(texelFetch(far_depth, texel, 0), texelFetch(far_emitted, texel, 0), texelFetch(far_winding, texel, 0), counts.a);
    peel.counted = counts.r;
    peel.kept = counts.g;
    return peel;
}
#endif
