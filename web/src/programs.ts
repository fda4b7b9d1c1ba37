/** Materials of the passes: generated GLSL with the vertices of three.js, whatever moves them. */
import {
  AddEquation,
  CustomBlending,
  DoubleSide,
  GLSL3,
  Matrix4,
  MinEquation,
  NoBlending,
  OneFactor,
  ShaderMaterial,
  Vector2,
  Vector3,
  Vector4,
} from "three";
import type { BlendingEquation, IUniform, Texture } from "three";
import * as generated from "./generated/shaders.js";

// Vertices as three.js moves them, then as body.vert places them.
const VERTEX = `
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
uniform vec3 center;
#ifdef USE_INSTANCING
flat out float mirrored;
#endif
${generated.bodyVertex.replace("in vec3 offset;", "vec3 offset;").replace("void main()", "void place_vertex()")}
void main() {
  #include <begin_vertex>
  #include <morphinstance_vertex>
  #include <morphtarget_vertex>
  #include <skinbase_vertex>
  #include <skinning_vertex>
  #ifdef USE_INSTANCING
  mirrored = sign(determinant(mat3(instanceMatrix)));
  transformed = (instanceMatrix * vec4(transformed, 1.0)).xyz;
  #endif
  offset = transformed - center;
  place_vertex();
}
`;

// An instance that is mirrored shows its other side; three.js turns only whole objects.
const SIDE = `
#ifdef WITH_INSTANCES
flat in float mirrored;
#define FRONT_FACING (gl_FrontFacing == (mirrored > 0.0))
#else
#define FRONT_FACING gl_FrontFacing
#endif
`;

const FULLSCREEN = `
void main() {
  vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
}
`;

/** Uniforms of one body: fields of the block Body that its shaders use. */
export interface BodyUniforms {
  [name: string]: IUniform;
  clip_from_offset: IUniform<Matrix4>;
  axis: IUniform<Vector4>;
  center: IUniform<Vector3>;
  axial_start: IUniform<number>;
  axial_depth_scale: IUniform<number>;
  axial_depth_start: IUniform<number>;
  count_weight: IUniform<number>;
  count_offset: IUniform<number>;
  snapping_share: IUniform<number>;
  extinction: IUniform<Vector4>;
  opaque_axial_depth: IUniform<Texture | null>;
  opaque_range: IUniform<Vector2>;
}

export function bodyUniforms(): BodyUniforms {
  return {
    clip_from_offset: { value: new Matrix4() },
    axis: { value: new Vector4() },
    center: { value: new Vector3() },
    axial_start: { value: -generated.NOTHING },
    axial_depth_scale: { value: 1 },
    axial_depth_start: { value: 0 },
    count_weight: { value: 1 },
    count_offset: { value: 0 },
    snapping_share: { value: 0 },
    extinction: { value: new Vector4() },
    opaque_axial_depth: { value: null },
    opaque_range: { value: new Vector2(0, 1) },
  };
}

function drawn(fragment: string, equation: BlendingEquation, uniforms: BodyUniforms, instanced: boolean): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: SIDE + fragment.replace("gl_FrontFacing", "FRONT_FACING"),
    defines: instanced ? { WITH_INSTANCES: 1 } : {},
    uniforms,
    side: DoubleSide,
    forceSinglePass: true,
    depthTest: false,
    depthWrite: false,
    blending: CustomBlending,
    blendEquation: equation,
    blendSrc: OneFactor,
    blendDst: OneFactor,
    toneMapped: false,
  });
}

/** Adds up signed paths and counts. */
export function summing(uniforms: BodyUniforms, spectral: boolean, opaque: boolean, instanced: boolean): ShaderMaterial {
  const path = opaque ? generated.signedDepthBeforeOpaque : generated.signedDepth;
  const paths = opaque ? generated.spectralDepthBeforeOpaque : generated.spectralDepth;
  return drawn(spectral ? paths : path, AddEquation, uniforms, instanced);
}

/** Keeps the nearest opaque surface, as a share of the depth of the media; without a depth buffer, which would round it. */
export function nearest(uniforms: BodyUniforms, instanced: boolean): ShaderMaterial {
  return drawn(generated.opaqueDepth, MinEquation, uniforms, instanced);
}

/** Uniforms of the pass over the pixels: fields of the blocks View and Shade. */
export function resolveUniforms() {
  return {
    accumulated: { value: null as Texture | null },
    accumulated_path: { value: null as Texture | null },
    frame_size: { value: new Vector4() },
    ray_right: { value: new Vector4() },
    ray_up: { value: new Vector4() },
    ray_forward: { value: new Vector4() },
    expected_count: { value: new Vector2() },
    rounding: { value: 0 },
    count_share: { value: 0 },
    coverage_floor: { value: 0 },
  };
}

/** From sums to metres. */
export function resolving(uniforms: ReturnType<typeof resolveUniforms>, spectral: boolean): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: FULLSCREEN,
    fragmentShader: spectral ? generated.spectralThickness : generated.thickness,
    uniforms,
    depthTest: false,
    depthWrite: false,
    blending: NoBlending,
    toneMapped: false,
  });
}
