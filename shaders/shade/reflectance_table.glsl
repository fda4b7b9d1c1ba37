// The table of the split sum (Karis 2013): scale and bias of the reflectance at normal incidence, by cosine and roughness.

uniform sampler2D reflectance_table;

vec2 reflectance_entry(float cosine, float roughness) {
    // Both ends of cosine and roughness are centers of texels.
    vec2 at = (vec2(cosine, roughness) * (REFLECTANCE_TABLE_SIZE - 1.0) + 0.5) / REFLECTANCE_TABLE_SIZE;
    return textureLod(reflectance_table, at, 0.0).rg;
}
