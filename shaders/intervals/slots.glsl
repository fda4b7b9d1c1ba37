// How often the medium of a slot fills a point with the given winding numbers. Left before it is entered, as next to a
// silhouette, where rounding has the two change their order, it does not.

#include <Media>
#if VARIES
#include "volume/density.glsl"
#endif

int slot_weight(int winding[SLOTS], int slot) {
    if (winding[slot] <= 0) { return 0; }
#if PRIORITY
    // Slots are sorted by priority.
    for (int other = 0; other < slot; ++other) {
        if (winding[other] > 0) { return 0; }
    }
    return 1;
#elif UNION
    // Open bodies have slots of their own: a medium that an earlier slot has brought does not count again.
    for (int other = 0; other < slot; ++other) {
        bool alike = slot_extinction[other].rgb == slot_extinction[slot].rgb
            && slot_emission[other].rgb == slot_emission[slot].rgb && slot_scattering[other].rgb == slot_scattering[slot].rgb
            && slot_phase[other] == slot_phase[slot];
#if VARIES
        alike = alike && !slot_varies(slot) && !slot_varies(other);
#endif
        if (winding[other] > 0 && alike) { return 0; }
    }
    return 1;
#else
    return winding[slot];
#endif
}

// The same for all slots, as numbers: how much of each medium there is where its density is 1.
float[SLOTS] slot_weights(int winding[SLOTS]) {
    float weights[SLOTS];
    for (int slot = 0; slot < SLOTS; ++slot) { weights[slot] = float(slot_weight(winding, slot)); }
    return weights;
}
