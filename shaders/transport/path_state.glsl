// A path of light, as far as it has been followed, and the statistics of those of its pixel that have ended.

const uint FLAG_FOLLOWED = 1u << 16;   // it has begun, and not ended
const uint FLAG_BENT = 1u << 17;       // it has interacted, or been scattered
const uint FLAG_REFLECTED = 1u << 18;  // it sees the environment as a light
const uint FLAG_CAREFUL = 1u << 19;    // the driver has cut it short: one event in each pass
const uint FLAG_SEES_LIGHTS = 1u << 20;  // it has been bent or mirrored since a ray was drawn to a light, and may hit one
const uint DEPTH_BITS = 0xffffu;

struct Path {
    vec3 origin;
    float skipped;   // metres of its segment that lie before its origin: from the surface, which it must not hit again
    vec3 direction;
    vec3 throughput; // fraction of the light at its end that reaches the eye
    vec3 light;
    uvec4 interior;
    uint flags;
    int depth;       // interfaces behind it
    bool ends;
    bool lost;
};

// Of the paths of a pixel that have ended (Welford 1962): sums of squares would lose what they differ by.
struct Statistics {
    uint count;
    vec3 mean;
    vec3 spread;
    float lost;
};

// Adds several paths that are all the same.
void add_paths(inout Statistics known, vec3 light, uint count) {
    float before = float(known.count), total = float(known.count + count);
    vec3 difference = light - known.mean;
    known.mean += difference * (float(count) / total);
    known.spread += difference * difference * (before * float(count) / total);
    known.count += count;
}
