// What a pixel sees of the environment along a ray: differentials of the ray with regard to its place in the picture, carried
// through reflections and refractions (Igehy 1999, "Tracing ray differentials"), and a lookup that averages over them.
// Needs <constants>, lib/interface.glsl, hierarchy.glsl, interaction.glsl and environment_light.glsl. FOOTPRINTS.

#if FOOTPRINTS
uniform float pixel_step;  // width of a sample in pixels

// Differentials of a ray's point and direction by a step to the right and one down in the picture, as large as a sample.
struct Footprint {
    mat2x3 point;
    mat2x3 direction;
};

// An ellipse of directions about a ray: its longer half axis, and its shorter one.
struct Ellipse {
    vec3 axis;
    float breadth;
};

Footprint no_footprint() {
    return Footprint(mat2x3(0.0), mat2x3(0.0));
}

vec3 direction_through(vec2 pixel) {
    return normalize(view_ray(pixel, frame_size.xy, ray_right.xyz, ray_up.xyz, ray_forward.xyz));
}

// The products of all parts of a vector and of two numbers.
mat2x3 spread_out(vec3 along, vec2 fractions) {
    return mat2x3(fractions.x * along, fractions.y * along);
}

// Footprint of a pixel on its ray at an axial depth.
Footprint footprint_of(vec2 pixel, float axial_depth) {
    vec3 point = point_at(pixel, axial_depth), direction = direction_through(pixel);
    vec2 right = pixel + vec2(pixel_step, 0.0), down = pixel + vec2(0.0, pixel_step);
    return Footprint(mat2x3(point_at(right, axial_depth) - point, point_at(down, axial_depth) - point),
        mat2x3(direction_through(right) - direction, direction_through(down) - direction));
}

void advance(inout Footprint footprint, float path) {
    footprint.point += path * footprint.direction;
}

// Where the neighbors of a ray hit the plane of a face.
mat2x3 onto_plane(mat2x3 point, vec3 direction, vec3 face_normal) {
    float across = dot(face_normal, direction);
    float least = across < 0.0 ? min(across, -LEAST_ACROSS) : max(across, LEAST_ACROSS);
    return point - spread_out(direction, 1.0 / least * (face_normal * point));
}

// Differentials of the smooth normal where a ray has hit, turned as that is: corner normals are interpolated over a face.
mat2x3 normal_differentials(Hit hit, mat2x3 point, vec3 smooth_normal) {
    ObjectRow body = traced_body(hit.object);
    uvec4 a = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle), 0);
    uvec4 b = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle + 1), 0);
    uvec4 c = texelFetch(hierarchy_triangles, hierarchy_texel(3 * hit.triangle + 2), 0);
    vec3 first = unpacked_normal(a.w), second = unpacked_normal(b.w) - first, third = unpacked_normal(c.w) - first;
    vec3 to_second = uintBitsToFloat(b.xyz) - uintBitsToFloat(a.xyz), to_third = uintBitsToFloat(c.xyz) - uintBitsToFloat(a.xyz);
    vec3 face = cross(to_second, to_third);
    mat3 world = mat3(body.local_x.xyz, body.local_y.xyz, body.local_z.xyz);
    mat2x3 local = transpose(world) * point;
    // How the weights of the second and the third corner change.
    vec2 seconds = cross(to_third, face) * local / max(dot(face, face), 1e-37);
    vec2 thirds = cross(face, to_second) * local / max(dot(face, face), 1e-37);
    vec3 normal = world * (first + hit.weights.x * second + hit.weights.y * third);
    mat2x3 change = world * (spread_out(second, seconds) + spread_out(third, thirds));
    float turned = dot(normal, smooth_normal) < 0.0 ? -1.0 : 1.0;
    vec3 unit = normalize(normal);
    return turned / max(length(normal), 1e-37) * (change - spread_out(unit, unit * change));
}

// None is wider than all directions to one side.
mat2x3 bounded(mat2x3 direction) {
    return mat2x3(direction[0] / max(length(direction[0]), 1.0), direction[1] / max(length(direction[1]), 1.0));
}

