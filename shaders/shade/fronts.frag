// Where a ray first hits a body: layers beyond it are behind media.

#include <constants>
#include <Body>

in float axial;

layout(location = 0) out float front;  // axial depth

void main() {
    if (axial < axial_start) { discard; }  // behind an orthographic picture
    front = axial * axial_depth_scale + axial_depth_start;
    gl_FragDepth = clamp(front, 0.0, 1.0);
}
