// Ends of rays on opaque objects, up to two for each live ray, at places of their own. Needs ray_step.glsl.

layout(std430, binding = RAY_ENDS_BINDING) buffer RayEnds { float ray_ends[]; };

uniform int end_words;   // of a record

void put_end(inout int at, float number) { ray_ends[at++] = number; }
void put_end(inout int at, vec3 vector) { for (int axis = 0; axis < 3; ++axis) { put_end(at, vector[axis]); } }
float take_end_number(inout int at) { return ray_ends[at++]; }
vec3 take_end_vector(inout int at) { vec3 v; for (int axis = 0; axis < 3; ++axis) { v[axis] = ray_ends[at++]; } return v; }

void store_end(int place, EscapedRay end, vec3 throughput) {
    int at = end_words * place;
    put_end(at, intBitsToFloat(end.object << 1 | (end.reflected ? 1 : 0)));
    put_end(at, throughput);
    put_end(at, end.normal);
    put_end(at, end.point);
    put_end(at, end.origin);
    put_end(at, end.direction);
#if MICROFACETS
    put_end(at, end.blur);
#endif
#if TEXTURED
    put_end(at, intBitsToFloat(end.triangle));
    put_end(at, end.weights.x);
    put_end(at, end.weights.y);
    put_end(at, end.width);
#endif
#if AHEAD
    put_end(at, end.ahead.depth);
    put_end(at, end.ahead.path);
    put_end(at, intBitsToFloat(end.ahead.body));
#endif
}

EscapedRay stored_end(int place, out vec3 throughput) {
    int at = end_words * place;
    EscapedRay end = EscapedRay(AIR, -1, vec2(0.0), 0.0, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), false, 0.0, ellipse_of(no_footprint()), NONE_AHEAD);
    int word = floatBitsToInt(take_end_number(at));
    end.object = word >> 1;
    end.reflected = (word & 1) != 0;
    throughput = take_end_vector(at);
    end.normal = take_end_vector(at);
    end.point = take_end_vector(at);
    end.origin = take_end_vector(at);
    end.direction = take_end_vector(at);
#if MICROFACETS
    end.blur = take_end_number(at);
#endif
#if TEXTURED
    end.triangle = floatBitsToInt(take_end_number(at));
    end.weights.x = take_end_number(at);
    end.weights.y = take_end_number(at);
    end.width = take_end_number(at);
#endif
#if AHEAD
    end.ahead.depth = take_end_vector(at);
    end.ahead.path = take_end_number(at);
    end.ahead.body = floatBitsToInt(take_end_number(at));
#endif
    return end;
}
