// From a pixel's walk to what shade/transmittance.frag reads. Needs <View>.

#include "lib/ray.glsl"
#include "intervals/walk.glsl"

#if OPAQUE
uniform sampler2D opaque_axial_depth;
#endif

layout(location = 0) out vec4 out_optical_depth;  // alpha: 1 where the walk ends outside
layout(location = 1) out vec4 out_emitted;        // alpha: thickness
layout(location = 2) out vec4 out_layers;         // counted, kept, metres with a negative winding number, first exit

#if OPAQUE
float last_axial_depth() {
    return texelFetch(opaque_axial_depth, ivec2(gl_FragCoord.xy), 0).r;
}

// Whether the walk, which has passed what is kept of the crossings behind the opaque surface, may end as it does.
bool may_end(Walk walk, float last) {
    for (int slot = 0; slot < SLOTS; ++slot) {
        if (walk.winding[slot] < 0 || (walk.winding[slot] > 0 && last >= slot_scattering[slot].w)) { return false; }
    }
    return true;
}
#endif

#if INTERFACES
// Where the ray first leaves all bodies; bodies that touch are one here.
float first_exit = NOTHING;
float maybe_exit = NOTHING;

void note_exit(Walk walk, uint word) {
#if OPAQUE
    float last = last_axial_depth();
    if (last <= 1.0 && last >= slot_scattering[crossing_slot(word)].w && walk.axial_step >= step_of_axial_depth(last)) { return; }
#endif
    float axial_depth = float(walk.axial_step) / float(axial_steps());
    if (first_exit < NOTHING) { return; }
    if (maybe_exit < NOTHING && axial_depth - maybe_exit > TOUCHING) {
        first_exit = maybe_exit;
        return;
    }
    maybe_exit = is_outside(walk) ? axial_depth : NOTHING;
}
#endif

// Metres along this pixel's ray per metre along the camera's forward axis.
float ray_advance() {
    vec2 pixel = vec2(gl_FragCoord.x, frame_size.y - gl_FragCoord.y) + frame_size.zw;
    return length(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
}

void write_walk(Walk walk, bool sound, float counted, float kept) {
    out_optical_depth = vec4(walk.optical_depth, sound ? 1.0 : 0.0);
#if MARCH && SCATTERS_AGAIN
    walk.emitted = max(walk.emitted + walk.turned, vec3(0.0));
#endif
    out_emitted = vec4(walk.emitted, walk.thickness);
#if INTERFACES
    out_layers = vec4(counted, kept, walk.inside_out, min(first_exit, maybe_exit));
#else
    out_layers = vec4(counted, kept, walk.inside_out, 0.0);
#endif
}

// The last segment, up to the opaque surface if there is one, and what is left of the walk then.
void end_walk(Walk walk, float metres_per_step, float counted, float kept) {
    bool sound = counted == kept;
#if OPAQUE
    float last = last_axial_depth();
    if (last <= 1.0) {
        sound = sound && may_end(walk, last);
        uint axial_step = step_of_axial_depth(last);
        if (sound && axial_step > walk.axial_step) {
            add_segment(walk, float(axial_step - walk.axial_step) * metres_per_step, false);
        }
        write_walk(walk, sound, counted, kept);
        return;
    }
#endif
#if MARCH && SCATTERS_AGAIN
    if (walk.ahead_slot >= 0) {
        vec3 ahead = environment_ahead(walk.ahead_slot, ray_from(0.0).direction, walk.ahead);
        walk.emitted += transmittance(walk.optical_depth - walk.ahead) * ahead;
    }
#endif
    write_walk(walk, sound && is_outside(walk), counted, kept);
}
