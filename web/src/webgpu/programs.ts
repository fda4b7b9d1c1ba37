/** Materials of the passes for WebGPURenderer: what programs.ts is for WebGLRenderer, as nodes (TSL). */
import { AddEquation, CustomBlending, DoubleSide, NoBlending, OneFactor, InstancedBufferAttribute, NodeMaterial } from "three/webgpu";
import type { IUniform, InstancedMesh, Texture } from "three";
import * as tsl from "three/tsl";
import type { StandIn } from "../bodies.js";
import * as generated from "../generated/nodes.js";
import { NOTHING } from "../generated/shaders.js";
import { bodyUniforms } from "../uniforms.js";
import type { BodyUniforms } from "../uniforms.js";

/** A node; their types would say no more than its name. */
// eslint-disable-next-line @typescript-eslint/no-explicit-any
export type Nodes = any;

const { bool, float, int, ivec2, normalLocal, positionLocal, screenCoordinate, select, uniform, vec2, vec4, varying } = tsl as Nodes;
const { dot, frontFacing, max, min, normalize, round, length, instancedBufferAttribute, Discard, Fn, If } = tsl as Nodes;

/** Step of the grid onto which rasterizers move vertices, in pixels: the coarsest that Vulkan allows; WebGPU tells of none. */
const SUBPIXEL = 1 / 16;

/** Fixed point: this many steps make the length of `Scale.range`, in digits of 7 bits, which half floats add up exactly. */
const STEPS = 2 ** 27;
const BASE = 128;

/** Faces on a ray up to which sums of digits are exact: 2048 / 64. */
export const MOST_FACES = 32;

/** Uniforms of one body, as nodes; `place` sets their values. */
export function bodyNodes(): BodyUniforms {
  const values = Object.entries(bodyUniforms()).filter(([, { value }]) => value !== null);
  return Object.fromEntries(values.map(([name, { value }]) => [name, uniform(value)])) as unknown as BodyUniforms;
}

/** Texel of a picture at this pixel; the middle one of those that it is refined to. */
export const here = (texture: Texture, refine = 1): Nodes =>
  (tsl as Nodes).textureLoad(texture, ivec2(screenCoordinate).mul(int(refine)).add(int((refine - 1) / 2)), int(0));

/** Signs of mirrored instances, each of which shows its other side; null where none is mirrored. */
function mirrored(mesh: InstancedMesh): Nodes | null {
  const matrices = mesh.instanceMatrix.array;
  const signs = Float32Array.from({ length: mesh.count }, (_, i) => {
    const [a, b, c, , d, e, f, , g, h, k] = matrices.slice(16 * i, 16 * i + 11);
    return Math.sign(a * (e * k - f * h) - d * (b * k - c * h) + g * (b * f - c * e)) || 1;
  });
  return signs.every((sign) => sign > 0) ? null : varying(instancedBufferAttribute(new InstancedBufferAttribute(signs, 1)));
}

/** A change of these asks for another material. */
export function keyOf({ instanced }: StandIn): string {
  return instanced ? `${instanced.count} ${instanced.instanceMatrix.version}` : "";
}

/** The fragment of a face: metres along the camera's axis where the ray of the pixel meets it, and its side. */
interface Face {
  /** Metres from the anchor of the body, on the ray of the pixel itself. */
  axial: Nodes;
  /** Metres that the grid of the rasterizer may misplace it by. */
  misplaced: Nodes;
  /** Metres from the anchor of the body, as interpolated. */
  shown: Nodes;
  /** The ray enters here. */
  front: Nodes;
}

function drawn(one: StandIn, fragment: (face: Face, material: NodeMaterial) => Nodes): NodeMaterial {
  const u = one.uniforms as Record<string, Nodes>;
  const made = new NodeMaterial();
  const offset = positionLocal.sub(u.center);
  const clip = u.clip_from_offset.mul(vec4(offset, 1));
  const along = dot(u.axis.xyz, offset).add(u.axis.w);
  const apart = u.clip_from_offset.mul(vec4(offset, 0)).xy.add(u.across_start).sub(u.anchor_slope.mul(along));
  made.vertexNode = clip;
  // Place of the interpolated point in the picture, and from that where the ray of the pixel meets its face.
  const shown = varying(along);
  const across = varying(u.half_size.mul(apart).add(u.anchor_rest.mul(clip.w)));
  const weight = varying(clip.w);
  const up = vec2(screenCoordinate.x, u.half_size.y.mul(2).sub(screenCoordinate.y));
  const missing = up.sub(u.anchor_pixel).sub(across.div(weight)); // upwards, as derivatives of TSL
  const onRay = generated.recentered(shown, missing, float(SUBPIXEL), u.longest_change).toVar();
  const signs = one.instanced && mirrored(one.instanced);
  const front = signs ? signs.greaterThan(0).equal(frontFacing) : frontFacing;
  made.fragmentNode = fragment({ axial: onRay.x, misplaced: onRay.y, shown, front }, made);
  made.side = DoubleSide;
  made.forceSinglePass = true;
  made.depthTest = made.depthWrite = made.fog = made.lights = made.toneMapped = false;
  made.blending = NoBlending;
  return made;
}

const adding = (made: NodeMaterial): NodeMaterial => {
  made.blending = CustomBlending;
  made.blendEquation = AddEquation;
  made.blendSrc = made.blendDst = OneFactor;
  return made;
};

/** What a pass adds up, one draw each: signed path and count in floats; the same in digits, in two halves; optical depth. */
export type Summed = "path" | "high" | "low" | "spectral";

