// A picture in a part of the window; texels where they belong if it has as many pixels.

uniform sampler2D picture;
uniform vec4 part;  // pixels: its left and bottom, width and height

layout(location = 0) out vec4 color;

void main() {
    color = texture(picture, (gl_FragCoord.xy - part.xy) / part.zw);
}
