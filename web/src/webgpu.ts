/** Exact thickness of meshes along every view ray, for three's WebGPURenderer, and a material that absorbs light by it. */
export { ThicknessNode, thickness } from "./webgpu/ThicknessNode.js";
export type { NodePrecision, ThicknessNodeOptions } from "./webgpu/ThicknessNode.js";
export { TranslucentNodeMaterial } from "./webgpu/TranslucentNodeMaterial.js";
export type { TranslucentNodeMaterialParameters } from "./webgpu/TranslucentNodeMaterial.js";
export type { ThicknessOptions, ThicknessPixels } from "./options.js";
export { TranslucentError } from "./errors.js";
