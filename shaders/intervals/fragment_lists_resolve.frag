// Sorts each pixel's list by insertion, and walks along it.

#include <View>
#include "intervals/lists.glsl"
#include "intervals/resolve.glsl"

// Puts a node into a sorted list, and returns the link to the list's first.
uint insert(uint list, uint link) {
    uint word = word_at(link);
    uint before = END_OF_LIST;
    uint after = list;
    while (after != END_OF_LIST) {
        if (word_at(after) >= word) { break; }
        before = after;
        after = next_link(after);
    }
    nodes[link - 1u].y = after;
    if (before == END_OF_LIST) { return link; }
    nodes[before - 1u].y = link;
    return list;
}

void main() {
    uint list = END_OF_LIST;
    float layers = 0.0;
    int excess[SLOTS];
    for (int slot = 0; slot < SLOTS; ++slot) { excess[slot] = 0; }
    for (uint link = heads[pixel_index(gl_FragCoord.xy, frame_size.x)]; link != END_OF_LIST;) {
        uint next = next_link(link);
        uint word = word_at(link);
        for (int slot = 0; slot < SLOTS; ++slot) {
            excess[slot] += slot == crossing_slot(word) ? (crossing_leaves(word) ? 1 : -1) : 0;
        }
        list = insert(list, link);
        link = next;
        layers += 1.0;
    }
    Walk walk = walk_from_start(excess);
    float metres_per_step = metres_of_a_step(ray_advance());
    for (uint link = list; link != END_OF_LIST; link = next_link(link)) {
        cross_surface(walk, word_at(link), 1, false, metres_per_step);
    }
    end_walk(walk, metres_per_step, layers, layers);
}
