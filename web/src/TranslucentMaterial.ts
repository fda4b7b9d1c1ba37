/** A physical material whose light crosses what is really there: the thickness of an ExactThicknessPass, not a constant. */
import { MeshPhysicalMaterial, Vector3 } from "three";
import type { Camera, IUniform, MeshPhysicalMaterialParameters, Texture, WebGLRenderer } from "three";
import type { ExactThicknessPass } from "./ExactThicknessPass.js";
import { TranslucentError } from "./errors.js";
import { extinctionOf } from "./extinction.js";
import { library } from "./generated/shaders.js";

export interface TranslucentMaterialParameters extends MeshPhysicalMaterialParameters {
  /** The pass that measures the scene; `pass.render(scene, camera)` goes before the picture. */
  pass: ExactThicknessPass;
}

interface Uniforms {
  [name: string]: IUniform;
  exactPath: IUniform<Texture | null>;
  exactOpticalDepth: IUniform<Texture | null>;
  exactExits: IUniform<Texture | null>;
  exactEnds: IUniform<Texture | null>;
  exactExtinction: IUniform<Vector3>;
  exactDiagonal: IUniform<number>;
  exactUse: IUniform<[boolean, boolean, boolean]>;
}

const DECLARED = `
#ifdef USE_TRANSMISSION
uniform sampler2D exactPath;
uniform sampler2D exactOpticalDepth;
uniform sampler2D exactExits;
uniform sampler2D exactEnds;
uniform vec3 exactExtinction;
uniform float exactDiagonal;
uniform bool exactUse[3];  // optical depth, exits, opaque ends
#define STEPS 16
#define HALVINGS 5
${library}

vec2 exactPlace(vec3 p) {
  vec4 clip = projectionMatrix * vec4(p, 1.0);
  return clip.xy / clip.w * 0.5 + 0.5;
}

vec4 exactTexel(sampler2D from, vec2 place) {
  ivec2 size = textureSize(from, 0);
  return texelFetch(from, clamp(ivec2(place * vec2(size)), ivec2(0), size - 1), 0);
}

// Point of the camera's axes at a place of the picture, so many metres along the axis.
vec3 exactPoint(vec2 place, float axial) {
  vec2 ndc = 2.0 * place - 1.0;
  vec2 across = isOrthographic
    ? (ndc - projectionMatrix[3].xy) / vec2(projectionMatrix[0].x, projectionMatrix[1].y)
    : (ndc + projectionMatrix[2].xy) * axial / vec2(projectionMatrix[0].x, projectionMatrix[1].y);
  return vec3(across, -axial);
}

// Background: an opaque object where the picture shows one, else the environment, else the picture all the same.
vec3 exactBehind(vec3 p, vec3 direction, float roughness, float ior) {
  vec2 place = exactPlace(p);
  vec4 seen = getTransmissionSample(place, roughness, ior);
#ifdef USE_ENVMAP
  bool opaque = exactUse[2] && exactTexel(exactEnds, place).r < 1e4 && all(equal(place, clamp(place, 0.0, 1.0)));
  // What a mirror that faces this way would show.
  return opaque ? seen.rgb : getIBLRadiance(direction, direction, applyIorToRoughness(roughness, ior));
#else
  return seen.rgb;
#endif
}

bool exactInside(vec3 p) {
  vec2 place = exactPlace(p);
  return all(equal(place, clamp(place, 0.0, 1.0))) && -p.z <= exactTexel(exactExits, place).a;
}

// Light that comes through from behind: bent where it enters, and where it leaves the last surface.
vec3 exactTransmitted(vec3 p, vec3 n, float roughness, float ior, float fallback) {
  vec2 place = exactPlace(p);
  vec4 path = exactTexel(exactPath, place);
  bool valid = path.b > 0.0;
  float thickness = valid ? path.r : fallback;
  vec3 ray = isOrthographic ? vec3(0.0, 0.0, -1.0) : normalize(p);
  // Smooth normals may look away at an outline.
  n = normalize(n - ray * max(dot(ray, n) + 0.05, 0.0));
  vec3 inside = tl_refracted_direction(ray, n, ior);
  float kept = 1.0 - tl_fresnel_dielectric(-dot(ray, n), ior);
  float along = thickness;
  float filled = 1.0;
  float crossings = 1.0;
  float longest = 1e30;
  vec3 outside = inside;
  if (exactUse[1] && valid) {
    // To where the bent ray is behind the last surface: in steps, then halving them, then by the tangent plane there.
    float reach = length(exactPoint(place, exactTexel(exactExits, place).a) - p);
    float low = 0.0;
    float high = exactDiagonal;
    for (int i = 1; i <= STEPS; ++i) {
      float at = exactDiagonal * float(i) / float(STEPS);
      if (!exactInside(p + at * inside)) { high = at; break; }
      low = at;
    }
    for (int i = 0; i < HALVINGS; ++i) {
      float at = 0.5 * (low + high);
      if (exactInside(p + at * inside)) { low = at; } else { high = at; }
    }
    vec2 there = exactPlace(p + low * inside);
    vec4 exit = exactTexel(exactExits, there);
    vec3 exitNormal = exit.rgb;
    float slope = dot(inside, (viewMatrix * vec4(exitNormal, 0.0)).xyz);
    along = low;
    if (exit.a > 0.0 && slope > 0.05) {
      float tangent = dot(exactPoint(there, exit.a) - p, (viewMatrix * vec4(exitNormal, 0.0)).xyz) / slope;
      along = clamp(tangent, low - exactDiagonal / float(STEPS), high + exactDiagonal / float(STEPS));
      along = max(along, 0.0);
    }
    // Of the way to the last surface, the share that is inside. Where a strand ends before another the bent ray crosses a
    // gap: no more than is on either, and on as the ray came.
    filled = reach > thickness ? thickness / reach : 1.0;
    vec4 other = exactTexel(exactPath, there);
    longest = max(thickness, other.b > 0.0 ? other.r : 0.0) / max(dot(inside, ray), 0.1);
    vec3 normal = normalize((viewMatrix * vec4(exitNormal, 0.0)).xyz);
    float cosine = dot(inside, normal);
    bool gap = along * filled > longest;
    if (gap) { outside = ray; }
    if (!gap && dot(exitNormal, exitNormal) > 0.25 && cosine > 0.0) {
      vec3 leaving = tl_refracted_direction(inside, -normal, 1.0 / ior);
      bool leaves = dot(leaving, leaving) > 0.25;
      outside = leaves ? leaving : tl_reflected_direction(inside, -normal);
      kept *= leaves ? 1.0 - tl_fresnel_dielectric(cosine, 1.0 / ior) : 1.0;
      crossings = leaves ? 1.0 : 2.0;  // mirrored inside, it goes as far again
    }
  }
  // Per metre of the straight ray, of all media on it.
  vec3 extinction = exactUse[0] && thickness > 0.0 ? exactTexel(exactOpticalDepth, place).rgb / thickness : exactExtinction;
  return kept * tl_transmittance(extinction * (min(along * filled, longest) * crossings)) * exactBehind(p + along * inside, outside, roughness, ior);
}
#endif
`;

