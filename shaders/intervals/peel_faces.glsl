// How many faces are alike in each of the two crossings that a peeling pass finds. The next pass counts them; but the
// last crossings of a ray are known before, from how many faces have not been passed.

#include <constants>

// Nearest (red) and farthest (green, reversed) crossing of those left are one: all faces left are alike.
bool is_one_crossing(vec2 found) {
#if NEAR && FAR
    return word_of_sortable(found.r) == reversed_word(word_of_sortable(found.g));
#else
    return false;
#endif
}

// Whether what a pass has found, with so many faces left before it, is the end of the ray.
bool is_end(vec2 found, float faces_left) {
#if NEAR && FAR
    return found.r >= NOTHING || faces_left <= 2.0 || is_one_crossing(found);
#else
    return min(found.r, found.g) >= NOTHING || faces_left <= 1.0;
#endif
}

// Faces of the near and of the far crossing, by alpha of the next pass.
vec2 counted_faces(float alpha) {
    float far_faces = floor(alpha / PEEL_UNIT);
    return vec2(alpha - PEEL_UNIT * far_faces, far_faces);
}

// The same without a next pass, at the end of the ray.
vec2 last_faces(vec2 found, float faces_left) {
    return is_one_crossing(found) ? vec2(faces_left, 0.0) : vec2(1.0);
}
