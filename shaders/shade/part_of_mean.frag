// What one of several samples adds to their mean. HELD: the mean itself, where no sample shows anything that of the pixels around.

uniform sampler2D sampled;

layout(location = 0) out vec4 mean;

#if HELD
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(sampled, 0) - 1;
    vec4 sum = texelFetch(sampled, here, 0);
    for (int i = 0; i < 9 && sum.a == 0.0; ++i) { sum += texelFetch(sampled, clamp(here + ivec2(i % 3, i / 3) - 1, ivec2(0), last), 0); }
    mean = sum.a > 0.0 ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}
#else
uniform float part;

void main() {
    mean = part * texelFetch(sampled, ivec2(gl_FragCoord.xy), 0);
}
#endif
