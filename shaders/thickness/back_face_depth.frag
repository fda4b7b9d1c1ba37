// Nearest front face and farthest back face: red and green keep their maximum, alpha counts the faces.

#include <constants>
#include <Body>

in float axial;

layout(location = 0) out vec4 nearest_and_farthest;

void main() {
    float start = max(axial, axial_start);
    nearest_and_farthest = gl_FrontFacing ? vec4(-start, -NOTHING, 0.0, 1.0) : vec4(-NOTHING, start, 0.0, 1.0);
}
