/** Materials of the passes: generated GLSL with the vertices of three.js, whatever moves them. */
import {
  AddEquation,
  AlwaysStencilFunc,
  CustomBlending,
  DoubleSide,
  EqualStencilFunc,
  GreaterDepth,
  GLSL3,
  MinEquation,
  NoBlending,
  OneFactor,
  ReplaceStencilOp,
  ShaderMaterial,
  Vector2,
  Vector4,
} from "three";
import type { BlendingEquation, Texture } from "three";
import * as generated from "./generated/shaders.js";
import type { BodyUniforms } from "./uniforms.js";

const NORMALS = `
  #include <beginnormal_vertex>
  #include <morphinstance_vertex>
  #include <morphnormal_vertex>
  #include <skinbase_vertex>
  #include <skinnormal_vertex>
  #ifdef USE_INSTANCING
  mat3 turned = mat3(instanceMatrix);
  objectNormal = turned * (objectNormal / vec3(dot(turned[0], turned[0]), dot(turned[1], turned[1]), dot(turned[2], turned[2])));
  #endif
`;

// Vertices as three.js moves them, then as body.vert places them.
const vertex = (body: string, normals: boolean): string => `
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
uniform vec3 center;
uniform vec2 half_size;
uniform vec2 anchor_slope;
uniform vec2 anchor_rest;
uniform vec2 across_start;
uniform vec2 anchor_pixel;
#ifdef CHECKING
uniform vec2 shift;
#endif
out vec2 across;
flat out vec2 anchor;
#ifdef USE_INSTANCING
flat out float mirrored;
#endif
${body.replace(/^in (vec3 (offset|normal);)/gm, "$1").replace("void main()", "void place_vertex()").replace(/\b(axial|normal)\b/g, "$1_shown")}
void main() {
  ${normals ? NORMALS : ""}
  #include <begin_vertex>
  ${normals ? "" : "#include <morphinstance_vertex>\n  #include <skinbase_vertex>"}
  #include <morphtarget_vertex>
  #include <skinning_vertex>
  #ifdef USE_INSTANCING
  mirrored = sign(determinant(mat3(instanceMatrix)));
  transformed = (instanceMatrix * vec4(transformed, 1.0)).xyz;
  #endif
  ${normals ? "normal_shown = objectNormal;" : ""}
  offset = transformed - center;
  place_vertex();
  vec2 apart = (clip_from_offset * vec4(offset, 0.0)).xy + across_start - anchor_slope * axial_shown;
  anchor = anchor_pixel;
  across = half_size * apart + anchor_rest * gl_Position.w;
  #ifdef CHECKING
  gl_Position.xy += shift * gl_Position.w;
  #endif
}
`;

const VERTEX = vertex(generated.bodyVertex, false);
const VERTEX_WITH_NORMAL = vertex(generated.bodyVertexWithNormal, true);

// An instance that is mirrored shows its other side; three.js turns only whole objects.
const SIDE = `
#ifdef WITH_INSTANCES
flat in float mirrored;
#define FRONT_FACING (gl_FrontFacing == (mirrored > 0.0))
#else
#define FRONT_FACING gl_FrontFacing
#endif
`;

// Place of the interpolated point in the picture, and from that where the ray of the pixel meets its face.
const RECENTERED = `
in float axial_shown;
in vec2 across;
flat in vec2 anchor;
float axial;
uniform float longest_change;
${generated.recentered}
`;

const findAxial = (reach: number): string => `
  vec2 missing = (gl_FragCoord.xy - anchor) - across * gl_FragCoord.w;
  vec2 on_ray = recentered(axial_shown, missing, ${constant(reach)}, longest_change);
  axial = on_ray.x;
`;

const FULLSCREEN = `
void main() {
  vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(2.0 * corner - 1.0, 0.0, 1.0);
}
`;

const constant = (value: number): string => value.toExponential();

/** With places on the rays of pixels, which are at most `reach` pixels off the points that are shown. */
function recentering(fragment: string, reach: number): string {
  return fragment
    .replace("gl_FrontFacing", "FRONT_FACING")
    .replace("in float axial;\n", "")
    .replace("snapping(axial, snapping_share)", "on_ray.y * snapping_share")
    .replace("void main() {", `void main() {${findAxial(reach)}`);
}

