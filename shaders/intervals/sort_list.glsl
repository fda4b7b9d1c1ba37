// Sorts the list of a pixel by insertion. Needs intervals/lists.glsl.

#include "intervals/crossing.glsl"

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

// Returns the sorted list, and for each slot the excess of exits over entries in it.
uint sort_list(uint unsorted, out int excess[SLOTS]) {
    for (int slot = 0; slot < SLOTS; ++slot) { excess[slot] = 0; }
    uint list = END_OF_LIST;
    for (uint link = unsorted; link != END_OF_LIST;) {
        uint next = next_link(link);
        uint word = word_at(link);
        for (int slot = 0; slot < SLOTS; ++slot) {
            excess[slot] += slot == crossing_slot(word) ? (crossing_leaves(word) ? 1 : -1) : 0;
        }
        list = insert(list, link);
        link = next;
    }
    return list;
}
