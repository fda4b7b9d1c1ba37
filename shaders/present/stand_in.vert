// A mesh for the picture that stands in for a better one: see present/stand_in.frag.

in vec3 offset;    // from the center of the mesh, in metres

uniform mat4 placed;    // to the world, from the eye
uniform mat4 seen;      // from there to the picture

out vec3 place;    // from the eye

void main() {
    vec4 world = placed * vec4(offset, 1.0);
    place = world.xyz;
    gl_Position = seen * world;
}