/** Adds up signed paths and counts; before the texture of opaque ends, if there is one. */
export function summing(one: StandIn, what: Summed, ends: Texture | null, range: IUniform<number>): NodeMaterial {
  const u = one.uniforms as Record<string, Nodes>;
  return adding(
    drawn(one, ({ axial, misplaced, front }) => {
      const side = select(front, float(-1), float(1));
      let reached = max(axial, u.axial_start);
      if (ends) {
        const end = here(ends);
        reached = min(reached, select(end.g.greaterThan(0), end.r.sub(u.axial_depth_start).div(u.axial_depth_scale), float(NOTHING)));
      }
      const path = side.mul(reached);
      const share = misplaced.mul(u.snapping_share);
      if (what === "spectral") return vec4(path.mul(u.extinction.rgb), 0);
      if (what === "path") return vec4(path, generated.count_with_fraction(side.mul(u.count_weight), share), 0, 0);
      const digits = digitsOf(path.div(range as Nodes));
      return what === "high" ? vec4(side, 1, digits[3], digits[2]) : vec4(digits[1], digits[0], share, 0);
    }),
  );
}

/** Digits of a number between -1 and 1, the least first; each is between -64 and 63. */
function digitsOf(value: Nodes): Nodes[] {
  let rest = int(round(value.clamp(-1, 1).mul(STEPS))).toVar();
  return Array.from({ length: 4 }, () => {
    const digit = rest.add(int(BASE / 2)).bitAnd(int(BASE - 1)).sub(int(BASE / 2)).toVar();
    rest = rest.sub(digit).div(int(BASE)).toVar();
    return float(digit);
  });
}

/** Keeps the nearest opaque surface: its depth as a share of that of the media (r); 1 where there is one (g). */
export function nearest(one: StandIn, reversed: boolean): NodeMaterial {
  const u = one.uniforms as Record<string, Nodes>;
  const made = drawn(one, ({ axial }, material) => {
    const share = axial.mul(u.axial_depth_scale).add(u.axial_depth_start);
    material.depthNode = kept(share, reversed);
    return Fn(() => {
      If(axial.lessThan(u.axial_start), () => {
        Discard();
      });
      return vec4(share, 1, 0, 0);
    })();
  });
  made.depthTest = made.depthWrite = true;
  return made;
}

/** Keeps the last surface that rays leave through: its normal, outwards, and metres along the camera's axis. */
export function last(one: StandIn, reversed: boolean): NodeMaterial {
  const u = one.uniforms as Record<string, Nodes>;
  const made = drawn(one, ({ shown, front }, material) => {
    const normal = varying(u.world_from_normal.mul(vec4(normalLocal, 0)).xyz);
    material.depthNode = kept(shown.mul(u.axial_depth_scale).add(u.axial_depth_start), !reversed);
    return Fn(() => {
      If(front, () => {
        Discard();
      });
      return vec4(select(length(normal).greaterThan(0), normalize(normal), normal), shown.add(u.ahead));
    })();
  });
  made.depthTest = made.depthWrite = true;
  return made;
}

/** Depth that keeps the least share, or the greatest. */
const kept = (share: Nodes, greatest: boolean): Nodes => (greatest ? share.clamp(0, 1).oneMinus() : share.clamp(0, 1));

/** Uniforms of the pass over the pixels. */
export interface Resolving {
  frame_size: Nodes;
  ray_right: Nodes;
  ray_up: Nodes;
  ray_forward: Nodes;
  expected_count: Nodes;
  rounding: Nodes;
  count_share: Nodes;
  coverage_floor: Nodes;
  /** Length of all digits, in metres. */
  range: Nodes;
}

/** Metres per metre of advance along the camera's axis. */
function advanceOf(u: Resolving): Nodes {
  return length(generated.view_ray(screenCoordinate, u.frame_size.xy, u.ray_right.xyz, u.ray_up.xyz, u.ray_forward.xyz));
}

function resolving(output: Nodes): NodeMaterial {
  const made = new NodeMaterial();
  made.fragmentNode = output;
  made.depthTest = made.depthWrite = made.fog = made.lights = made.toneMapped = false;
  made.blending = NoBlending;
  return made;
}

/** From sums to metres, count, validity and coverage; `low` holds the other half of sums in digits. */
export function thicknessOf(u: Resolving, sums: Texture, low: Texture | null, refine: number): NodeMaterial {
  const advance = advanceOf(u);
  const sum = here(sums, refine);
  let [path, count, misplaced, exact] = [sum.r, sum.g, generated.misplaced_length(sum.g, advance, u.count_share), bool(true)];
  if (low) {
    const rest = here(low, refine);
    const whole = [sum.b, sum.a, rest.r, rest.g].map((digit) => int(digit)).reduce((all, digit) => all.mul(int(BASE)).add(digit));
    path = float(whole).mul(u.range).div(STEPS);
    count = sum.r;
    misplaced = rest.b.mul(u.count_share).mul(advance);
    exact = sum.g.lessThanEqual(MOST_FACES);
  }
  const thickness = path.mul(advance).toVar();
  const valid = generated
    .is_balanced(count, u.expected_count)
    .and(generated.is_length(thickness, misplaced, u.rounding))
    .and(exact)
    .toVar();
  const covered = thickness.greaterThan(u.coverage_floor).or(valid.not());
  const flag = (one: Nodes): Nodes => select(one, float(1), float(0));
  return resolving(vec4(select(valid, max(thickness, 0), float(0)), generated.whole_count(count), flag(valid), flag(covered)));
}

/** From sums to optical depth per channel, where `thickness` is valid. */
export function opticalDepthOf(u: Resolving, sums: Texture, thickness: Texture, refine: number): NodeMaterial {
  const depth = max(here(sums, refine).rgb.mul(advanceOf(u)), 0);
  return resolving(select(here(thickness).b.greaterThan(0), vec4(depth, 1), vec4(0, 0, 0, 1)));
}