const TRANSMITTED = `
#ifdef USE_TRANSMISSION
  material.transmission = transmission;
  material.transmissionAlpha = 1.0;
  #ifdef USE_TRANSMISSIONMAP
  material.transmission *= texture2D(transmissionMap, vTransmissionMapUv).r;
  #endif
  // What three.js mirrors by Schlick's approximation, as Fresnel has it: at ior 1, nothing.
  float exactCosine = clamp(dot(normal, isOrthographic ? vec3(0.0, 0.0, 1.0) : normalize(vViewPosition)), 0.0, 1.0);
  float exactRatio = (material.ior - 1.0) / (material.ior + 1.0);
  float exactSchlick = mix(pow(1.0 - exactCosine, 5.0), 1.0, exactRatio * exactRatio);
  totalSpecular *= tl_fresnel_dielectric(exactCosine, material.ior) / max(exactSchlick, 1e-6);
  vec3 exactLight = exactTransmitted(-vViewPosition, normal, material.roughness, material.ior, thickness);
  totalDiffuse = mix(totalDiffuse, exactLight * diffuseColor.rgb, material.transmission);
#endif
`;

/**
 * MeshPhysicalMaterial, but light that comes through is absorbed along what an ExactThicknessPass measured:
 * attenuationColor is what is left after attenuationDistance. Rays bend where they enter, and where they leave the last
 * surface. Where no number can be trusted (an open mesh), `thickness` stands in.
 */
export class TranslucentMaterial extends MeshPhysicalMaterial {
  readonly isTranslucentMaterial = true;
  pass: ExactThicknessPass;
  private readonly exact: Uniforms = {
    exactPath: { value: null },
    exactOpticalDepth: { value: null },
    exactExits: { value: null },
    exactEnds: { value: null },
    exactExtinction: { value: new Vector3() },
    exactDiagonal: { value: 1 },
    exactUse: { value: [false, false, false] },
  };

  private warned = false;

  constructor({ pass, ...others }: TranslucentMaterialParameters) {
    if (typeof pass?.render !== "function") {
      throw new TranslucentError("TranslucentMaterial", "it has no pass", "give one: { pass: new ExactThicknessPass(renderer) }");
    }
    super({ transmission: 1, roughness: 0, metalness: 0, ...others });
    this.pass = pass;
  }

  override onBeforeRender(_renderer: WebGLRenderer, _scene: unknown, _camera: Camera): void {
    const { exact, pass } = this;
    if (pass.texture === null && !this.warned) {
      this.warned = true; // once: a context may be lost for some frames
      const name = this.name ? `"${this.name}"` : "without a name";
      console.warn(`TranslucentMaterial ${name}; its pass has measured nothing, so that its thickness stands in; call pass.render(scene, camera) before renderer.render`);
    }
    exact.exactPath.value = pass.texture;
    exact.exactOpticalDepth.value = pass.opticalDepth;
    exact.exactExits.value = pass.exits;
    exact.exactEnds.value = pass.opaqueDepth;
    exact.exactExtinction.value.fromArray(extinctionOf(this));
    exact.exactDiagonal.value = pass.diagonal;
    exact.exactUse.value = [pass.opticalDepth !== null, pass.exits !== null, pass.opaqueDepth !== null];
  }

  override onBeforeCompile(shader: { fragmentShader: string; uniforms: Record<string, IUniform> }): void {
    Object.assign(shader.uniforms, this.exact);
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <transmission_pars_fragment>", `#include <transmission_pars_fragment>\n${DECLARED}`)
      .replace("#include <transmission_fragment>", TRANSMITTED);
  }

  override customProgramCacheKey(): string {
    return "TranslucentMaterial";
  }

  override copy(source: TranslucentMaterial): this {
    super.copy(source);
    this.pass = source.pass;
    return this;
  }

  override clone(): this {
    return new TranslucentMaterial({ pass: this.pass }).copy(this) as this;
  }
}
