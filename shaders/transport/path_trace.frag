// Random paths of light, some events of one path of each pixel, and then of the next one.

#include <constants>
#include <View>
#include <Environment>
#include <Surfaces>
#include <ObjectRow>
#include "transport/path_textures.glsl"
#include "transport/path_step.glsl"

uniform int events;          // that are followed in this pass
uniform float pass_number;

void main() {
    read_bodies();
    ivec2 here = ivec2(gl_FragCoord.xy);
    ivec2 texel = here + tile_origin;
    Statistics known = stored_statistics(here);
    uint drawn = texelFetch(path_counts, here, 0).y;
    float ended_in = texelFetch(path_spread, here, 0).w;
    if (known.count >= last_path && ended_in + 1.5 < pass_number) { discard; }  // both states have it
    Path path = stored_path(here);
    Draws draws = Draws(uint(texel.y + int(beyond.y)) * uint(frame_size.x + beyond.z) + uint(texel.x + int(beyond.x)), known.count, drawn);
    int most = (path.flags & FLAG_CAREFUL) != 0u ? 1 : events;
    int event = 0;
    bool done = known.count >= last_path;
    for (; event < most && !done; ++event) {
        if ((path.flags & FLAG_FOLLOWED) == 0u) {
            draws = Draws(draws.pixel, known.count, 0u);
            begin_path(path, pixel_of(texel, known.count), texel);
        }
        vec2 pixel = pixel_of(texel, known.count);
        if (!path.ends) { follow(path, Hit(0.0, -1, -1, vec2(0.0)), pixel, texel, draws); }
        bool broken = any(isnan(path.light)) || any(isinf(path.light)) || draws.count > MOST_DRAWN;
        if (path.ends || broken) {
            if (broken) { path.light = vec3(0.0); }
            // Where nothing was left to chance, all paths are the same.
            uint count = draws.count == 0u && spread == 0 ? last_path - known.count : 1u;
            known.lost += path.lost || broken ? float(count) : 0.0;
            add_paths(known, path.light, count);
            path.flags = 0u;
            done = known.count >= last_path;
            if (done) { ended_in = pass_number; }
        }
    }
    if (event < most && !done) {
        // The driver has cut the loop short (Mesa does after 65,535 iterations of all loops), at a point that nobody knows.
        known = stored_statistics(here);
        bool again = most > 1;
        path = stored_path(here);
        draws.count = drawn;
        path.flags |= FLAG_CAREFUL;
        if (!again) {
            ++known.count;
            ++known.lost;
            path.flags = 0u;
            if (known.count >= last_path) { ended_in = pass_number; }
        }
    }
    store(path, draws.count, known, ended_in);
}
