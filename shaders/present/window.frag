// A picture in a part of the window; texels where they belong if it has as many pixels.

uniform sampler2D picture;

in vec2 place;

layout(location = 0) out vec4 color;

void main() {
    color = texture(picture, place);
}
