// Vertices of a body, given as offsets from its center so that float32 resolves them wherever in the world they are.

#include <Body>

in vec3 offset;
#if WITH_NORMAL
in vec3 normal;
out vec3 world_normal;
#endif
#if WITH_POSITION
out vec3 from_eye;     // world axes
out vec3 from_center;  // of the media
#endif

// Metres along the camera's forward axis, from the body's anchor. All points of one pixel lie on one ray, so the ray's
// length is this, times a factor of the pixel: one interpolated number carries the whole distance.
out float axial;

// What is alike for all of a body: see of_body.glsl.
flat out vec4 counting;
flat out vec4 to_axial_depth;
flat out vec4 medium_of_body;

// Neighboring faces must agree on their shared vertices to the last bit, or pixels between them would leak.
invariant gl_Position;

void main() {
    gl_Position = clip_from_offset * vec4(offset, 1.0);
    axial = dot(axis.xyz, offset) + axis.w;
    counting = vec4(count_weight, count_offset, axial_start, snapping_share);
    to_axial_depth = vec4(axial_depth_scale, axial_depth_start, subpixel, float(slot));
    medium_of_body = vec4(extinction.rgb, float(starts_unknown));
#if WITH_NORMAL
    world_normal = mat3(world_from_normal) * normal;
#endif
#if WITH_POSITION
    from_eye = (eye_from_offset * vec4(offset, 1.0)).xyz;
    from_center = mat3(eye_from_offset) * offset + anchor_from_center.xyz;
#endif
}
