// What one of several samples adds to their mean.

uniform sampler2D sampled;
uniform float part;

layout(location = 0) out vec4 mean;

void main() {
    mean = part * texelFetch(sampled, ivec2(gl_FragCoord.xy), 0);
}
