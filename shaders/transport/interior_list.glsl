// Interior list of a ray: the bodies that it is inside, in the order of entering; a body stands in it once for each winding. It
// decides the medium at each point of nested dielectrics (Schmidt & Budge 2002, "Simple nested dielectrics in ray traced images"):
// the effective medium is that of the body with the highest priority, of equal ones of the one entered last. Needs <constants>,
// <ObjectRow>. PRIORITY: only that body absorbs and emits; UNION: each medium does once, however many bodies of it overlap.

const int AIR = -1;

// Entries of 16 bits, number of the object + 1; the one entered last in the lowest bits of x.
uint interior_entry(uvec4 interior, int index) {
    uint word = interior[index >> 1];
    return (index & 1) == 0 ? word & 0xffffu : word >> 16;
}

bool is_full(uvec4 interior) {
    return interior.w >> 16 != 0u;
}

uvec4 entered_interior(uvec4 interior, int object) {
    return uvec4(interior.x << 16 | uint(object + 1), interior.y << 16 | interior.x >> 16, interior.z << 16 | interior.y >> 16,
        interior.w << 16 | interior.z >> 16);
}

// The list without its first entry. Loops that shift it run as often as there are entries: compilers unroll those
// over INTERIOR_SIZE.
uvec4 next_entries(uvec4 interior) {
    return uvec4(interior.x >> 16 | interior.y << 16, interior.y >> 16 | interior.z << 16, interior.z >> 16 | interior.w << 16, interior.w >> 16);
}

// missing: the ray leaves what it has not entered.
uvec4 left_interior(uvec4 interior, int object, out bool missing) {
    uint id = uint(object + 1);
    missing = false;
    if (interior.x == id) { return uvec4(0u); }
#if ONE_OBJECT
    if ((interior.x & 0xffffu) == id) {
        return next_entries(interior);
    }
    missing = true;
    return interior;
#else
    // From its lowest entry on, those above take the places of those below.
    uvec4 rest = interior, above = next_entries(interior);
    missing = true;
    for (int i = 0; i < 4; ++i) {
        if (!missing) {
            rest[i] = above[i];
        } else if ((interior[i] & 0xffffu) == id) {
            rest[i] = above[i];
            missing = false;
        } else if (interior[i] >> 16 == id) {
            rest[i] = (interior[i] & 0xffffu) | (above[i] & 0xffff0000u);
            missing = false;
        }
    }
    return rest;
#endif
}

// The list of a ray through one body alone, which stands in it some times, as that number.
uint packed_interior(uvec4 interior) {
    uvec4 pairs = (interior & 0xffffu) + (interior >> 16);
    return pairs.x + pairs.y + pairs.z + pairs.w;
}

uvec4 unpacked_interior(uint count) {
    return uvec4(greaterThan(uvec4(count), uvec4(0, 2, 4, 6))) | uvec4(greaterThan(uvec4(count), uvec4(1, 3, 5, 7))) << 16;
}

int effective_medium(uvec4 interior) {
#if ONE_OBJECT
    return int(interior.x & 0xffffu) - 1;
#else
    int best = AIR;
    float highest = 0.0;
    for (; interior.x != 0u; interior = next_entries(interior)) {
        int object = int(interior.x & 0xffffu) - 1;
        float rank = traced_body(object).rank;
        if (rank > highest) {
            highest = rank;
            best = object;
        }
    }
    return best;
#endif
}

// Whether a body in the interior has holes.
bool is_in_open_body(uvec4 interior) {
#if ONE_OBJECT
    return interior.x != 0u && traced_body(0).not_closed == 1.0;
#else
    for (; interior.x != 0u; interior = next_entries(interior)) {
        if (traced_body(int(interior.x & 0xffffu) - 1).not_closed == 1.0) { return true; }
    }
    return false;
#endif
}

struct Medium {
    vec3 extinction;
    vec3 emission;
    vec3 scattering;
};

#if !(ONE_OBJECT || PRIORITY)
// Whether an entry fills the place: in a union, a medium does so once.
bool fills(uvec4 interior, int index) {
#if UNION
    float slot = traced_body(int(interior_entry(interior, index)) - 1).slot;
    for (int k = 0; k < index; ++k) {
        if (traced_body(int(interior_entry(interior, k)) - 1).slot == slot) { return false; }
    }
#endif
    return true;
}
#endif

// What fills a place; effective: the body that decides there.
Medium medium_in(uvec4 interior, int effective) {
    Medium sum = Medium(vec3(0.0), vec3(0.0), vec3(0.0));
#if ONE_OBJECT || PRIORITY
    if (effective != AIR) {
        ObjectRow body = traced_body(effective);
        sum = Medium(body.extinction, body.emission, body.scattering);
    }
#if ONE_OBJECT && !PRIORITY && !UNION
    // A body that fills a place twice absorbs twice.
    float count = float(packed_interior(interior));
    sum.extinction *= count;
    sum.emission *= count;
    sum.scattering *= count;
#endif
#else
    uvec4 rest = interior;
    for (int i = 0; rest.x != 0u; ++i, rest = next_entries(rest)) {
        if (!fills(interior, i)) { continue; }
        ObjectRow body = traced_body(int(rest.x & 0xffffu) - 1);
        sum.extinction += body.extinction;
        sum.emission += body.emission;
        sum.scattering += body.scattering;
    }
#endif
    return sum;
}
