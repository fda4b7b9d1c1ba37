/** What a pass is given: options by name, and cameras and clipping that it cannot follow. */
import type { Camera, Material, Mesh, WebGLRenderer } from "three";
import type { ExactThicknessOptions } from "./ExactThicknessPass.js";
import { TranslucentError } from "./errors.js";

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

const RULES: Record<keyof ExactThicknessOptions, Rule> = {
  bodies: OBJECTS,
  opaque: OBJECTS,
  size: SIZE,
  precision: choice("float32", "float16"),
  opticalDepth: choice("auto", true, false),
  exits: choice("auto", true, false),
};

/** Refuse options that are unknown, or of a wrong kind. */
export function checkOptions(options: ExactThicknessOptions): void {
  if (typeof options !== "object" || options === null) {
    throw new TranslucentError("options of ExactThicknessPass", `they are ${textOf(options)}`, "give an object, as { exits: true }");
  }
  for (const [name, value] of Object.entries(options)) {
    const rule = (RULES as Record<string, Rule | undefined>)[name];
    const what = `option ${name} of ExactThicknessPass`;
    if (!rule) throw new TranslucentError(what, "there is no such option", `use one of ${Object.keys(RULES).join(", ")}`);
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

/** Refuse cameras of several pictures, and planes that cut off parts of what is measured. */
export function checkView(renderer: WebGLRenderer, camera: Camera, meshes: Mesh[]): void {
  if ((camera as { isArrayCamera?: boolean }).isArrayCamera) {
    throw new TranslucentError("an ArrayCamera", "it has several pictures, and the pass measures one", "render each of its cameras by itself");
  }
  const cut = "the pass measures whole bodies, and would not be of what is seen";
  if (renderer.clippingPlanes.length > 0) {
    throw new TranslucentError("renderer.clippingPlanes", cut, "remove them, or cut the geometry");
  }
  if (!renderer.localClippingEnabled) return;
  const clipped = meshes.find((mesh) => materialsOf(mesh).some((one) => (one.clippingPlanes?.length ?? 0) > 0));
  if (clipped) {
    const name = clipped.name ? `${clipped.type} "${clipped.name}"` : clipped.type;
    throw new TranslucentError(`clippingPlanes of ${name}`, cut, "remove them, or cut the geometry");
  }
}

function materialsOf(mesh: Mesh): Material[] {
  return Array.isArray(mesh.material) ? mesh.material : [mesh.material];
}
