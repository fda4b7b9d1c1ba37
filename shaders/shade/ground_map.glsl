// Position on a map of an endless ground, from -1 to 1: the middle of the ground takes half of the map, and all that is farther off,
// ever smaller, the rest.

vec2 squeezed(vec2 at) {
    vec2 size = abs(at);
    return mix(0.5 * at, sign(at) * (1.0 - 0.5 / max(size, vec2(1.0))), greaterThan(size, vec2(1.0)));
}

vec2 unsqueezed(vec2 place) {
    vec2 size = abs(place);
    return mix(2.0 * place, sign(place) * 0.5 / max(1.0 - size, vec2(1e-6)), greaterThan(size, vec2(0.5)));
}
