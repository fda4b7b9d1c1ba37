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

// missing: the ray leaves what it has not entered.
uvec4 left_record(uvec4 record, int object, out bool missing) {
    uint id = uint(object + 1);
    missing = false;
    if (record.x == id) { return uvec4(0u); }
#if ONE_OBJECT
    if ((record.x & 0xffffu) == id) {
        return uvec4(record.x >> 16 | record.y << 16, record.y >> 16 | record.z << 16, record.z >> 16 | record.w << 16, record.w >> 16);
    }
    missing = true;
    return record;
#else
    uvec4 rest = uvec4(0u);
    int kept = 0;
    missing = true;
    for (int i = 0; i < RECORD_SIZE; ++i) {
        uint entry = record_entry(record, i);
        if (entry == 0u) { break; }
        if (missing && entry == id) {
            missing = false;
            continue;
        }
        rest[kept >> 1] |= (kept & 1) == 0 ? entry : entry << 16;
        ++kept;
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
    for (int i = 0; i < RECORD_SIZE; ++i) {
        uint entry = record_entry(record, i);
        if (entry == 0u) { break; }
        float rank = traced_body(int(entry) - 1).rank;
        if (rank > highest) {
            highest = rank;
            best = int(entry) - 1;
        }
    }
    return best;
#endif
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
    for (int i = 0; i < RECORD_SIZE; ++i) {
        uint entry = record_entry(record, i);
        if (entry == 0u) { break; }
        if (!counts_in(record, i)) { continue; }
        TracedBody body = traced_body(int(entry) - 1);
        sum.extinction += body.extinction;
        sum.emission += body.emission;
        sum.scattering += body.scattering;
    }
#endif
    return sum;
}
