// Nearest front face and farthest back face: red and green keep their maximum, alpha counts the faces.

#include <constants>

in float axial;

layout(location = 0) out vec4 nearest_and_farthest;

void main() {
    nearest_and_farthest = gl_FrontFacing ? vec4(-axial, -NOTHING, 0.0, 1.0) : vec4(-NOTHING, axial, 0.0, 1.0);
}
