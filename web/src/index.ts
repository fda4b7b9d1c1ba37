/** Exact thickness of meshes along every view ray, for three.js, and a material that absorbs light by it. */
export { ExactThicknessPass } from "./ExactThicknessPass.js";
export type { ExactThicknessOptions, Precision } from "./ExactThicknessPass.js";