function drawn(fragment: string, equation: BlendingEquation, uniforms: BodyUniforms, instanced: boolean): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: SIDE + RECENTERED + fragment,
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

/** Switches of the pass that adds up. */
export interface Summing {
  /** Optical depth beside the path. */
  spectral: boolean;
  /** Opaque objects end rays. */
  opaque: boolean;
  instanced: boolean;
  /** Step of the grid onto which the rasterizer moves vertices, in pixels. */
  subpixel: number;
}

/** Adds up signed paths and counts. */
export function summing(uniforms: BodyUniforms, { spectral, opaque, instanced, subpixel }: Summing): ShaderMaterial {
  const path = opaque ? generated.signedDepthBeforeOpaque : generated.signedDepth;
  const paths = opaque ? generated.spectralDepthBeforeOpaque : generated.spectralDepth;
  return drawn(recentering(spectral ? paths : path, subpixel), AddEquation, uniforms, instanced);
}

/** Adds up signed paths alone, of the picture that is moved by `shift`, into one of four channels. */
export function checking(uniforms: BodyUniforms, { opaque, instanced, subpixel }: Summing, check: CheckUniforms): ShaderMaterial {
  const path = opaque ? generated.signedDepthBeforeOpaque : generated.signedDepth;
  const one = path
    .replace("out vec2 path_and_count;", "out vec4 paths;\nuniform vec4 channel;")
    .replace(/path_and_count = .*;/, "paths = signed_path * channel;");
  const made = drawn(recentering(one, (1 + CHECK_SHIFT) * subpixel), AddEquation, { ...uniforms, ...check }, instanced);
  made.defines.CHECKING = 1;
  made.stencilWrite = true; // three's word for the test
  made.stencilFunc = EqualStencilFunc;
  made.stencilRef = 1;
  return made;
}

/** Steps of the grid by which pictures are moved to check a pixel: more than vertices are, in any direction. */
export const CHECK_SHIFT = 0.55;

/** Uniforms of what checks edges. */
export function checkUniforms() {
  return {
    shift: { value: new Vector2() },
    channel: { value: new Vector4() },
    accumulated: { value: null as Texture | null },
    rectangle: { value: new Vector4() },
    refine: { value: 1 },
    limit: { value: 0 },
  };
}

export type CheckUniforms = ReturnType<typeof checkUniforms>;

// A point at each pixel around which the sums do not lie on a line in some direction: an edge may be near. The stencil keeps
// these pixels, and the target the negative sum, to which the checks are added.
const BESIDE_EDGES = `
uniform sampler2D accumulated;
uniform ivec4 rectangle;
uniform int refine;
uniform float limit;
flat out float middle;
float path_at(ivec2 texel) { return texelFetch(accumulated, clamp(texel, ivec2(0), textureSize(accumulated, 0) - 1), 0).r; }
float bend(ivec2 texel, ivec2 to) { return abs(path_at(texel + to) + path_at(texel - to) - 2.0 * middle); }
void main() {
  ivec2 pixel = rectangle.xy + ivec2(gl_VertexID % rectangle.z, gl_VertexID / rectangle.z);
  ivec2 texel = pixel * refine + refine / 2;
  middle = path_at(texel);
  float most = max(max(bend(texel, ivec2(1, 0)), bend(texel, ivec2(0, 1))), max(bend(texel, ivec2(1, 1)), bend(texel, ivec2(1, -1))));
  vec2 place = (vec2(texel) + 0.5) * 2.0 / vec2(textureSize(accumulated, 0)) - 1.0;
  gl_Position = vec4(most <= limit ? vec2(2.0) : place, 0.0, 1.0);
  gl_PointSize = 1.0;
}
`;

const NEGATIVE = `
flat in float middle;
layout(location = 0) out vec4 paths;
void main() { paths = vec4(-middle); }
`;

