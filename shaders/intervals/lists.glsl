// Lists of crossings, one for each pixel. A link is the number of a node, counted from 1; 0 ends a list. So it ends, too,
// for the neighbors of a pixel that are shaded along with it at an edge, and that on some hardware read 0 everywhere.

#include <constants>

layout(std430, binding = COUNT_BINDING) buffer Count { uint node_count; };
layout(std430, binding = HEADS_BINDING) buffer Heads { uint heads[]; };  // links
#if GRADIENT
#define NODE uvec4
#else
#define NODE uvec2
#endif
layout(std430, binding = NODES_BINDING) buffer Nodes { NODE nodes[]; };  // word, link to the next; how the axial depth changes across pixels

const uint END_OF_LIST = 0u;

uint pixel_index(vec2 position, float width) {
    return uint(position.y) * uint(width) + uint(position.x);
}

uint word_at(uint link) {
    return nodes[link - 1u].x;
}

uint next_link(uint link) {
    return nodes[link - 1u].y;
}
