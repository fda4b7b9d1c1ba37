// What an opaque surface sends to the eye: a metal, or a coat over paint, or between the two (glTF 2.0, Appendix B), lit by the
// environment (split sum, Karis 2013) and by lights, as far as they reach it. Energy that a rough surface loses between its
// microfacets is given back by a factor (Turquin 2019). Needs <constants>, <Lights> and a texture `reflectance_table`.

#include "lib/interface.glsl"
#include "lib/lights.glsl"
#include "shade/environment_light.glsl"
#include "shade/highlight.glsl"
#include "shade/shadows.glsl"

struct OpaqueFinish {
    vec3 base;          // albedo of paint, and reflectance of metal
    float metallic;
    float roughness;
    float ior;          // of the coat
    vec3 passed;        // share of light on the paint that passes to the other side, with its color,
    float passed_share; // and without: what paint does not reflect
    vec3 emitted;
    vec3 normal;        // unit, towards the side that the mesh calls outside
    float variance;     // of normals within a pixel
    float opacity;      // of texture and vertices
    float unoccluded;   // share of the light of the environment that reaches it
    bool is_hole;
};

// What the microfacets of one of the two layers mirror, relative to those without any loss.
struct Layer {
    vec3 facing;    // reflectance face-on, and
    vec3 grazing;   // edge-on (Schlick 1994)
    vec3 regained;  // what is lost between microfacets, as a factor
    vec3 mirrored;  // share of uniform light
};

Layer layer_of(vec3 facing, vec2 table) {
    // Only what hardly has a step in ior reflects less than 2 % face-on: that fades at grazing angles, too.
    vec3 grazing = min(50.0 * facing, vec3(1.0));
    vec3 regained = 1.0 + facing * (1.0 / max(table.x + table.y, 1e-3) - 1.0);
    return Layer(facing, grazing, regained, (facing * table.x + grazing * table.y) * regained);
}

vec3 fresnel_of(Layer layer, float away) {
    return (layer.facing + (layer.grazing - layer.facing) * away) * layer.regained;
}

// ray: unit, from the eye; normal: to the eye's side; position: from the eye; point: from the center of the media.
vec3 opaque_radiance_of(OpaqueFinish finish, vec3 normal, vec3 ray, vec3 position, vec3 point) {
    float ior = finish.ior;
    float cos_view = clamp(-dot(normal, ray), 1e-3, 1.0);
    vec2 table = textureLod(reflectance_table, reflectance_coordinate(cos_view, finish.roughness), 0.0).rg;
    Layer coat = layer_of(vec3((ior - 1.0) * (ior - 1.0) / ((ior + 1.0) * (ior + 1.0))), table);
    Layer metal = layer_of(finish.base, table);
    float painted = (1.0 - finish.metallic) * (1.0 - coat.mirrored.r);
    vec3 paint = finish.base * (1.0 - finish.passed_share);

    vec3 sum = finish.unoccluded * (mix(coat.mirrored, metal.mirrored, finish.metallic)
            * environment_light(reflected_direction(ray, normal), finish.roughness)
        + painted * paint * environment_irradiance(normal) * environment_reaching(point, normal) / PI);
    if (finish.passed != vec3(0.0)) {
        sum += finish.unoccluded * painted * finish.passed * environment_irradiance(-normal) * environment_reaching(point, -normal) / PI;
    }
    float alpha = highlight_alpha(finish.roughness, finish.variance);
    for (int light = 0; light < light_count; ++light) {
        vec4 at = light_position[light];
        vec3 way = at.xyz - at.w * position;
        float distance_m = max(length(way), 1e-18);
        vec3 towards = way / distance_m;
        vec3 irradiance = at.w == 0.0 ? light_power[light].rgb : light_power[light].rgb / distance_m / distance_m;
        irradiance *= cone_attenuation(-towards, light_cone[light]);
        float cos_light = dot(normal, towards);
        if (cos_light > 0.0 || finish.passed_share > 0.0) { irradiance *= light_reaching(light, point, normal); }
        if (cos_light <= 0.0) {
            sum -= painted * finish.passed / PI * cos_light * irradiance;
            continue;
        }
        vec3 half_way = normalize(towards - ray);
        float away = pow(1.0 - clamp(dot(half_way, towards), 0.0, 1.0), 5.0);
        vec3 glint = mix(fresnel_of(coat, away), fresnel_of(metal, away), finish.metallic)
            * ggx_distribution(min(dot(half_way, normal), 1.0), alpha) * ggx_visibility(cos_light, cos_view, alpha);
        sum += (glint + painted * paint / PI) * cos_light * irradiance;
    }
    return sum + finish.emitted;
}
