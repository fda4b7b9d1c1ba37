// Record of the bodies that a ray is in, in the order of entering; a body stands in it once for each winding. It decides
// the medium at each point of nested dielectrics (Schmidt & Budge 2002, "Simple nested dielectrics in ray traced images"):
// that of the body with the highest priority, of equal ones of the one entered last. Needs <constants>, <TracedBody>.
// PRIORITY: only that body absorbs and emits; UNION: each medium does once, however many bodies of it overlap.

const int AIR = -1;

// Entries of 16 bits, number of the object + 1; the one entered last in the lowest bits of x.
uint record_entry(uvec4 record, int index) {
    uint word = record[index >> 1];
    return (index & 1) == 0 ? word & 0xffffu : word >> 16;
}

bool is_full(uvec4 record) {
    return record.w >> 16 != 0u;
}

uvec4 entered_record(uvec4 record, int object) {
    return uvec4(record.x << 16 | uint(object + 1), record.y << 16 | record.x >> 16, record.z << 16 | record.y >> 16,
        record.w << 16 | record.z >> 16);
}

// The record without its first entry. Loops that shift it take as many turns as there are entries: compilers unroll those
// over RECORD_SIZE.
uvec4 next_entries(uvec4 record) {
    return uvec4(record.x >> 16 | record.y << 16, record.y >> 16 | record.z << 16, record.z >> 16 | record.w << 16, record.w >> 16);
}

// missing: the ray leaves what it has not entered.
uvec4 left_record(uvec4 record, int object, out bool missing) {
    uint id = uint(object + 1);
    missing = false;
    if (record.x == id) { return uvec4(0u); }
#if ONE_OBJECT
    if ((record.x & 0xffffu) == id) {
        return next_entries(record);
    }
    missing = true;
    return record;
#else
    // From its lowest entry on, those above take the places of those below.
    uvec4 rest = record, above = next_entries(record);
    missing = true;
    for (int i = 0; i < 4; ++i) {
        if (!missing) {
            rest[i] = above[i];
        } else if ((record[i] & 0xffffu) == id) {
            rest[i] = above[i];
            missing = false;
        } else if (record[i] >> 16 == id) {
            rest[i] = (record[i] & 0xffffu) | (above[i] & 0xffff0000u);
            missing = false;
        }
    }
    return rest;
#endif
}

int dominant_body(uvec4 record) {
#if ONE_OBJECT
    return int(record.x & 0xffffu) - 1;
#else
    int best = AIR;
    float highest = 0.0;
    for (; record.x != 0u; record = next_entries(record)) {
        int object = int(record.x & 0xffffu) - 1;
        float rank = traced_body(object).rank;
        if (rank > highest) {
            highest = rank;
            best = object;
        }
    }
    return best;
#endif
}

// Whether a body in the record has holes.
bool is_in_open_body(uvec4 record) {
    for (; record.x != 0u; record = next_entries(record)) {
        if (traced_body(int(record.x & 0xffffu) - 1).not_closed == 1.0) { return true; }
    }
    return false;
}

struct Filling {
    vec3 extinction;
    vec3 emission;
    vec3 scattering;
};

#if !(ONE_OBJECT || PRIORITY)
// Whether an entry fills the place: in a union, a medium does so once.
bool counts_in(uvec4 record, int index) {
#if UNION
    float slot = traced_body(int(record_entry(record, index)) - 1).slot;
    for (int k = 0; k < index; ++k) {
        if (traced_body(int(record_entry(record, k)) - 1).slot == slot) { return false; }
    }
#endif
    return true;
}
#endif

// What fills a place.
Filling filling_of(uvec4 record, int dominant) {
    Filling sum = Filling(vec3(0.0), vec3(0.0), vec3(0.0));
#if ONE_OBJECT || PRIORITY
    if (dominant != AIR) {
        TracedBody body = traced_body(dominant);
        sum = Filling(body.extinction, body.emission, body.scattering);
    }
#if ONE_OBJECT && !PRIORITY && !UNION
    // A body that fills a place twice absorbs twice.
    int turns = 0;
    for (int i = 0; i < RECORD_SIZE; ++i) { turns += record_entry(record, i) != 0u ? 1 : 0; }
    sum.extinction *= float(turns);
    sum.emission *= float(turns);
    sum.scattering *= float(turns);
#endif
#else
    uvec4 rest = record;
    for (int i = 0; rest.x != 0u; ++i, rest = next_entries(rest)) {
        if (!counts_in(record, i)) { continue; }
        TracedBody body = traced_body(int(rest.x & 0xffffu) - 1);
        sum.extinction += body.extinction;
        sum.emission += body.emission;
        sum.scattering += body.scattering;
    }
#endif
    return sum;
}
