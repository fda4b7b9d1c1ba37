// For each pixel: how many crossings there were, and the k nearest of them in order.

#include <constants>

layout(std430, binding = WORDS_BINDING) buffer Words { uint words[]; };

uniform int k;

uint k_base(vec2 position, float width) {
    return (uint(position.y) * uint(width) + uint(position.x)) * uint(k + 1);
}
