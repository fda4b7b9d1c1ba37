/** Exact thickness of meshes along every view ray, for three.js, and a material that absorbs light by it. */
export { ExactThicknessPass } from "./ExactThicknessPass.js";
export type { ExactThicknessOptions, Precision } from "./ExactThicknessPass.js";
export { TranslucentMaterial } from "./TranslucentMaterial.js";
export type { TranslucentMaterialParameters } from "./TranslucentMaterial.js";
export type { ThicknessOptions, ThicknessPixels } from "./options.js";
export { TranslucentError } from "./errors.js";
