// One photon; blending adds them up.

flat in vec4 irradiance;

layout(location = 0) out vec4 out_irradiance;

void main() {
    out_irradiance = irradiance;
}
