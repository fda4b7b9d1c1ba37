// How far along its ray a rasterizer may misplace a surface, and how that goes along with a count. It moves vertices onto a
// grid of sub-pixels, by half a step at most, so a pixel shows a point of the face that is up to half a step off, along
// each axis of the picture. Next to a silhouette two faces then change their order, by a step of the grid times the slopes of
// both: negative paths up to that are no flipped faces.

#include <constants>

// Metres or axial depth, whichever the argument counts; before any branch, since it reads the neighboring pixels.
float snapping(float along, float step_of_grid) {
    return fwidth(along) * step_of_grid;
}

// The square root, or up to 1.061 times that: half the exponent, and a chord of the root over each of its steps.
float root_or_more(float x) {
    return uintBitsToFloat((floatBitsToUint(x) >> 1u) + 0x1fc00000u);
}

// A count, with a fraction of the scene's size after its point. Fractions add up to less than 1 where fewer than 64 faces of a
// pixel are as steep as can be; square roots, since the values go from 1e-7 to 1. The root of a sum is less than the sum of
// the roots, so that what comes back is not too small.
float count_with_fraction(float count, float fraction) {
    return count + root_or_more(min(fraction, 1.0)) / 64.0;
}

// The count alone. A little is added, since sums of many counts round their fraction.
float whole_count(float count) {
    return floor(count + 1.0 / 256.0);
}

float fraction_of_count(float count) {
    float root = max(count - whole_count(count), 0.0) * 64.0;
    return root * root;
}