mat2x3 reflected_differentials(mat2x3 incident, mat2x3 normals, vec3 direction, vec3 normal) {
    vec2 cosines = normal * incident + direction * normals;
    return bounded(incident - 2.0 * (dot(direction, normal) * normals + spread_out(normal, cosines)));
}

// Zero under total internal reflection.
mat2x3 refracted_differentials(mat2x3 incident, mat2x3 normals, vec3 direction, vec3 normal, float ior) {
    float cosine = -dot(direction, normal);
    float inside = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if (inside <= 0.0) { return mat2x3(0.0); }
    inside = max(sqrt(inside), LEAST_ACROSS);
    vec2 cosines = -(normal * incident + direction * normals);
    vec2 along = (1.0 / ior - cosine / (ior * ior * inside)) * cosines;
    return bounded((1.0 / ior) * incident + (cosine / ior - inside) * normals + spread_out(normal, along));
}

// Footprints behind an interface: of the reflected ray, and of the refracted one, which goes straight on through a thin wall.
void split_footprint(Footprint own, Hit hit, Interaction at, out Footprint reflected, out Footprint refracted) {
    mat2x3 point = onto_plane(own.point, at.direction, at.face_normal);
    mat2x3 normals = normal_differentials(hit, point, at.normal);
    reflected = Footprint(point, reflected_differentials(own.direction, normals, at.direction, at.normal));
    refracted = Footprint(point, at.thin_walled ? own.direction
        : refracted_differentials(own.direction, normals, at.direction, at.normal, at.ior));
}

// The ellipse with the moments of the parallelogram of a footprint: half axes are standard deviations.
Ellipse ellipse_of(Footprint footprint) {
    mat2x3 direction = footprint.direction;
    float right = dot(direction[0], direction[0]), down = dot(direction[1], direction[1]), both = dot(direction[0], direction[1]);
    float middle = 0.5 * (right + down), off = length(vec2(0.5 * (right - down), both));
    float longer = (middle + off) / 12.0, shorter = max(middle - off, 0.0) / 12.0;
    // Angle that combines the two sides to the longer axis.
    float turn = 0.5 * atan(2.0 * both, right - down);
    return Ellipse((cos(turn) * direction[0] + sin(turn) * direction[1]) / sqrt(12.0), sqrt(shorter));
}

// Radiance of the environment averaged over an ellipse about a direction: lookups along its longer axis, each in the map
// that is blurred for the shorter one. blur: squared alpha of a mirror with the same blur as the rough interfaces of the path.
vec3 averaged_environment(vec3 direction, float blur, Ellipse ellipse) {
    float longer = length(ellipse.axis);
    float lookups = clamp(ceil(longer / max(ellipse.breadth, LEAST_BREADTH)), 1.0, MOST_LOOKUPS);
    float breadth = max(ellipse.breadth, longer / lookups);
    float roughness = sqrt(sqrt(min(blur + ALPHA_OF_DEVIATION * ALPHA_OF_DEVIATION * breadth * breadth, 1.0)));
    // Between the map as it is and the first that is blurred, steps are of the variance: by equal steps of roughness even a
    // narrow ellipse would see much of the wide one.
    float sharpest = 1.0 / float(textureSize(light_levels, 0).z);
    if (blur == 0.0 && roughness < sharpest) { roughness = sharpest * pow(roughness / sharpest, 4.0); }
    vec3 sum = vec3(0.0);
    for (float i = 0.5; i < lookups; i += 1.0) {
        sum += environment_light(normalize(direction + sqrt(12.0) * (i / lookups - 0.5) * ellipse.axis), roughness);
    }
    return sum / lookups;
}
#else
// Rays without footprints: the environment is not a picture.
struct Footprint {
    float none;
};

struct Ellipse {
    float none;
};

Footprint no_footprint() { return Footprint(0.0); }
Footprint footprint_of(vec2 pixel, float axial_depth) { return Footprint(0.0); }
void advance(inout Footprint footprint, float path) {}
void split_footprint(Footprint own, Hit hit, Interaction at, out Footprint reflected, out Footprint refracted) {
    reflected = refracted = own;
}
Ellipse ellipse_of(Footprint footprint) { return Ellipse(0.0); }
#endif
