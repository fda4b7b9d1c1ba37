// The surface of an object where a ray has hit it: the row of the object, with its textures and the colors of its vertices.
// gpu/hierarchies.py writes their table behind the triangles of the hierarchies: a record for each object, corners of
// triangles, and texels. TEXTURED: there is one. Needs <ObjectRow> and hierarchy.glsl.

#if TEXTURED
uniform int surface_table;  // texel at which it begins

const int SURFACE_RECORD = 13;
const int COLOR_AT_HIT = 1;  // of a record: where what each texture is stands
const int ROUGHNESS_AT_HIT = 4;
const int TRANSMISSION_AT_HIT = 7;
const int EMISSIVE_AT_HIT = 10;

const float WIDEST = 2.8;    // texels of a mipmap under what is averaged: bilinear values are averages over some two

uvec4 table_texel(int index) {
    return texelFetch(hierarchy_triangles, hierarchy_texel(index), 0);
}

vec4 unpacked_channels(uvec2 words) {
    return vec4(words.x & 0xffffu, words.x >> 16, words.y & 0xffffu, words.y >> 16) / 65535.0;
}

// Of a texture whose texels begin at `first`; repeats: bits of columns and rows.
vec4 stored_texel(int first, ivec2 size, int repeats, ivec2 at) {
    ivec2 held = clamp(at, ivec2(0), size - 1);
    if ((repeats & 1) != 0) { held.x = at.x < 0 ? at.x + size.x : at.x >= size.x ? at.x - size.x : at.x; }
    if ((repeats & 2) != 0) { held.y = at.y < 0 ? at.y + size.y : at.y >= size.y ? at.y - size.y : at.y; }
    int index = held.y * size.x + held.x;
    uvec4 pair = table_texel(first + (index >> 1));
    return unpacked_channels((index & 1) == 0 ? pair.xy : pair.zw);
}

// Value of a texture at texture coordinates of the mesh, bilinear. width: in these coordinates, over which it is averaged.
vec4 texture_at_hit(int record, vec2 uv, float width) {
    uvec4 about = table_texel(record);
    int first = int(about.x), repeats = int(about.w);
    ivec2 size = ivec2(about.yz);
    if (size.x == 0) { return vec4(1.0); }
    vec3 right = uintBitsToFloat(table_texel(record + 1).xyz), up = uintBitsToFloat(table_texel(record + 2).xyz);
    // Row 0 is the top, where v = 1.
    vec2 at = vec2(dot(right, vec3(uv, 1.0)), 1.0 - dot(up, vec3(uv, 1.0)));
    at.x = (repeats & 1) != 0 ? fract(at.x) : clamp(at.x, 0.0, 1.0);
    at.y = (repeats & 2) != 0 ? fract(at.y) : clamp(at.y, 0.0, 1.0);
    float texels = width * sqrt(abs(right.x * up.y - right.y * up.x) * float(size.x) * float(size.y));
    for (; texels > WIDEST && size != ivec2(1); texels *= 0.5) {
        first += (size.x * size.y + 1) >> 1;
        size = max(size >> 1, ivec2(1));
    }
    vec2 place = at * vec2(size) - 0.5;
    ivec2 low = ivec2(floor(place));
    vec2 part = place - vec2(low);
    vec4 upper = mix(stored_texel(first, size, repeats, low), stored_texel(first, size, repeats, low + ivec2(1, 0)), part.x);
    vec4 lower = mix(stored_texel(first, size, repeats, low + ivec2(0, 1)), stored_texel(first, size, repeats, low + 1), part.x);
    return mix(upper, lower, part.y);
}
#endif

// Whether rays show an object with all that its textures say; with normal maps, occlusion and holes only the rasterizer does.
bool reads_all_textures(int object) {
#if TEXTURED
    return table_texel(surface_table + SURFACE_RECORD * object).y == 1u;
#else
    return false;
#endif
}

// width: metres on the surface over which textures are averaged.
ObjectRow body_at(int object, int triangle, vec2 weights, float width) {
    ObjectRow body = traced_body(object);
#if TEXTURED
    int record = surface_table + SURFACE_RECORD * object;
    uvec4 about = table_texel(record);
    if (about.y == 0u) { return body; }
    int corner = int(about.x) + 3 * triangle;
    uvec4 a = table_texel(corner), b = table_texel(corner + 1), c = table_texel(corner + 2);
    vec2 first = uintBitsToFloat(a.xy), along = uintBitsToFloat(b.xy) - first, across = uintBitsToFloat(c.xy) - first;
    vec2 uv = first + weights.x * along + weights.y * across;
    vec4 tint = unpacked_channels(a.zw) * (1.0 - weights.x - weights.y) + unpacked_channels(b.zw) * weights.x + unpacked_channels(c.zw) * weights.y;
    float spread = 0.0;
    if (width > 0.0) {
        mat3 local = mat3(body.local_x.xyz, body.local_y.xyz, body.local_z.xyz);
        vec3 from = triangle_corner(triangle, 0);
        float area = length(cross(triangle_corner(triangle, 1) - from, triangle_corner(triangle, 2) - from));
        float scale = pow(abs(determinant(local)), 1.0 / 3.0);
        spread = width * scale * sqrt(abs(along.x * across.y - along.y * across.x) / max(area, 1e-30));
    }
    vec4 rough = texture_at_hit(record + ROUGHNESS_AT_HIT, uv, spread);
    body.color *= tint.rgb * texture_at_hit(record + COLOR_AT_HIT, uv, spread).rgb;
    body.roughness *= rough.g;
    body.metallic *= rough.b;
    body.transmission *= texture_at_hit(record + TRANSMISSION_AT_HIT, uv, spread).r;
    body.emissive *= texture_at_hit(record + EMISSIVE_AT_HIT, uv, spread).rgb;
#endif
    return body;
}
