// Sorts each pixel's list, and walks along it.

#include <View>
#include "intervals/lists.glsl"
#include "intervals/sort_list.glsl"
#include "intervals/resolve.glsl"

uniform sampler2D steepest;

void main() {
    int excess[SLOTS];
    uint list = sort_list(heads[pixel_index(gl_FragCoord.xy, frame_size.x)], excess);
    float advance = ray_advance();
    float metres_per_step = metres_of_a_step(advance);
    Walk walk = walk_from_start(excess, misplaced_metres(texelFetch(steepest, ivec2(gl_FragCoord.xy), 0).r, advance));
    float layers = 0.0;
    for (uint link = list; link != END_OF_LIST; link = next_link(link)) {
        cross_surface(walk, word_at(link), 1, false, metres_per_step);
        layers += 1.0;
#if INTERFACES
        note_exit(walk, word_at(link));
#endif
    }
    end_walk(walk, metres_per_step, layers, layers);
}
