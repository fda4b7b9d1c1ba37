// Whether what was added up for a pixel is a path through bodies. Needs <Shade>.

#include <constants>
#include "thickness/snapping.glsl"

// Whether entries and exits balance: a hole or a flipped face betrays itself.
bool is_balanced(float sum_of_counts) {
    float count = whole_count(sum_of_counts);
    return count >= expected_count.x && count <= expected_count.y;
}

// Metres that the rasterizer may have misplaced faces by, of a pixel whose ray advances so much per metre of axial depth.
float misplaced_length(float sum_of_counts, float advance) {
    return fraction_of_count(sum_of_counts) * count_share * advance;
}

// NaN fails every comparison, so this refuses it, too.
bool is_length(float thickness, float misplaced) {
    return thickness >= -(rounding + misplaced) && thickness < NOTHING;
}
