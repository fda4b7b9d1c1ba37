// Where a ray crosses a surface, in one word of 30 bits. Words sort by axial depth, then slot, then side, so that the order of
// crossings is an order of numbers: for atomic operations as it is, and for blending as a float.

#include <constants>
#include <Media>

const uint NO_CROSSING = 0xffffffffu;

uint axial_steps() {
    return 1u << uint(AXIAL_BITS - slot_bits);
}

uint step_of_axial_depth(float axial_depth) {
    uint steps = axial_steps();
    return min(uint(clamp(axial_depth, 0.0, 1.0) * float(steps)), steps - 1u);
}

uint pack_crossing(float axial_depth, int slot, bool leaves) {
    return (((step_of_axial_depth(axial_depth) << uint(slot_bits)) | uint(slot)) << 1) | (leaves ? 1u : 0u);
}

uint crossing_step(uint word) {
    return word >> uint(slot_bits + 1);
}

int crossing_slot(uint word) {
    return int((word >> 1) & ((1u << uint(slot_bits)) - 1u));
}

bool crossing_leaves(uint word) {
    return (word & 1u) == 1u;
}

// Floats above 0 sort as their bits do. The offset keeps the bits of every word those of a normal number, which no
// hardware rounds or flushes; the greatest is below 4.
float sortable(uint word) {
    return uintBitsToFloat(word + SORTABLE_OFFSET);
}

uint word_of_sortable(float value) {
    return floatBitsToUint(value) - SORTABLE_OFFSET;
}

// The same crossing in the opposite order.
uint reversed_word(uint word) {
    return LARGEST_WORD - word;
}
