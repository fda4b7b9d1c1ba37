/** What a pass is given: options by name, and cameras and clipping that it cannot follow. */
import type { Camera, Mesh, Object3D, Plane } from "three";
import { TranslucentError, nameOf } from "./errors.js";
import { materials } from "./extinction.js";
import { REFINEMENTS } from "./software.js";

/** What is measured, and what ends rays. */
export interface ThicknessOptions {
  /** Meshes whose inside is measured, with all below them, or a test of a mesh. Default: those with a TranslucentMaterial. */
  bodies?: Object3D[] | ((mesh: Mesh) => boolean);
  /** Meshes that end rays, or a test of a mesh; `[]` for none. Default: all others that write depth and are not transparent. */
  opaque?: Object3D[] | ((mesh: Mesh) => boolean);
  /** Pixels of the picture. Default: those of the renderer's canvas, also after it is resized. */
  size?: [number, number];
  /** Measure the optical depth of each channel, too: always, never, or where media differ ("auto", the default). */
  opticalDepth?: "auto" | boolean;
  /** Find where rays leave bodies: always, never, or where a material bends them ("auto", the default). */
  exits?: "auto" | boolean;
  /**
   * Pixels along each side of a pixel that faces are drawn into, of which the middle one counts: 1, 3 or 5. Rasterizers put vertices
   * down on a grid of a part of a pixel (in software: 1/16, graphics cards mostly 1/256), and by edges of faces the grid decides
   * which one is shown: it is so many times as fine. Costs up to the square of it. Default: 3 in software, 1 on graphics cards.
   */
  refine?: 1 | 3 | 5;
}

/** Pixels that `read` returns; row 0 is the top one. */
export interface ThicknessPixels {
  width: number;
  height: number;
  /** Metres inside bodies; 0 where `valid` is. */
  thickness: Float32Array;
  /** Exits minus entries ahead of the eye. */
  count: Float32Array;
  /** 0 where a hole, or a face wound wrongly, leaves no number to trust. */
  valid: Uint8Array;
  /** 1 where a ray meets a body. */
  covered: Uint8Array;
}

type Rule = [(value: unknown) => boolean, string];

const choice = (...values: unknown[]): Rule => [
  (value) => values.includes(value),
  `give ${values.map((value) => JSON.stringify(value)).join(", ")}, or leave it out`,
];

const isObject3D = (value: unknown): boolean => (value as { isObject3D?: boolean } | null)?.isObject3D === true;

const OBJECTS: Rule = [
  (value) => typeof value === "function" || (Array.isArray(value) && value.every(isObject3D)),
  "give a list of objects, as [mesh], or a function that says of a mesh whether it is one",
];

const SIZE: Rule = [
  (value) => Array.isArray(value) && value.length === 2 && value.every((n) => Number.isFinite(n) && n >= 1),
  "give [width, height] in pixels",
];

/** Refuse options that are unknown, or of a wrong kind; `of` names whose they are. */
export function checkOptions(options: ThicknessOptions, of: string, precisions: string[]): void {
  if (typeof options !== "object" || options === null) {
    throw new TranslucentError(`options of ${of}`, `they are ${textOf(options)}`, "give an object, as { exits: true }");
  }
  const rules: Record<string, Rule | undefined> = {
    bodies: OBJECTS,
    opaque: OBJECTS,
    size: SIZE,
    precision: choice(...precisions),
    opticalDepth: choice("auto", true, false),
    exits: choice("auto", true, false),
    refine: choice(...REFINEMENTS),
  };
  for (const [name, value] of Object.entries(options)) {
    const rule = rules[name];
    const what = `option ${name} of ${of}`;
    if (!rule) throw new TranslucentError(what, "there is no such option", `use one of ${Object.keys(rules).join(", ")}`);
    if (value !== undefined && !rule[0](value)) throw new TranslucentError(what, `it is ${textOf(value)}`, rule[1]);
  }
}

function textOf(value: unknown): string {
  if (isObject3D(value)) return `one ${(value as { type: string }).type}`;
  if (Array.isArray(value)) return value.length ? `a list with ${textOf(value.find((one) => !isObject3D(one)) ?? value[0])} in it` : "an empty list";
  if (typeof value !== "object" || value === null) return JSON.stringify(value) ?? String(value);
  const name = value.constructor?.name;
  return name && name !== "Object" ? `a ${name}` : "an object";
}

/** A renderer's planes that cut; WebGPURenderer has none of its own. */
interface Clipping {
  clippingPlanes?: Plane[];
  localClippingEnabled?: boolean;
}

/** Refuse cameras of several pictures, and planes that cut off parts of what is measured. */
export function checkView(renderer: Clipping, camera: Camera, meshes: Mesh[]): void {
  if ((camera as { isArrayCamera?: boolean }).isArrayCamera) {
    throw new TranslucentError("an ArrayCamera", "it has several pictures, and the pass measures one", "render each of its cameras by itself");
  }
  const cut = "the pass measures whole bodies, and would not be of what is seen";
  if (renderer.clippingPlanes?.length) {
    throw new TranslucentError("renderer.clippingPlanes", cut, "remove them, or cut the geometry");
  }
  const inGroup = (mesh: Object3D | null): boolean =>
    mesh !== null && ((mesh as { isClippingGroup?: boolean }).isClippingGroup === true || inGroup(mesh.parent));
  const grouped = meshes.find(inGroup);
  if (grouped) throw new TranslucentError(`the ClippingGroup of ${nameOf(grouped)}`, cut, "use a Group, or cut the geometry");
  if (!renderer.localClippingEnabled) return;
  const clipped = meshes.find((mesh) => materials(mesh).some((one) => (one.clippingPlanes?.length ?? 0) > 0));
  if (clipped) throw new TranslucentError(`clippingPlanes of ${nameOf(clipped)}`, cut, "remove them, or cut the geometry");
}