/** Selects the pixels that edges may be near. */
export function besideEdges(check: CheckUniforms): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: BESIDE_EDGES,
    fragmentShader: NEGATIVE,
    uniforms: check,
    depthTest: false,
    depthWrite: false,
    blending: NoBlending,
    stencilWrite: true,
    stencilFunc: AlwaysStencilFunc,
    stencilRef: 1,
    stencilZPass: ReplaceStencilOp,
    toneMapped: false,
  });
}

/** Keeps the nearest opaque surface, as a share of the depth of the media; without a depth buffer, which would round it. */
export function nearest(uniforms: BodyUniforms, instanced: boolean, subpixel: number): ShaderMaterial {
  return drawn(recentering(generated.opaqueDepth, subpixel), MinEquation, uniforms, instanced);
}

// The last surface of bodies on each ray: its normal, outwards, and metres along the camera's axis.
const EXIT = `
in vec3 world_normal;
uniform float ahead;
uniform float axial_depth_scale;
uniform float axial_depth_start;
layout(location = 0) out vec4 normal_and_axial;
void main() {
  if (FRONT_FACING) { discard; }
  float size = length(world_normal);
  normal_and_axial = vec4(size > 0.0 ? world_normal / size : vec3(0.0), axial_shown + ahead);
  gl_FragDepth = clamp(axial_shown * axial_depth_scale + axial_depth_start, 0.0, 1.0);
}
`;

/** Keeps the last surface that rays leave through; `reversed` as the renderer's depth buffer is. */
export function last(uniforms: BodyUniforms, instanced: boolean, reversed: boolean): ShaderMaterial {
  const made = drawn("", AddEquation, uniforms, instanced);
  made.fragmentShader = `${SIDE}\nin float axial_shown;\n${reversed ? EXIT.replace("clamp", "1.0 - clamp") : EXIT}`;
  made.vertexShader = VERTEX_WITH_NORMAL;
  made.blending = NoBlending;
  made.depthTest = made.depthWrite = true;
  made.depthFunc = GreaterDepth;
  return made;
}

/** Uniforms of the pass over the pixels: fields of the blocks View and Shade. */
export function resolveUniforms() {
  return {
    accumulated: { value: null as Texture | null },
    accumulated_path: { value: null as Texture | null },
    checks: { value: null as Texture | null },
    disagreement: { value: 0 },
    refine: { value: 1 },
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

// Sums at the middle one of the pixels that a pixel is refined to.
const refined = (fragment: string): string =>
  fragment.replace("void main() {", "uniform int refine;\nvoid main() {").replace(/(accumulated(_path)?), texel,/g, "$1, texel * refine + refine / 2,");

// Valid in full only where pictures that are moved a little agree, or show nothing, as beside an outline; else the number stays.
const checked = (fragment: string, spectral: boolean): string =>
  fragment
    .replace("void main() {", "uniform sampler2D checks;\nuniform float disagreement;\nvoid main() {")
    .replace("valid ? 1.0 : 0.0,", "valid ? trust : 0.0,")
    .replace("bool covered", `float path_here = texelFetch(${spectral ? "accumulated_path" : "accumulated"}, texel * refine + refine / 2, 0).r;
    vec4 apart = abs(texelFetch(checks, texel * refine + refine / 2, 0));
    apart *= vec4(notEqual(apart, vec4(abs(path_here))));
    bool agree = path_here == 0.0 || max(max(apart.x, apart.y), max(apart.z, apart.w)) * advance <= disagreement;
    float trust = agree ? 1.0 : UNSURE;
    bool covered`)
    .replaceAll("UNSURE", constant(UNSURE));

/** Validity of a pixel by an edge whose number may be off by more than 0.1 % of the diagonal. */
export const UNSURE = 0.25;

/** From sums to metres. */
export function resolving(uniforms: ReturnType<typeof resolveUniforms>, spectral: boolean, check: boolean): ShaderMaterial {
  const fragment = refined(spectral ? generated.spectralThickness : generated.thickness);
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: FULLSCREEN,
    fragmentShader: check ? checked(fragment, spectral) : fragment,
    uniforms,
    depthTest: false,
    depthWrite: false,
    blending: NoBlending,
    toneMapped: false,
  });
}
